//! Random interruptions of a division: the vehicle flies no part that is no longer its own, and an
//! operator's command outlasts the division. Vehicle 78 leaves the mission; 77 agrees to every
//! division, and its radio fails and recovers.

extern crate std;
use std::format;
use std::string::String;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::TUNNEL_DATA;
use proptest::prelude::{ProptestConfig, any};

use super::State::*;
use super::*;
use crate::autopilot::AutopilotKind;
use crate::link::frame::{self, Header, MAX_FRAME_LEN};
use crate::link::intent::{FLYING, GROUNDED, ON_PLAN, OUT_OF_PLAN};
use crate::link::roster::{self, RosterReport, RosterReportEntry, ShareStatus};
use crate::{Link, RosterEntry};

/// Vehicle 77 far away from the path.
pub(super) const FAR_AWAY: Option<(Point, u8, f32, u32)> =
    Some((Point::new(8.0, 120.0, 1.5), ON_PLAN, 0.0, 5));

/// Place 2.5 m ahead on the vehicle's path.
fn ahead(b: &Bench) -> Point {
    let (plan, along_m) = (b.companion.mission.plan(), b.companion.guidance.reference_along_m());
    let place = plan.and_then(|plan| plan.path.point_at(along_m.max(0.0) + 2.5));
    place.unwrap_or(GOAL)
}

/// A coverage mission of three vehicles: this one flies the path of `field_plan`, 77 is heard, 78
/// is not.
pub(super) fn over_a_field(kind: AutopilotKind) -> Bench {
    over_a_field_with(kind, |_| {})
}

/// As [`over_a_field`], with settings changed by `set`.
pub(super) fn over_a_field_with(kind: AutopilotKind, set: impl Fn(&mut Config<4>)) -> Bench {
    over_a_field_at(kind, 0.0, set)
}

/// As [`over_a_field_with`], with paths `up_m` metres higher.
fn over_a_field_at(kind: AutopilotKind, up_m: f32, set: impl Fn(&mut Config<4>)) -> Bench {
    let mut config = two_vehicles();
    config
        .roster
        .push(RosterEntry { system_id: 78, path_start: Point::new(8.0, 28.0, 1.5) })
        .unwrap();
    config.lost_vehicle_down_after_s = Some(60.0);
    config.roster.iter_mut().for_each(|entry| entry.path_start.z += up_m);
    set(&mut config);
    let mut bench = match kind {
        AutopilotKind::Px4 => Bench::new(config),
        AutopilotKind::ArduPilot => Bench::ardupilot(config),
    };
    bench.answer_plan = Some(Ok(raised(field_plan(), up_m)));
    bench.neighbour = FAR_AWAY;
    bench.run_until(Ready, 6.0);
    bench
}

/// A roster report of vehicle 77 with this vehicle's own view of the fleet.
pub(super) fn own_roster(b: &Bench) -> RosterReport {
    let fleet = b.companion.neighbours.fleet().expect("an area");
    RosterReport { system_id: 77, mission_crc: 0xC0FFEE, ..fleet.roster_report(0) }
}

/// The frame of a roster report.
pub(super) fn bytes(roster: &RosterReport, sequence: u8) -> Vec<u8> {
    let (mut payload, mut out) = ([0; roster::MAX_LEN], [0; MAX_FRAME_LEN]);
    let len = roster.encode(&mut payload);
    let header =
        Header { system: roster.system_id, component: crate::COMPANION_COMPONENT, sequence };
    let n = frame::encode_raw(
        header,
        TUNNEL_DATA::ID,
        TUNNEL_DATA::EXTRA_CRC,
        &payload[..len],
        &mut out,
    );
    out[..n].to_vec()
}

/// Vehicle 77: its view of the fleet follows from the reports of this vehicle.
#[derive(Default)]
struct Other {
    known: Option<RosterReport>,
    /// Whether it sends no reports; it still hears.
    mute: bool,
    sequence: u8,
    /// Reports of this vehicle that it holds, after which vehicle 77 commits the division.
    counts_after: u32,
}

