//! Random sequences of commands, faults and the pilot's acts: checks what must hold at every tick,
//! and that every flight ends on the ground.

use std::string::String;

use super::*;

happens! {
    Pause, Resume, Land, Return, Start, Pilot, Back, Failsafe, NoPosition, Position, Jump,
    Silent, Heard, Disarm, Battery, FalseGround, TrueGround, Refuses, Obeys, Mute, Wait,
    NoHeartbeat, Heartbeat, NoLandedState, LandedState, Lift
}

/// Number of events that come before those in which a single message is lost. Stored seeds draw
/// from these.
const WHOLE: usize = 21;

/// Checks what must hold at every tick.
struct Watch {
    /// Number of ticks without setpoints, in the air and the setpoint mode, with the autopilot
    /// heard.
    unattended: u32,
    /// Number of commands checked so far.
    commands: usize,
    /// Whether NAV_LAND was accepted in the air.
    landing: bool,
    /// Number of ticks in a mode of the pilot's, with the autopilot heard.
    piloted: u32,
    /// Number of requests for a mode or to arm since the autopilot was last heard.
    unheard_acts: u32,
    /// Number of ticks since the position was last heard.
    unknown: u32,
    /// Number of ticks for which the position has been heard.
    known: u32,
    /// Number of ticks since the landing detector last reported ground falsely.
    honest: u32,
    /// Number of ticks for which a gust, or the pilot, still lifts the vehicle, at 0.6 m/s.
    lifted_for: u32,
    /// Whether an arming request has taken effect since the last start or resume.
    armed_once: bool,
    /// Whether the start that a pause on the pad ended was resumed before the disarming: the next
    /// arming request after the disarming is the resume's.
    resumed: bool,
    /// What happened so far, for the message of a failure.
    log: Vec<String>,
}

