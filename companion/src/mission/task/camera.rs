//! The camera: commands that make the autopilot take pictures along the path's photographed
//! stretches.
//!
//! Two triggers. By distance: `MAV_CMD_DO_SET_CAM_TRIGG_DIST` switches the autopilot's trigger on
//! at a stretch's first place and off at its last, with a picture at each. By waypoint:
//! `MAV_CMD_DO_DIGICAM_CONTROL` takes each picture. Commands are sent one after the other, each
//! repeated until it is acknowledged, and dropped after five tries. A vehicle that leaves its path
//! between two pictures takes a last one there: others photograph the rest, but may not come near
//! to a vehicle that hovers there. The trigger is then off. Back on the path it starts with a
//! picture at once, so that no gap is wider than the spacing.

use heapless::Deque;
use libm::atan2f;
use planner_core::Length;
use planner_core::flight::{HeadingMode, Path, PicturePlan, PictureStretch, Trigger};

use super::along::{PathProgress, PathRelation};
use crate::autopilot::telemetry::Ack;
use crate::events::Link;
use crate::link::Links;
use crate::link::outbox::Outgoing;
use crate::link::severity::Severity;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Most camera commands in the queue.
const MAX_COMMANDS: usize = 4;
/// Time after which an unacknowledged command is sent again.
const REPEAT_EVERY: Duration = Duration::from_millis(300);
/// Number of times that a command is sent before it is dropped and reported.
const MAX_TRIES: u8 = 5;
/// Distance before a picture's place within which the reference of a vehicle that holds counts as
/// there, metres.
const HOLDS_AT_PICTURE_WITHIN_M: f32 = 0.3;
/// `MAV_RESULT` ACCEPTED.
const ACCEPTED: u8 = 0;
/// Shortest horizontal length of a stretch from which a heading is computed, metres.
const MIN_HEADING_STRETCH_M: f32 = 0.1;

/// `MAV_CMD` number of DO_DIGICAM_CONTROL.
const DO_DIGICAM_CONTROL: u16 = 203;
/// `MAV_CMD` number of DO_SET_CAM_TRIGG_DIST.
const DO_SET_CAM_TRIGG_DIST: u16 = 206;

/// A camera command to the autopilot.
#[derive(Clone, Copy, Debug, PartialEq)]
enum CameraCommand {
    /// Take a picture now, then one after each distance of this many metres; with 0 only the one
    /// now.
    Every(f32),
    /// Stop taking pictures.
    Off,
    /// Take one picture now.
    Picture,
}

impl CameraCommand {
    /// The command's `MAV_CMD` number.
    fn mav_command(self) -> u16 {
        match self {
            Self::Every(_) | Self::Off => DO_SET_CAM_TRIGG_DIST,
            Self::Picture => DO_DIGICAM_CONTROL,
        }
    }

    /// The command as a message to the autopilot.
    fn to_message(self) -> Outgoing {
        match self {
            Self::Every(step_m) => Outgoing::TriggerEvery { step_m, at_once: true },
            Self::Off => Outgoing::TriggerEvery { step_m: 0.0, at_once: false },
            Self::Picture => Outgoing::TakePicture,
        }
    }
}

/// State of the camera commands along one path.
#[derive(Clone, Debug, Default)]
pub(super) struct CameraControl {
    /// Index of the current stretch of the path.
    stretch_index: usize,
    /// Number of the next picture on the current stretch, from 0.
    next_picture: u32,
    /// On a detour beside the path: place along the detour where the next picture is taken, metres.
    next_detour_picture_m: f32,
    /// Which path the vehicle flies.
    path_relation: PathRelation,
    /// The trigger in use from the first picture of a stretch or detour to the last; with
    /// [`Trigger::Distance`] the autopilot's trigger is on. `None` elsewhere.
    running_trigger: Option<Trigger>,
    /// Commands that are to be sent or wait for their answers, oldest first.
    commands: Deque<CameraCommand, MAX_COMMANDS>,
    /// Number of commands sent since the last answer, repetitions included.
    tries: u8,
    /// Whether the first queued command was sent.
    current_sent: bool,
    /// Whether a command was dropped or refused: from then on such failures are not reported.
    failure_reported: bool,
    /// The plan's trigger, while the reference is no further than 0.3 m before the next picture's
    /// place (by distance: before the stretch's first), or beyond it; else `None`.
    due_trigger: Option<Trigger>,
}