impl Other {
    /// Takes over the view of this vehicle, agrees to the division, commits it once both vehicles
    /// hold, and reports that.
    fn tick(&mut self, b: &mut Bench) {
        self.sequence = self.sequence.wrapping_add(1);
        if !self.sequence.is_multiple_of(4) {
            return;
        }
        let mine = own_roster(b);
        let counted = self.known.as_ref().map_or(0, |known| known.division_count);
        let mut known = match &self.known {
            Some(known) if counted > mine.division_count => known.clone(),
            _ => RosterReport { pending_hash: mine.pending_hash, ..mine.clone() },
        };
        if known.division_count == mine.division_count {
            known.entries[1] = RosterReportEntry {
                commitment_dm: Some(50),
                holds: true,
                agrees: true,
                ..known.entries[1]
            };
            known.entries[2].status = ShareStatus::Left;
            let own = mine.entries[0];
            if known.division_count == 0
                && mine.pending_hash != 0
                && own.holds
                && own.status == ShareStatus::Alive
            {
                self.counts_after = self.counts_after.saturating_sub(1);
            }
            if known.division_count == 0
                && mine.pending_hash != 0
                && own.holds
                && self.counts_after == 0
            {
                let entry = |e: &RosterReportEntry| RosterReportEntry {
                    incarnation: e.incarnation,
                    status: e.status,
                    ..RosterReportEntry::default()
                };
                known.entries = known.entries.iter().map(entry).collect();
                (known.division_count, known.committed_hash, known.pending_hash) =
                    (1, mine.pending_hash, 0);
            }
        }
        if !self.mute {
            b.companion.handle_bytes(Link::Swarm, b.now, &bytes(&known, self.sequence));
        }
        self.known = Some(known);
        b.drain();
    }
}

happens! {
    Pause, Resume, Pilot, Back, NoPosition, Position, Silent, Heard, Mute, MuteLong, Hears,
    NoAnswer, Answers, LiesAhead, HoversAhead, GoesAway, Land, Return, Battery, NoWay, Ways
}

struct Watch {
    other: Other,
    /// Whether this vehicle was commanded to land or return.
    ends: bool,
    /// Number of ticks for which this vehicle has waited on its way back.
    returns: u32,
    /// Whether vehicle 77 was last near the path, heard or not.
    near: bool,
    log: Vec<String>,
}

impl Watch {
    fn tick(&mut self, b: &mut Bench) {
        b.tick();
        self.other.tick(b);
        let (state, fleet) = (b.state(), b.companion.neighbours.fleet().expect("an area"));
        let guidance = &b.companion.guidance;
        let along_m = guidance.reference_along_m();
        let said = format!("{state:?} at {along_m} m: {:#?} {:?}", self.log, b.texts);
        let detours = &b.companion.detours;
        let homeward = guidance.returning || detours.is_homeward() || detours.lands_at_end();
        let flies = state == Follow && !homeward;
        let behind = fleet.division_count() > b.companion.mission.division_count();
        let held_m = f32::from(fleet.held_at_dm()) / 10.0;
        assert!(
            !behind || !flies || along_m <= held_m + 0.3,
            "on another's part, held {held_m} m: {said}"
        );
        let left = fleet.roster_report(0).entries[0].status == ShareStatus::Left;
        assert!(!left || !flies, "flies on though it left: {said}");
        // On the way back there are no gates.
        self.near &= b.neighbour != FAR_AWAY;
        let far = !self.near && (b.neighbour.is_none() || b.neighbour == FAR_AWAY);
        let halted = far && state == Follow && homeward && guidance.advice.stop_within_m <= 0.05;
        self.returns = if halted { self.returns + 1 } else { 0 };
        assert!(self.returns < 20, "waits on its way back: {said}");
        assert!(!self.ends || !(flies || state == Dividing), "an order is forgotten: {said}");
        let intent = b.companion.own_intent();
        assert!(intent.ground_m.abs() < 0.1, "its ground is at {} m: {said}", intent.ground_m);
        // The ground is level at 0: a column reaches it.
        let descends =
            state.lands_or_landing_is_held() || (state == Follow && guidance.is_in_descent());
        let lowest_m = intent.points.iter().fold(f32::INFINITY, |least, p| least.min(p.z));
        let down = !descends || !intent.may_come_down || b.enu.z < 0.3;
        assert!(down || lowest_m < 0.1, "its column ends {lowest_m} m up: {said}");
    }