impl Watch {
    fn tick(&mut self, b: &mut Bench) {
        let (before, armed, was) = (b.setpoints.len(), b.armed, b.state());
        let low = b.companion.telemetry.position.z < 0.8;
        // A pilot needs 5 s to take over a vehicle that is not seen any more.
        if self.lifted_for > 0 && !(1..110).contains(&self.unknown) {
            // Disarmed, it falls.
            let z_m = if b.armed { b.enu.z + 0.03 } else { 0.0 };
            (self.lifted_for, b.enu.z) = (self.lifted_for - 1, z_m);
        }
        let had_flown = b.companion.handshake.arming().has_flown();
        b.tick();
        let unheard = b.silent || b.no_heartbeat;
        let sent = b.setpoints.len() > before;
        let state = b.state();
        let ours = b.mode == b.kind.setpoint_mode();
        let lifts = b.kind == AutopilotKind::ArduPilot && state == State::TakeOff;
        let nobody = b.armed
            && !b.on_ground()
            && ours
            && !unheard
            && !sent
            && !lifts
            && state != State::Failsafe;
        self.unattended = if nobody { self.unattended + 1 } else { 0 };
        assert!(
            self.unattended < 30,
            "nobody flies it in {state:?}: {:#?} {:?}",
            self.log,
            b.texts
        );
        let intent = b.companion.own_intent();
        let leads_along = state.is_on_path() || state == State::Stopping;
        assert!(
            leads_along || intent.may_come_down,
            "may come down unsaid in {state:?}: {intent:?} {:#?}",
            self.log
        );
        assert!(
            intent.ground_m < 0.1,
            "its ground is at {} m in {state:?}: {:#?} {:?}",
            intent.ground_m,
            self.log,
            b.texts
        );
        let descends = state.lands_or_landing_is_held()
            || (state == State::Follow && b.companion.guidance.is_in_descent());
        let lowest_m = intent.points.iter().fold(f32::INFINITY, |least, p| least.min(p.z));
        assert!(
            !descends || !intent.may_come_down || b.enu.z < 0.3 || lowest_m < 0.1,
            "its column ends {lowest_m} m up in {state:?}: {:#?} {:?}",
            self.log,
            b.texts
        );
        let foreign = !ours && b.mode != b.kind.land_mode() && b.armed && !unheard;
        let foreign_unheard = !ours && b.mode != b.kind.land_mode() && b.armed;
        self.piloted = if foreign { self.piloted + 1 } else { 0 };
        self.unheard_acts = if unheard { self.unheard_acts } else { 0 };
        self.unknown = if b.silent || b.no_position { self.unknown + 1 } else { 0 };
        self.known = if self.unknown > 0 { 0 } else { self.known + 1 };
        self.honest = if b.false_ground { 0 } else { self.honest + 1 };
        // A false report may be the last one, and counts for 3 s.
        let sound = self.known > 24 && self.honest > 70;
        assert!(
            !sound || !b.armed || b.enu.z < 1.2 || intent.flags & GROUNDED == 0,
            "reported on the ground at {:?} in {state:?}: {:#?}",
            b.enu,
            self.log
        );
        if let Some((_, place, mask)) = b.setpoints[before..].last()
            && state.is_left_to_pilot()
            && was == state
        {
            assert!(
                self.unknown < 14 || mask & 7 == 7,
                "led to {place:?} from {:?} in {state:?}: {:#?}",
                b.enu,
                self.log
            );
        }
        if self.resumed && !b.companion.telemetry.armed {
            (self.resumed, self.armed_once) = (false, false);
        }
        for &(command, param1, ..) in &b.commands[self.commands..] {
            let acts = matches!(command, SET_MODE | TAKE_OFF) || (command, param1) == (ARM, 1.0);
            self.unheard_acts += u32::from(acts && unheard && foreign_unheard);
            assert!(self.unheard_acts <= 6, "acts unheard in {state:?}: {:#?}", self.log);
            assert!(
                self.piloted < 30 || !acts,
                "{command} under the pilot in {state:?}: {:#?}",
                self.log
            );
            assert!(
                (command, param1) != (ARM, 0.0) || !armed || b.enu.z <= HARMLESS_M,
                "falls from {} m in {state:?}: {:#?}",
                b.enu.z,
                self.log
            );
            // In the step in which it rises it may still be disarmed, where a fall is harmless.
            assert!(
                (command, param1) != (ARM, 0.0) || state != State::CancelStart || !had_flown,
                "disarmed after it has flown: {:#?} {:?}",
                self.log,
                b.texts
            );
            assert!(
                (command, param1) != (ARM, 1.0) || !self.armed_once,
                "armed again in {state:?}: {:#?} {:?}",
                self.log,
                b.texts
            );
        }
        self.commands = b.commands.len();
        // The companion knows of the arming by the armed bit or by the ack.
        let acked =
            b.companion.handshake.arming().is_armed_bit_overdue(b.now + Duration::from_secs(9));
        self.armed_once |= b.companion.telemetry.armed || (acked && state == State::Arming);
        let flies_on =
            matches!(state, State::TakeOff | State::Climb | State::Follow | State::Arming);
        assert!(
            !self.landing || !flies_on,
            "an accepted landing is forgotten in {state:?}: {:#?}",
            self.log
        );
        // Close to the ground, by the position known to the step, a pause waits until the vehicle
        // is higher.
        assert!(
            !b.companion.mission.pending().pause
                || (low && state == State::Climb)
                || !matches!(state, State::Climb | State::Follow),
            "a pause is forgotten in {state:?}: {:#?}",
            self.log
        );
        self.landing &= state != State::Aborted && state != State::Failsafe && state != State::Done;
    }