impl CameraControl {
    /// Queues the camera commands that are due at this place of the path. Returns whether the
    /// vehicle leaves its path at this place, and takes no more pictures.
    pub(super) fn step<const W: usize>(
        &mut self,
        photographs: &PicturePlan,
        path: &Path<W>,
        along: PathProgress,
    ) -> bool {
        let before = core::mem::replace(&mut self.path_relation, along.relation);
        if photographs.trigger != Trigger::None {
            let beside = along.relation == PathRelation::Beside;
            if beside != (before == PathRelation::Beside) {
                // Pictures begin again where the vehicle leaves its path, and where it comes back:
                // neither place may lie in a gap between two pictures.
                self.next_detour_picture_m = 0.0;
                self.switch_off();
            }
            self.due_trigger = None;
            match photographs.stretches(path).nth(self.stretch_index) {
                _ if beside => self.photograph_whole_detour(photographs, along.progress_m),
                Some(shots) if along.relation == PathRelation::OnPath => {
                    self.update_trigger(photographs.trigger, &shots, along);
                }
                _ => self.end_early(),
            }
        }
        (before, along.relation) == (PathRelation::OnPath, PathRelation::Elsewhere)
    }

    /// Begins another path; commands that are still queued are sent first. A vehicle that holds
    /// where a picture is due takes it now: the autopilot's trigger may lag behind the last
    /// pictures, and is switched off.
    pub(super) fn begin_path(&mut self) {
        match self.due_trigger.take() {
            Some(Trigger::Distance) => self.queue_command(CameraCommand::Every(0.0)),
            Some(_) => self.queue_command(CameraCommand::Picture),
            None => self.switch_off(),
        }
        (self.stretch_index, self.next_picture, self.running_trigger) = (0, 0, None);
        (self.path_relation, self.next_detour_picture_m) = (PathRelation::Elsewhere, 0.0);
    }

    /// Switches the autopilot's trigger off, without a further picture.
    fn switch_off(&mut self) {
        if self.running_trigger.take() == Some(Trigger::Distance) {
            self.queue_command(CameraCommand::Off);
        }
    }

    /// Takes one more picture if the vehicle leaves its path within a stretch, and switches the
    /// trigger off.
    fn end_early(&mut self) {
        match self.running_trigger.take() {
            Some(Trigger::Distance) => self.queue_command(CameraCommand::Every(0.0)),
            Some(_) => self.queue_command(CameraCommand::Picture),
            None => {}
        }
    }

    /// Switches the autopilot's trigger by distance on, with a picture at once.
    fn switch_on(&mut self, step_m: f32) {
        if self.running_trigger.replace(Trigger::Distance).is_none() {
            self.queue_command(CameraCommand::Every(step_m));
        }
    }

    /// On a detour beside the path pictures are taken at the path's spacing, even beside parts of
    /// the path without pictures.
    fn photograph_whole_detour(&mut self, photographs: &PicturePlan, progress_m: f32) {
        let spacing_m = photographs.max_spacing_m;
        if photographs.trigger == Trigger::Distance {
            self.switch_on(spacing_m);
        } else if progress_m >= self.next_detour_picture_m {
            self.next_detour_picture_m = progress_m + spacing_m;
            self.running_trigger = Some(photographs.trigger);
            self.queue_command(CameraCommand::Picture);
        }
    }