    /// Makes `what` happen to the bench or to vehicle 77, and logs it.
    fn happen(&mut self, b: &mut Bench, what: Happens) {
        use Happens::*;
        self.log.push(format!(
            "{:.2} s {:?}: {what:?}",
            b.now.as_micros() as f64 * 1e-6,
            b.state()
        ));
        let order = |b: &mut Bench, command, param1| {
            b.acks.clear();
            b.command(command, param1, SYSTEM, crate::COMPANION_COMPONENT);
            b.acks.pop().is_some_and(|ack| ack.1 == crate::link::commands::ACCEPTED)
        };
        match what {
            Pause => _ = order(b, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0),
            Resume => _ = order(b, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0),
            Pilot => {
                b.mode = if b.kind == AutopilotKind::Px4 {
                    px4::HOLD
                } else {
                    crate::autopilot::ardupilot::BRAKE
                }
            }
            Back if b.armed => b.mode = b.kind.setpoint_mode(),
            Back => {}
            NoPosition => b.no_position = true,
            Position => b.no_position = false,
            Silent => b.silent = true,
            Heard => b.silent = false,
            Mute | MuteLong => (b.neighbour, self.other.mute) = (None, true),
            Hears => {
                (b.neighbour, self.other.mute) = (FAR_AWAY, false);
            }
            LiesAhead => {
                let ahead = ahead(b);
                let low = Point::new(ahead.x, ahead.y, 1.0);
                b.neighbour = Some((low, GROUNDED | OUT_OF_PLAN, 0.0, 5));
            }
            HoversAhead => {
                let above = ahead(b) + Point::new(0.0, 0.0, 2.5);
                b.neighbour = Some((above, FLYING | OUT_OF_PLAN, 0.0, 5));
            }
            GoesAway => b.neighbour = FAR_AWAY,
            NoAnswer => b.answer_division = false,
            Answers => b.answer_division = true,
            Land => self.ends |= order(b, MavCmd::MAV_CMD_NAV_LAND, 0.0),
            Return => self.ends |= order(b, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
            Battery => b.battery = 2,
            NoWay => b.answer_detour = Some(Err(crate::PlanFailure::Unreachable)),
            Ways => b.answer_detour = Some(Ok(())),
        }
        self.near |= matches!(what, LiesAhead | HoversAhead);
        let ticks = if matches!(what, MuteLong) { 420 } else { 0 };
        (0..ticks).for_each(|_| self.tick(b));
    }
}

proptest::proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 300 } else { 6000 }))]
    #[test]
    fn whatever_interrupts_a_division_no_part_is_flown_that_is_anothers(
        px4 in any::<bool>(),
        up_m in proptest::prop_oneof![proptest::prelude::Just(0.0), 0.0f32..40.0],
        (lead, waits, counts_after) in (0u32..160, any::<bool>(), 0u32..100),
        planner_takes_ms in proptest::collection::vec(0u64..8000, 0..4),
        script in proptest::collection::vec((0usize..ALL.len(), 1u32..200), 1..14),
    ) {
        let kind = if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let mut b = over_a_field_at(kind, up_m, |_| {});
        b.planner_takes = planner_takes_ms.into_iter().map(Duration::from_millis).collect();
        let mut watch = Watch {
            other: Other { mute: true, counts_after, ..Other::default() },
            ends: false,
            returns: 0,
            near: false,
            log: Vec::new(),
        };
        if !waits {
            b.start();
            b.run_until(Follow, 60.0);
        }
        (0..lead).for_each(|_| watch.tick(&mut b));
        watch.other.mute = false;
        for (what, ticks) in script {
            if waits && b.state() == Ready {
                b.start();
            }
            watch.happen(&mut b, ALL[what]);
            (0..ticks).for_each(|_| watch.tick(&mut b));
        }
        // All faults end.
        (b.silent, b.no_position, b.answer_division) = (false, false, true);
        b.planner_takes.clear();
        watch.happen(&mut b, Happens::Hears);
        for second in 0..400 {
            if b.armed && b.mode != b.kind.setpoint_mode() {
                b.mode = if b.state() == PilotControl {
                    b.kind.setpoint_mode()
                } else {
                    b.kind.land_mode()
                };
            }
            if matches!(b.state(), PilotReturned | Paused) {
                watch.happen(&mut b, Happens::Resume);
            }
            // The pilot gave the vehicle back while the autopilot was silent: the operator has to
            // land it.
            if b.state() == Aborted && b.armed && second == 40 {
                watch.happen(&mut b, Happens::Land);
            }
            if second > 0 && !b.armed && b.on_ground() {
                break;
            }
            (0..20).for_each(|_| watch.tick(&mut b));
        }
        proptest::prop_assert!(
            !b.armed && b.on_ground(),
            "{:?} {:#?} {:?}",
            b.state(),
            watch.log,
            b.texts
        );
    }
}

