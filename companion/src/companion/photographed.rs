//! The photographed waypoints of an area: noted in flight, stored in flash, exchanged between
//! vehicles, and left out by the next start's plan.

use mavlink::dialects::ardupilotmega::NAMED_VALUE_FLOAT_DATA;
use planner_core::flight::WaypointRange;

use super::Companion;
use crate::events::Link;
use crate::link::OnDemandMessage;
use crate::link::photographed::{self, PhotographedReport};
use crate::mission::photographed::{FlightStage, PlanningPartners};
use crate::state::State;
use crate::time::Duration;
use crate::timers::Timer;

/// Period at which the photographed waypoints are noted, stored if enough are new, and their number
/// is sent on both links.
const NOTE_PHOTOGRAPHED_EVERY: Duration = Duration::from_millis(1000);
/// Time within which each vehicle on the ground has heard the reports of the others: they come each
/// second, and half of the messages may be lost.
const OTHERS_REPORT_WITHIN: Duration = Duration::from_secs(5);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Waypoints of the area that the plan requested by [`crate::events::PlanKind::Mission`] leaves
    /// out, because earlier flights photographed them. Plans of divisions in the same flight leave
    /// them out too.
    pub fn excluded_waypoints(&self) -> &[WaypointRange] {
        self.mission.photographed().waypoints_left_out()
    }

    /// Whether the mission photographs an area.
    fn is_area_mission(&self) -> bool {
        self.neighbours.fleet().is_some()
    }

    /// Whether this vehicle was not started yet, or waits on its pad for its departure
    /// (`Scheduled`): until then its plan may still be replaced by one that fits the others'.
    fn is_before_departure(&self) -> bool {
        self.is_not_started() || self.mission.state() == State::Scheduled
    }

    /// How far this vehicle's flight is.
    fn flight_stage(&self) -> FlightStage {
        match self.mission.state() {
            _ if self.is_before_departure() => FlightStage::OnPad,
            state if state.is_over() => FlightStage::Over,
            _ => FlightStage::UnderWay,
        }
    }

    /// Whether the photographed waypoints are to be noted, stored and reported now, at 1 Hz.
    pub(super) fn take_photographed_due(&mut self) -> bool {
        self.is_area_mission()
            && self.timers.take_due(Timer::NotePhotographed, self.now, NOTE_PHOTOGRAPHED_EVERY)
    }

    /// Notes the photographed waypoints of its own path, up to `pictures_to_m` metres along it;
    /// that is `None` where the vehicle takes no pictures.
    pub(super) fn note_photographed(&mut self, pictures_to_m: Option<f32>) {
        if self.flight_stage() == FlightStage::UnderWay
            && !self.detours.has_left_plan()
            && self.guidance.reference_along_m() >= 0.0
            && let Some(along_m) = pictures_to_m
        {
            self.mission.note_photographed(along_m);
        }
    }

    /// Stores the photographed waypoints in flash if enough are new, and makes the messages that
    /// report them due.
    pub(super) fn store_and_report_photographed(&mut self) {
        let (crc, stage) = (self.config.mission_crc, self.flight_stage());
        if let Some(kept) = self.mission.photographed_mut().record_to_store(crc, stage) {
            self.services.set_photographed_record(kept);
        }
        [Link::Autopilot, Link::Swarm]
            .into_iter()
            .for_each(|link| self.links.set_due(link, OnDemandMessage::PhotographedCount));
        let every = match stage {
            FlightStage::UnderWay => photographed::PERIOD_IN_FLIGHT,
            FlightStage::OnPad | FlightStage::Over => photographed::PERIOD_ON_GROUND,
        };
        if self.timers.take_due(Timer::PhotographedReport, self.now, every) {
            self.links.set_due(Link::Swarm, OnDemandMessage::PhotographedReport);
        }
    }

    /// This vehicle's report of the photographed waypoints to the others.
    pub(super) fn photographed_report(&mut self) -> PhotographedReport {
        let stage = self.flight_stage();
        let report = self.mission.photographed_mut().next_report(stage);
        PhotographedReport {
            system_id: self.config.system_id,
            mission_crc: self.config.mission_crc,
            ..report
        }
    }

    /// Handles another vehicle's report of photographed waypoints.
    pub(super) fn handle_photographed_report(&mut self, report: &PhotographedReport) {
        let ours = report.mission_crc == self.config.mission_crc
            && self.config.roster.iter().any(|entry| entry.system_id == report.system_id);
        if ours && self.is_area_mission() && self.config.skips_photographed {
            let planning = match self.mission.state() {
                _ if !self.is_before_departure() => PlanningPartners::Nobody,
                // Once started in a flight that others have begun, this vehicle keeps its plan
                // whatever vehicles on the ground report.
                State::Scheduled if self.neighbours.is_flight_under_way(self.now) => {
                    PlanningPartners::ThoseInFlight
                }
                _ => PlanningPartners::All,
            };
            self.mission.photographed_mut().handle_report(report, planning, self.now);
        }
    }

    /// NAMED_VALUE_FLOAT with the number of waypoints that this vehicle knows to be photographed.
    pub(super) fn photographed_count_message(&self) -> NAMED_VALUE_FLOAT_DATA {
        NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: self.now.as_boot_ms(),
            value: self.mission.photographed().count() as f32,
            name: (*b"FLK_DONE\0\0").into(),
        }
    }

    /// Whether this vehicle's plan agrees with the others': it has stood ready for as long as their
    /// reports take, and no vehicle was heard with another plan. True in a mission without an area.
    pub(super) fn shares_plan_with_others(&self) -> bool {
        !self.is_area_mission()
            || (self.mission.time_in_state(self.now) >= OTHERS_REPORT_WITHIN
                && !self.hears_another_plan())
    }

    /// Whether a vehicle was heard lately that follows another plan of this mission: the gates of
    /// two plans do not fit each other.
    pub(super) fn hears_another_plan(&self) -> bool {
        self.is_area_mission() && self.neighbours.hears_another_plan(self.now)
    }
}
