//! What the autopilot is asked for again until it is so: streams, EKF origin, mode, arming, take-off, landing.

use crate::autopilot::Kind;
use crate::events::Link;
use crate::machine::{Companion, DISARM_AFTER};
use crate::mission::State;
use crate::outbox::Outgoing;
use crate::time::Duration;

const RETRY_EVERY: Duration = Duration::from_millis(1000);
/// Longer than ArduCopter takes to spin up and lift off (2.3 s).
const TAKE_OFF_AFTER: Duration = Duration::from_millis(4000);
/// Positions missing this long while HEARTBEAT is heard: it has rebooted, and forgotten the streams.
const STREAMS_LOST: Duration = Duration::from_millis(1500);
/// Streams are asked for again no sooner than this.
const STREAMS_EVERY: Duration = Duration::from_millis(2000);
/// HEARTBEAT comes at 1 Hz: one late is not yet silence.
const HEARD: Duration = Duration::from_millis(1500);
/// Streams asked for at each step while connecting.
const SETUP_BURST: usize = 5;
const GPS_GLOBAL_ORIGIN: u16 = 49;
/// After so long without setpoints Guided stops, seconds. ArduCopter's own 3 s would fly the last velocity on through
/// walls while a link stalls.
const GUID_TIMEOUT_S: f32 = 0.5;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Starts asking for the streams from the first.
    pub(crate) fn ask_for_streams(&mut self) {
        self.setup = 0;
        self.streams_at = self.now + STREAMS_EVERY;
        if self.kind() == Kind::ArduPilot {
            let timeout = Outgoing::Parameter("GUID_TIMEOUT", GUID_TIMEOUT_S);
            self.outboxes[Link::Autopilot as usize].push(timeout);
        }
    }

    /// Asks for whatever is due.
    pub(crate) fn repeat_requests(&mut self) {
        let (now, kind) = (self.now, self.kind());
        let heard = self.telemetry.heartbeat_at.is_some();
        let silent = self.telemetry.heartbeat_age(now) > HEARD;
        if !silent && self.telemetry.position_age(now) > STREAMS_LOST && now >= self.streams_at {
            self.ask_for_streams();
        }
        let autopilot = &mut self.outboxes[Link::Autopilot as usize];
        if heard && self.telemetry.ekf_origin.is_none() && now >= self.origin_at {
            self.origin_at = now + RETRY_EVERY;
            autopilot.push(Outgoing::Request(GPS_GLOBAL_ORIGIN));
        }
        for _ in 0..SETUP_BURST {
            if let Some(&(id, interval_us)) = kind.streams().get(self.setup) {
                autopilot.push(Outgoing::Interval(id, interval_us));
                self.setup += 1;
            }
        }
        if now < self.retry_at {
            return;
        }
        self.retry_at = now + RETRY_EVERY;
        let change_to = |custom_mode| {
            let (main, sub) = kind.mode_params(custom_mode);
            Outgoing::Mode(main, sub)
        };
        match self.state {
            State::Engaging => autopilot.push(change_to(kind.setpoint_mode())),
            State::Arming => autopilot.push(Outgoing::Arm(true)),
            State::TakeOff => {
                self.retry_at = now + TAKE_OFF_AFTER;
                let climb_m = self.plan.as_ref().map_or(0.0, |plan| plan.climb_m);
                autopilot.push(Outgoing::TakeOff(self.telemetry.above_home_m + climb_m));
            }
            State::Land if self.telemetry.custom_mode != kind.land_mode() => {
                autopilot.push(change_to(kind.land_mode()));
            }
            State::Disarm => {
                self.retry_at = now + DISARM_AFTER;
                autopilot.push(Outgoing::Arm(false));
            }
            _ => {}
        }
    }
}