    /// On the path: switches the trigger on or off, or takes the picture that is due, and moves on
    /// to the next stretch at the end of this one, `shots`.
    fn update_trigger(
        &mut self,
        trigger: Trigger,
        shots: &PictureStretch<'_>,
        along: PathProgress,
    ) {
        let progress_m = along.progress_m;
        let next_m = match trigger {
            Trigger::Distance => shots.from_m,
            _ => shots.picture_arc_length_m(self.next_picture),
        };
        // A vehicle counts as holding once its setpoint stands; the vehicle may still be up to a
        // metre short of the setpoint.
        self.due_trigger =
            Some(trigger).filter(|_| along.reference_m >= next_m - HOLDS_AT_PICTURE_WITHIN_M);
        if progress_m < shots.from_m {
            self.switch_off();
            return;
        }
        let distance = trigger == Trigger::Distance;
        match trigger {
            Trigger::Distance if progress_m < shots.to_m => {
                self.switch_on(shots.ground_spacing_m);
                return;
            }
            Trigger::Distance => self.queue_command(CameraCommand::Every(0.0)),
            _ => {
                // Of several pictures passed within one step one is taken: all would show the same.
                let before = self.next_picture;
                while self.next_picture < shots.count
                    && shots.picture_arc_length_m(self.next_picture) <= progress_m
                {
                    self.next_picture += 1;
                }
                if self.next_picture > before {
                    self.due_trigger = None;
                    self.running_trigger = Some(trigger);
                    self.queue_command(CameraCommand::Picture);
                }
            }
        }
        if distance || self.next_picture == shots.count {
            self.due_trigger = None;
            (self.stretch_index, self.next_picture, self.running_trigger) =
                (self.stretch_index + 1, 0, None);
        }
    }

    /// Adds a command to the queue.
    fn queue_command(&mut self, order: CameraCommand) {
        // The queue is full while the autopilot is silent: drop the oldest command, whose place is
        // farthest away. Its tries count for the next command, so that the silence is reported.
        if self.commands.is_full() {
            self.commands.pop_front();
            self.current_sent = false;
        }
        let _ = self.commands.push_back(order);
    }

    /// Sends the first queued command, and repeats it until it is acknowledged or has been sent
    /// five times.
    pub(super) fn send_current_command(
        &mut self,
        now: Instant,
        timers: &mut Timers,
        links: &mut Links,
    ) {
        let Some(&order) = self.commands.front() else { return };
        if self.current_sent && !timers.is_due(Timer::CameraCommand, now) {
            return;
        }
        if self.tries == MAX_TRIES {
            // A command that was not sent stays: the tries were those of an earlier command, which
            // was dropped when the queue was full.
            if self.current_sent {
                self.commands.pop_front();
            }
            (self.tries, self.current_sent) = (0, false);
            if !core::mem::replace(&mut self.failure_reported, true) {
                links.send_text(Severity::Warning, "Camera trigger is not acknowledged");
            }
            return;
        }
        links.push(Link::Autopilot, order.to_message());
        self.tries += 1;
        self.current_sent = true;
        timers.set(Timer::CameraCommand, now + REPEAT_EVERY);
    }

    /// Removes the first command from the queue, answered or not.
    fn drop_current_command(&mut self) {
        self.commands.pop_front();
        (self.tries, self.current_sent) = (0, false);
    }

    /// Handles a COMMAND_ACK: the answered command leaves the queue, and the first refusal is
    /// reported.
    pub(super) fn handle_ack(&mut self, ack: &Ack, links: &mut Links) {
        let waits = self.current_sent
            && self.commands.front().is_some_and(|o| o.mav_command() == ack.command);
        if !waits {
            return;
        }
        self.drop_current_command();
        if ack.result != ACCEPTED && !core::mem::replace(&mut self.failure_reported, true) {
            links.send_text_with_numbers(
                Severity::Warning,
                "Autopilot refuses the camera: # (result #)",
                [u32::from(ack.command), u32::from(ack.result)],
            );
        }
    }
}

/// Heading of the vehicle `along_m` metres along its path, radians from east, counter-clockwise:
/// the plan's fixed heading if there is one; else the direction of the stretch there, or of the
/// next stretch before its first picture, and behind the last stretch that stretch's. `None` on a
/// path without a stretch.
pub(super) fn heading<const W: usize>(
    photographs: &PicturePlan,
    path: &Path<W>,
    along_m: f32,
) -> Option<f32> {
    if let HeadingMode::FixedEnuRad(heading) = photographs.heading_mode {
        return Some(heading);
    }
    let mut found = None;
    for shots in photographs.stretches(path) {
        let way = path.point_at(shots.to_m)? - path.point_at(shots.from_m)?;
        if way.xy().length() > MIN_HEADING_STRETCH_M {
            found = Some(atan2f(way.y, way.x));
        }
        if shots.to_m >= along_m && found.is_some() {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests;
