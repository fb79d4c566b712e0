//! The one table of what is due when.
//!
//! Three timers wake the shell ([`Timers::next_due`]): the step of the control loop, heartbeats,
//! and the swarm's state. The rest are looked at in each step: what they name happens in the first
//! step at or after their time.

use crate::time::{Duration, Instant};

/// Periodic and delayed actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Timer {
    /// A step of the control loop.
    Step,
    /// Heartbeats on both links.
    Heartbeat,
    /// Position and intent to the swarm.
    Swarm,
    /// Roster message of a coverage mission, to the swarm.
    Roster,
    /// Photographed waypoints of the area: noted, kept, reported.
    Done,
    /// Photographed waypoints of the area, to the swarm.
    DoneReport,
    /// The request that the state repeats: mode, take-off, landing, disarming.
    Request,
    /// A request for the EKF origin.
    Origin,
    /// Streams may be requested again.
    Streams,
    /// A request for a limit of the autopilot's.
    Limit,
    /// A setpoint that was held may be reported again.
    HeldReport,
    /// An EKF origin that is not used may be reported again.
    OriginReport,
}

const TIMER_COUNT: usize = 12;
/// Timers that wake the shell.
const WAKING_TIMERS: [Timer; 3] = [Timer::Step, Timer::Heartbeat, Timer::Swarm];

/// When each is due; at the start all are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timers {
    due_at: [Instant; TIMER_COUNT],
    stepped_at: Instant,
}

impl Timers {
    /// Due at this time, whatever was set.
    pub(crate) fn set(&mut self, timer: Timer, at: Instant) {
        self.due_at[timer as usize] = at;
    }

    /// Due at this time, or earlier if it already was.
    pub(crate) fn set_no_later(&mut self, timer: Timer, at: Instant) {
        let due_at = &mut self.due_at[timer as usize];
        *due_at = (*due_at).min(at);
    }

    /// Whether it is due.
    pub(crate) fn is_due(&self, timer: Timer, now: Instant) -> bool {
        now >= self.due_at[timer as usize]
    }

    /// Whether it is due; if so, it is next due after `every`.
    pub(crate) fn take_due(&mut self, timer: Timer, now: Instant, every: Duration) -> bool {
        let due = self.is_due(timer, now);
        if due {
            self.set(timer, now + every);
        }
        due
    }

    /// Sets the next due time to `every` after the last one. After a gap the period starts again
    /// instead of catching up.
    pub(crate) fn schedule_next(&mut self, timer: Timer, now: Instant, every: Duration) {
        let due = self.due_at[timer as usize] + every;
        self.set(timer, if due > now { due } else { now + every });
    }

    /// Time since the step before, seconds; this is the next.
    pub(crate) fn step_s(&mut self, now: Instant) -> f32 {
        (now - core::mem::replace(&mut self.stepped_at, now)).as_secs_f32()
    }

    /// When the shell is to call again.
    pub(crate) fn next_due(&self) -> Instant {
        WAKING_TIMERS.iter().fold(self.due_at[Timer::Step as usize], |next, timer| {
            next.min(self.due_at[*timer as usize])
        })
    }
}
