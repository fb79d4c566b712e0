//! The table of all timers: for each action the time at which it is due. Times of past events that
//! guards read (when a vehicle was heard, when a state was entered) are not here: the part that saw
//! the event keeps its time.
//!
//! Three timers wake the shell ([`Timers::next_due`]): the control step, the heartbeats, and the
//! position and intent to the swarm. The others do not: their action runs in a later call, at or
//! after its time.

use crate::time::{Duration, Instant};

/// Periodic actions, and actions that a delay or a rate limit holds back. "From then on" below is
/// from the time at which the timer is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Timer {
    /// A step of the control loop: guidance, mission table, setpoint.
    Step,
    /// HEARTBEAT to the autopilot and to the swarm.
    Heartbeat,
    /// Position and intent of this vehicle, to the swarm.
    Swarm,
    /// Roster report of a coverage mission, to the swarm.
    Roster,
    /// Notes the waypoints photographed so far, stores them in flash and sends their number.
    NotePhotographed,
    /// Report of the photographed waypoints, to the swarm.
    PhotographedReport,
    /// Next try of the request that the state repeats until it takes effect: mode, take-off,
    /// landing, disarming.
    Request,
    /// Next request of the EKF origin from the autopilot.
    Origin,
    /// From then on the telemetry streams may be requested again.
    Streams,
    /// Next request of a parameter that limits the autopilot (speed, acceleration, jerk).
    Limit,
    /// From then on "Setpoint out of limits" may be sent again.
    HeldReport,
    /// From then on a division under way is overdue.
    DivisionDue,
    /// From then on a vehicle on the ground that cannot make a commitment leaves its share to
    /// others.
    LeaveWithoutCommitment,
    /// From then on no vehicle flies any more that could leave a part to a vehicle in reserve.
    ReserveEnds,
    /// From then on the vehicle no longer waits above its pad for missing vehicles.
    StopWaitingForMissing,
    /// From then on "EKF origin # km away" may be sent again.
    OriginReport,
    /// Report that this vehicle still waits for one that has not started.
    WaitReport,
    /// Repetition of the camera command that is not acknowledged yet.
    CameraCommand,
    /// From then on the shell may be asked again for a division that it has not answered.
    DivisionRequest,
    /// Begins the next scan of the path for obstacles.
    PathScan,
    /// From then on the shell may be asked again for a path home.
    HomeSearch,
    /// From then on the shell may be asked again for a detour back to the path, in a coverage
    /// mission.
    RejoinSearch,
    /// From then on a mode may be requested again of an autopilot whose HEARTBEAT is silent.
    UnheardMode,
    /// From then on "Battery charge unknown" may be sent again.
    ChargeReport,
}

/// Number of timers: the last variant's index plus one.
const TIMER_COUNT: usize = Timer::ChargeReport as usize + 1;
/// Timers that wake the shell.
const WAKING_TIMERS: [Timer; 3] = [Timer::Step, Timer::Heartbeat, Timer::Swarm];

/// For each timer the time at which it is due; at the start all are due.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timers {
    /// Time at which each timer is due, in the order of [`Timer`].
    due_at: [Instant; TIMER_COUNT],
    /// When [`Self::step_s`] was last called.
    stepped_at: Instant,
}

impl Timers {
    /// When a timer is due.
    pub(crate) fn due_at(&self, timer: Timer) -> Instant {
        self.due_at[timer as usize]
    }

    /// Sets when a timer is due, whatever was set before.
    pub(crate) fn set(&mut self, timer: Timer, at: Instant) {
        self.due_at[timer as usize] = at;
    }

    /// Sets when a timer is due, unless it is due earlier already.
    pub(crate) fn set_no_later(&mut self, timer: Timer, at: Instant) {
        let due_at = &mut self.due_at[timer as usize];
        *due_at = (*due_at).min(at);
    }

    /// Sets when a timer is due, unless it is due later already.
    pub(crate) fn set_no_earlier(&mut self, timer: Timer, at: Instant) {
        let due_at = &mut self.due_at[timer as usize];
        *due_at = (*due_at).max(at);
    }

    /// Whether a timer is due at `now`.
    pub(crate) fn is_due(&self, timer: Timer, now: Instant) -> bool {
        now >= self.due_at[timer as usize]
    }

    /// Whether a timer is due at `now`; if so, it is set to be due again after `every`.
    pub(crate) fn take_due(&mut self, timer: Timer, now: Instant, every: Duration) -> bool {
        let due = self.is_due(timer, now);
        if due {
            self.set(timer, now + every);
        }
        due
    }

    /// Sets when a periodic timer is due next: `every` after it was due last. After a gap longer
    /// than `every` the period starts again from `now`, instead of catching up.
    pub(crate) fn schedule_next(&mut self, timer: Timer, now: Instant, every: Duration) {
        let due = self.due_at[timer as usize] + every;
        self.set(timer, if due > now { due } else { now + every });
    }

    /// Time since the last call, seconds; called once a step, it is the step's length.
    pub(crate) fn step_s(&mut self, now: Instant) -> f32 {
        (now - core::mem::replace(&mut self.stepped_at, now)).as_secs_f32()
    }

    /// Earliest time at which a timer that wakes the shell is due.
    pub(crate) fn next_due(&self) -> Instant {
        WAKING_TIMERS.iter().fold(self.due_at[Timer::Step as usize], |next, timer| {
            next.min(self.due_at[*timer as usize])
        })
    }
}
