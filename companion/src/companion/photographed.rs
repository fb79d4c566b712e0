//! What of the area is photographed: noted in flight, kept in flash, exchanged, and left out by the
//! next plan.

use mavlink::dialects::ardupilotmega::NAMED_VALUE_FLOAT_DATA;
use planner_core::flight::WaypointRange;

use super::Companion;
use crate::events::Link;
use crate::link::OnDemandMessage;
use crate::link::done::{self, DoneReport};
use crate::mission::State;
use crate::time::Duration;
use crate::timers::Timer;

/// Period at which photographed waypoints are noted and their number is sent.
const NOTE_EVERY: Duration = Duration::from_millis(1000);
/// Time within which others on the ground report what they know: they report each second, and half
/// of the messages are lost.
const OTHERS_REPORT_WITHIN: Duration = Duration::from_secs(5);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Waypoints of the area that the plan asked for by [`crate::events::PlanKind::Mission`] leaves
    /// out, those asked for later too.
    pub fn excluded_waypoints(&self) -> &[WaypointRange] {
        self.mission.photographed().waypoints_left_out()
    }

    /// Whether the mission is an area.
    fn is_area_mission(&self) -> bool {
        self.neighbours.fleet().is_some()
    }

    /// Whether it stands on its pad before its start, and is to plan the same as others that do.
    fn plans_with_others(&self) -> bool {
        self.is_not_started() || self.mission.state() == State::Scheduled
    }

    /// Whether it has left its pad, so that more may come.
    fn has_left_pad(&self) -> bool {
        !self.plans_with_others() && !matches!(self.mission.state(), State::Done | State::Aborted)
    }

    /// Notes what it has photographed, where it is on its plan.
    pub(super) fn update_photographed(&mut self, off_plan: bool) {
        if !self.is_area_mission() || !self.timers.take_due(Timer::Done, self.now, NOTE_EVERY) {
            return;
        }
        let flies = self.has_left_pad();
        let along_m = self.guidance.progress_m(self.mission.state(), &self.guidance_inputs());
        if flies && !off_plan && !self.detours.has_left_plan() && self.guidance.along_m() >= 0.0 {
            self.mission.note_photographed(along_m);
        }
        let crc = self.config.mission_crc;
        if let Some(kept) = self.mission.photographed_mut().record_to_store(crc, !flies) {
            self.services.store_photographed(kept);
        }
        [Link::Autopilot, Link::Swarm]
            .into_iter()
            .for_each(|link| self.links.set_due(link, OnDemandMessage::DoneCount, true));
        let every = if flies { done::PERIOD_IN_FLIGHT } else { done::PERIOD_ON_GROUND };
        if self.timers.take_due(Timer::DoneReport, self.now, every) {
            self.links.set_due(Link::Swarm, OnDemandMessage::Done, true);
        }
    }

    /// The report of photographed waypoints to other vehicles.
    pub(super) fn done_report(&mut self) -> DoneReport {
        let (waits, flies) = (self.plans_with_others(), self.has_left_pad());
        let report = self.mission.photographed_mut().report(waits, flies);
        DoneReport {
            system_id: self.config.system_id,
            mission_crc: self.config.mission_crc,
            ..report
        }
    }

    /// Handles a report of photographed waypoints from another vehicle.
    pub(super) fn handle_done_report(&mut self, report: &DoneReport) {
        let ours = report.mission_crc == self.config.mission_crc
            && self.config.roster.iter().any(|entry| entry.system_id == report.system_id);
        if ours && self.is_area_mission() && self.config.resumes {
            let waits = self.plans_with_others();
            self.mission.photographed_mut().handle_report(report, waits, self.now);
        }
    }

    /// The number of waypoints that this vehicle knows to be photographed, as a value to be
    /// plotted.
    pub(super) fn done_count_message(&self) -> NAMED_VALUE_FLOAT_DATA {
        NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: self.now.as_boot_ms(),
            value: self.mission.photographed().count() as f32,
            name: (*b"FLK_DONE\0\0").into(),
        }
    }

    /// Whether it has stood ready for as long as others take to say what they know, and all that
    /// are heard have its plan.
    pub(super) fn plans_as_others(&self) -> bool {
        !self.is_area_mission()
            || (self.mission.time_in_state(self.now) >= OTHERS_REPORT_WITHIN
                && !self.hears_another_plan())
    }

    /// Whether a vehicle that follows another plan of this mission was heard lately: their gates do
    /// not fit.
    pub(super) fn hears_another_plan(&self) -> bool {
        self.is_area_mission() && self.neighbours.hears_another_plan(self.now)
    }
}