/// A vehicle that was commanded to return lands on its pad although another vehicle is silent.
#[test]
fn a_vehicle_that_was_ordered_back_waits_for_nobody() {
    for run_s in [3.0, 5.0, 7.0] {
        let mut b = over_a_field(AutopilotKind::Px4);
        b.start();
        b.run_until(Follow, 30.0);
        b.run(run_s);
        b.neighbour = None;
        b.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
        b.run_until(Land, 40.0);
        assert!((b.enu - START).xy().norm() < 0.5, "{run_s}: {:?} {:?}", b.enu, b.texts);
    }
}

/// While a vehicle that takes part is silent, another one waits above its pad: it may still get a
/// part of that one's area.
#[test]
fn a_vehicle_waits_above_its_pad_while_another_is_silent() {
    let mut b = over_a_field(AutopilotKind::Px4);
    b.start();
    b.run_until(Follow, 30.0);
    b.neighbour = None;
    b.run(15.0);
    let along_m = b.companion.guidance.reference_along_m();
    assert!(
        b.state() == Follow && (17.5..18.3).contains(&along_m),
        "{:?} {along_m} {:?}",
        b.state(),
        b.texts
    );
    b.neighbour = FAR_AWAY;
    b.run_until(Done, 60.0);
}

/// Above its pad a vehicle also waits for one that reports that it hears nobody, since that one is
/// to land; if that one flies on, it waits for three minutes only.
#[test]
fn above_its_pad_a_vehicle_waits_for_one_that_hears_nobody_for_a_limited_time() {
    let mut b = over_a_field_with(AutopilotKind::Px4, |config| _ = config.roster.pop());
    b.start();
    b.run_until(Follow, 30.0);
    b.neighbour_hears = 0;
    b.run(120.0);
    assert_eq!(b.state(), Follow, "{:?}", b.texts);
    b.run_until(Done, 150.0);
}

/// On a detour beside its path a vehicle waits for no silent one: the detour does not end above its
/// pad. Vehicle 77 lies on the path.
#[test]
fn a_vehicle_flies_around_what_lies_on_its_path_while_another_is_silent() {
    let mut b = over_a_field(AutopilotKind::Px4);
    b.start();
    b.run_until(Follow, 30.0);
    b.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
    b.run_until(Blocked, 5.0);
    b.neighbour = None;
    b.run_until(Dividing, 20.0);
    assert!(b.companion.detours.is_beside_plan(), "{:?}", b.texts);
    b.run_until(Follow, 5.0);
    assert!(b.texts.iter().any(|text| text == "Flown around: on its path again"), "{:?}", b.texts);
}

/// In a coverage mission the lease limits how far an unheard vehicle flies on, not the radio range.
#[test]
fn a_vehicle_over_an_area_whose_lease_ends_stands_and_lands_whatever_the_radios_range() {
    use AutopilotKind::*;
    for (kind, radio_range_m) in [(Px4, 60.0), (ArduPilot, 60.0), (Px4, 10_000.0)] {
        let mut b = over_a_field_with(kind, |config| {
            config.radio_range_m = radio_range_m;
            (config.cruise_mps, config.slowest_vehicle_mps) = (0.4, 0.4);
        });
        b.start();
        b.run_until(Follow, 40.0);
        b.neighbour = None;
        b.run_until(SwarmLinkLost, 25.0);
        let along_m = b.companion.guidance.reference_along_m();
        for _ in 0..15 {
            b.run(1.0);
            assert_eq!(b.state(), SwarmLinkLost, "{radio_range_m} m: {:?}", b.texts);
        }
        let more_m = b.companion.guidance.reference_along_m() - along_m;
        assert!(more_m < 1.0, "{radio_range_m} m: {more_m} m further");
        b.run_until(Land, 10.0);
    }
}