    /// Makes `what` happen to the bench, and logs it.
    fn happen(&mut self, b: &mut Bench, what: Happens) {
        use Happens::*;
        let state = b.state();
        self.log.push(format!(
            "{:.2} s {state:?} {:?}: {what:?}",
            b.now.as_micros() as f64 * 1e-6,
            b.enu
        ));
        match what {
            Pause => _ = pause(b),
            Resume => {
                let resumed = resume(b) == Some(ACCEPTED);
                self.armed_once &= b.armed || !resumed;
                self.resumed |= resumed && state == State::CancelStart;
            }
            Land => {
                self.landing |= land(b) == Some(ACCEPTED) && b.armed && b.state() != State::Aborted;
            }
            Return => _ = order(b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
            Start => {
                let started = order(b, MavCmd::MAV_CMD_MISSION_START, 0.0) == Some(ACCEPTED);
                self.armed_once &= b.armed || !(started && state == State::Ready);
            }
            Pilot => (b.mode, b.status) = (pilot_mode(b.kind), 3),
            Back if b.status < 5 => b.mode = b.kind.setpoint_mode(),
            Failsafe => {
                (b.mode, b.status) =
                    (if b.kind == AutopilotKind::Px4 { px4::RTL } else { ardupilot::RTL }, 5);
            }
            NoPosition => b.no_position = true,
            Position => b.no_position = false,
            Jump => b.enu.y += 3.0,
            Silent => b.silent = true,
            Heard => b.silent = false,
            Disarm if b.on_ground() => b.armed = false,
            Battery => b.battery = 2,
            FalseGround => b.false_ground = true,
            TrueGround => b.false_ground = false,
            Refuses => b.refused = std::vec![SET_MODE, ARM],
            Obeys => b.refused.clear(),
            Mute => b.mute = !b.mute,
            NoHeartbeat => b.no_heartbeat = true,
            Heartbeat => b.no_heartbeat = false,
            NoLandedState => b.no_landed_state = true,
            LandedState => b.no_landed_state = false,
            Lift if b.armed => self.lifted_for = 40,
            Back | Disarm | Lift | Wait => {}
        }
    }
}

/// Flies a mission for `ticks_before` ticks, then makes the events of `script` happen (index in
/// `ALL`), each followed by a number of ticks, and lets all faults end: the vehicle is then down
/// and disarmed.
fn fly(px4: bool, ticks_before: u32, script: &[(usize, u32)]) {
    let mut b = bench(if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot });
    b.start();
    let mut watch = Watch {
        unattended: 0,
        commands: 0,
        landing: false,
        piloted: 0,
        unheard_acts: 0,
        unknown: 0,
        known: 0,
        honest: 100,
        lifted_for: 0,
        armed_once: false,
        resumed: false,
        log: Vec::new(),
    };
    (0..ticks_before).for_each(|_| watch.tick(&mut b));
    for &(what, ticks) in script {
        watch.happen(&mut b, ALL[what]);
        (0..ticks).for_each(|_| watch.tick(&mut b));
    }
    // All faults end, and a pilot or failsafe that has the vehicle lands it.
    (b.silent, b.no_position, b.false_ground, b.status) = (false, false, false, 3);
    (b.no_heartbeat, b.no_landed_state) = (false, false);
    b.refused.clear();
    if b.armed && b.mode != b.kind.setpoint_mode() {
        b.mode = b.kind.land_mode();
    }
    for second in 0..100 {
        if matches!(b.state(), State::PilotReturned | State::Paused) {
            watch.happen(&mut b, Happens::Resume);
        }
        // As with a companion that was restarted in the air, the state lasts until NAV_LAND.
        if b.state() == State::Failsafe && second == 40 {
            watch.happen(&mut b, Happens::Land);
        }
        (0..20).for_each(|_| watch.tick(&mut b));
    }
    assert!(
        b.enu.z <= HARMLESS_M && !b.armed,
        "{:?} {} {:?} {:#?} {:?}",
        b.state(),
        b.mode,
        b.enu,
        watch.log,
        b.texts
    );
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(
        if cfg!(debug_assertions) { 300 } else { 3000 }
    ))]
    #[test]
    fn whatever_happens_somebody_flies_and_nothing_accepted_is_forgotten(
        px4 in proptest::prelude::any::<bool>(),
        ticks_before in 0u32..400,
        script in proptest::collection::vec((0..WHOLE, 1u32..80), 1..16),
    ) {
        fly(px4, ticks_before, &script);
    }

    #[test]
    fn whatever_single_message_is_lost_somebody_flies_and_nothing_is_forgotten(
        px4 in proptest::prelude::any::<bool>(),
        ticks_before in 0u32..400,
        script in proptest::collection::vec((0..ALL.len(), 1u32..80), 1..16),
    ) {
        fly(px4, ticks_before, &script);
    }
}
