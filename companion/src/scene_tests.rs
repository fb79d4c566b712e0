//! A scene for every row of the mission table.

extern crate std;
use std::vec::Vec;

use mavlink::dialects::ardupilotmega::MavCmd;

use super::*;
use crate::fake_autopilot::*;
use crate::intent::{FLYING, GROUNDED, LANDED, ON_PLAN, OUT};
use crate::{RosterEntry, px4};

/// Vehicle 77 on its pad, or lying below the path, with these flags beside "grounded".
fn on_pad(flags: u8) -> Option<(Point, u8, f32, u32)> {
    Some((Point::new(8.0, 20.0, 0.0), GROUNDED | flags, 0.0, 5))
}

fn in_the_way(flags: u8) -> Option<(Point, u8, f32, u32)> {
    Some((Point::new(14.5, 12.5, 1.0), GROUNDED | flags, 0.0, 5))
}

/// Every row of the table is taken in some scene below or above; `taken` collects them.
#[test]
fn every_row_has_its_scene() {
    let mut texts: Vec<std::string::String> = Vec::new();
    let mut scene = |mut bench: Bench, script: &dyn Fn(&mut Bench), end: State, seconds: f32| {
        script(&mut bench);
        bench.until(end, seconds);
        texts.append(&mut bench.texts);
    };
    use State::*;
    let ready = || {
        let mut bench = Bench::new(config());
        bench.until(Ready, 6.0);
        bench
    };
    let land = |b: &mut Bench| b.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, 191);
    let back = |b: &mut Bench| b.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, SYSTEM, 191);
    let pause = |b: &mut Bench| b.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0, SYSTEM, 191);
    let resume = |b: &mut Bench| b.command(MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0, SYSTEM, 191);
    let to = |state: State| {
        let mut bench = ready();
        bench.start();
        bench.until(state, 30.0);
        bench
    };
    let flying = || Bench::following(config());
    // The autopilot, the pilot, the failsafe.
    scene(flying(), &|b| b.armed = false, Aborted, 3.0);
    scene(flying(), &|b| (b.mode, b.status) = (px4::RTL, 5), Failsafe, 3.0);
    scene(flying(), &|b| b.mode = px4::HOLD, PilotControl, 3.0);
    let landing = || {
        let mut bench = flying();
        bench.never_lands = true;
        land(&mut bench);
        bench.run(2.0);
        assert_eq!(bench.state(), Land);
        bench
    };
    scene(landing(), &|b| (b.mode, b.status) = (px4::RTL, 5), Failsafe, 3.0);
    scene(landing(), &|b| b.mode = px4::HOLD, PilotControl, 3.0);
    scene(landing(), &|b| b.run(125.0), Land, 1.0);
    scene(
        to(Engaging),
        &|b| {
            b.mode = px4::RTL;
            b.status = 5;
            b.refused.push(176);
        },
        Aborted,
        5.0,
    );
    scene(
        to(Streaming),
        &|b| {
            b.mode = px4::RTL;
            b.refused.push(176);
        },
        Aborted,
        5.0,
    );
    // The estimate.
    scene(
        ready(),
        &|b| {
            b.accuracy_m = Some(0.2);
            b.run(2.0);
            b.start();
        },
        Aborted,
        3.0,
    );
    scene(flying(), &|b| b.accuracy_m = Some(0.3), Aborted, 60.0);
    scene(
        flying(),
        &|b| {
            b.origin.lat_deg += 1e-6;
            b.send_origin();
        },
        Land,
        3.0,
    );
    // Links and position.
    scene(ready(), &|b| b.silent = true, WaitAutopilot, 5.0);
    scene(to(Streaming), &|b| b.silent = true, Aborted, 5.0);
    scene(flying(), &|b| b.silent = true, AutopilotSilent, 5.0);
    scene(flying(), &|b| b.silent = true, Aborted, 125.0);
    scene(
        flying(),
        &|b| {
            b.silent = true;
            b.run(6.0);
            b.silent = false;
        },
        Done,
        60.0,
    );
    scene(landing(), &|b| b.silent = true, Aborted, 125.0);
    scene(ready(), &|b| b.no_position = true, WaitPosition, 4.0);
    scene(to(Streaming), &|b| b.no_position = true, Aborted, 4.0);
    scene(flying(), &|b| b.no_position = true, PositionLost, 3.0);
    scene(flying(), &|b| b.no_position = true, Aborted, 30.0);
    scene(
        flying(),
        &|b| {
            b.no_position = true;
            b.run(2.0);
            b.no_position = false;
        },
        Done,
        60.0,
    );
    scene(
        flying(),
        &|b| {
            b.enu.y += 5.0;
            b.until(PositionLost, 0.2);
        },
        Aborted,
        30.0,
    );
    // Orders and limits.
    scene(
        flying(),
        &|b| {
            b.no_position = true;
            b.run(1.5);
            land(b);
        },
        Aborted,
        30.0,
    );
    scene(flying(), &|b| b.battery = 10, Aborted, 30.0);
    scene(flying(), &|b| b.battery = 5, Aborted, 30.0);
    let mut fenced = config();
    fenced.geofence = Some((Point::new(0.0, 0.0, -1.0), Point::new(12.0, 30.0, 10.0)));
    scene(Bench::following(fenced), &|_| {}, Aborted, 60.0);
    // The same while another vehicle lies below: it waits inside until there is room.
    let mut fenced = two_vehicles();
    fenced.geofence = Some((Point::new(0.0, 0.0, -1.0), Point::new(10.0, 30.0, 10.0)));
    scene(
        Bench::accompanied(fenced),
        &|b| {
            b.neighbour = Some((Point::new(11.0, 12.0, 0.0), GROUNDED | LANDED | ON_PLAN, 99.0, 5));
            b.run(20.0);
            assert!(b.state() == Follow && (9.8..10.05).contains(&b.enu.x), "{:?}", b.enu);
            b.neighbour = Some((Point::new(8.0, 20.0, 0.0), GROUNDED | LANDED | ON_PLAN, 99.0, 5));
            b.until(Land, 5.0);
        },
        Aborted,
        60.0,
    );
    scene(flying(), &|b| back(b), Aborted, 60.0);
    scene(to(Climb), &|b| back(b), Aborted, 60.0);
    // The mission in order, and where it halts.
    scene(
        ready(),
        &|b| {
            // Dragged, not so fast that it were a jump.
            for _ in 0..3 {
                b.enu.x += 1.0;
                b.run(0.3);
            }
            b.start();
        },
        Aborted,
        1.0,
    );
    scene(
        ready(),
        &|b| {
            b.armed = true;
            b.run(1.5);
            b.start();
        },
        Aborted,
        1.0,
    );
    scene(to(Streaming), &|b| land(b), Aborted, 1.0);
    scene(to(Streaming), &|b| back(b), Aborted, 1.0);
    scene(to(Streaming), &|b| b.refused.push(176), Aborted, 8.0);
    scene(to(Streaming), &|b| b.refused.push(400), Aborted, 30.0);
    // On the pad: what the pilot, the place, the battery and the fence say until arming.
    let gated = || {
        let mut gated = plan();
        gated.gates.push(planner_core::schedule::Gate { at_m: -1.5, id: 77, until_m: 6.0 }).unwrap();
        let mut bench = Bench::new(two_vehicles());
        bench.answer_plan = Some(Ok(gated));
        bench.until(Ready, 6.0);
        bench.start();
        bench.run(1.0);
        assert_eq!(bench.state(), Scheduled);
        bench
    };
    scene(gated(), &|b| b.armed = true, Aborted, 2.0);
    scene(gated(), &|b| b.battery = 9, Aborted, 2.0);
    scene(gated(), &|b| (0..3).for_each(|_| (b.enu.x += 1.0, b.run(0.3)).1), Aborted, 2.0);
    let low = |b: &mut Bench| {
        b.battery = 9;
        b.run(1.5);
        b.start();
    };
    scene(ready(), &low, Aborted, 1.0);
    let mut fenced = config();
    fenced.geofence = Some((Point::new(0.0, 0.0, 1.0), Point::new(20.0, 30.0, 10.0)));
    let mut outside = Bench::new(fenced);
    outside.until(Ready, 6.0);
    scene(outside, &|b| b.start(), Aborted, 1.0);
    let mut fenced = two_vehicles();
    fenced.geofence = Some((Point::new(7.0, 0.0, -1.0), Point::new(20.0, 30.0, 10.0)));
    let mut outside = Bench::new(fenced);
    outside.until(Ready, 6.0);
    outside.start();
    scene(outside, &|b| (0..3).for_each(|_| (b.enu.x -= 0.4, b.run(0.3)).1), Aborted, 2.0);
    scene(ready(), &|b| (pause(b), b.start(), b.run(31.0)).2, Scheduled, 1.0);
    // Arming: paused, cancelled, never answered, disarmed at once, or armed and lifted off all the same.
    let arming = |script: &dyn Fn(&mut Bench)| {
        let mut bench = to(Streaming);
        script(&mut bench);
        bench.until(Arming, 6.0);
        bench
    };
    let denied = || arming(&|b| b.refused.push(400));
    scene(denied(), &|b| pause(b), Scheduled, 4.0);
    scene(denied(), &|b| land(b), Aborted, 4.0);
    scene(denied(), &|b| back(b), Aborted, 4.0);
    scene(denied(), &|b| b.battery = 9, Aborted, 5.0);
    scene(denied(), &|b| b.no_position = true, Aborted, 5.0);
    scene(denied(), &|b| (0..3).for_each(|_| (b.enu.x += 1.0, b.run(0.3)).1), Aborted, 5.0);
    scene(arming(&|b| (b.mute, b.refused) = (true, std::vec![400])), &|_| {}, Aborted, 9.0);
    scene(arming(&|b| b.never_arms = true), &|_| {}, Aborted, 9.0);
    let armed_late = |b: &mut Bench| {
        pause(b);
        b.armed = true;
        b.run(1.0);
        assert_eq!(b.state(), CancelStart);
    };
    scene(denied(), &armed_late, Disarm, 6.0);
    scene(denied(), &|b| (armed_late(b), b.enu.z = 1.0).1, Land, 2.0);
    scene(
        to(Climb),
        &|b| {
            b.stuck = true;
            b.run(61.0);
            b.stuck = false;
        },
        Aborted,
        30.0,
    );
    scene(flying(), &|b| pause(b), Paused, 1.0);
    scene(
        flying(),
        &|b| {
            pause(b);
            b.run(3.0);
            resume(b);
        },
        Done,
        60.0,
    );
    scene(
        flying(),
        &|b| {
            pause(b);
            b.run(601.0);
        },
        Aborted,
        30.0,
    );
    scene(
        flying(),
        &|b| {
            b.stuck = true;
            b.run(610.0);
            b.stuck = false;
        },
        Aborted,
        30.0,
    );
    scene(
        flying(),
        &|b| {
            b.stays_armed = true;
            b.refused.push(400);
            land(b);
        },
        Aborted,
        60.0,
    );
    let with = |config| {
        let mut bench = Bench::accompanied(config);
        bench.until(Follow, 20.0);
        bench.run(1.0);
        bench
    };
    let accompanied = || with(two_vehicles());
    scene(accompanied(), &|b| b.neighbour = None, Alone, 5.0);
    scene(accompanied(), &|b| b.neighbour = None, Aborted, 60.0);
    scene(
        accompanied(),
        &|b| {
            b.neighbour = None;
            b.until(Alone, 5.0);
            b.neighbour = on_pad(ON_PLAN);
        },
        Done,
        60.0,
    );
    // Somebody lies on the path: once all stand it is flown around, or the vehicle lands.
    let lies = |b: &mut Bench| {
        b.neighbour = in_the_way(OUT);
        b.until(Blocked, 3.0);
    };
    scene(accompanied(), &lies, Done, 60.0);
    scene(
        accompanied(),
        &|b| {
            lies(b);
            b.neighbour = on_pad(ON_PLAN);
        },
        Done,
        60.0,
    );
    scene(
        accompanied(),
        &|b| {
            b.answer_detour = None;
            lies(b);
            b.until(Replanning, 6.0);
            b.until(Blocked, 6.0);
        },
        Replanning,
        20.0,
    );
    let no_way = Some(Err(PlanFailure::Unreachable));
    scene(
        accompanied(),
        &|b| {
            b.answer_detour = no_way;
            lies(b);
        },
        Aborted,
        120.0,
    );
    // It lies so near that there is no room to land either: back along the path there is.
    scene(
        accompanied(),
        &|b| {
            b.answer_detour = no_way;
            lies(b);
            b.until(Blocked, 5.0);
            b.run(1.0);
            b.neighbour = Some((Point::new(b.enu.x + 1.2, b.enu.y, 0.1), OUT | GROUNDED, 0.0, 5));
            b.until(Follow, 120.0);
        },
        Aborted,
        60.0,
    );
    // One comes down on the first stretch of the path: there is no place before it, so it goes aside, as often as need be.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.answer_detour = None;
            b.neighbour = Some((Point::new(9.5, 12.0, 2.8), FLYING, 0.0, 5));
        },
        Replanning,
        6.0,
    );
    // A third vehicle is never heard: nobody knows that it stands.
    let mut three = two_vehicles();
    three.roster.push(RosterEntry { system_id: 78, ..three.roster[1] }).unwrap();
    scene(
        with(three),
        &|b| {
            lies(b);
            b.run(601.0);
        },
        Aborted,
        60.0,
    );
    // Somebody hovers over the pad.
    scene(
        Bench::new(two_vehicles()),
        &|b| {
            b.neighbour = Some((Point::new(8.0, 12.0, 3.0), FLYING | ON_PLAN, 0.0, 5));
            b.until(Ready, 6.0);
            b.start();
            b.run(25.0);
        },
        Scheduled,
        1.0,
    );
    // On its way back it yields to one that follows the plan, and lands in the end.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.run(3.0);
            back(b);
            b.run(0.2);
            b.neighbour = Some((Point::new(7.0, 12.0, 1.5), FLYING | ON_PLAN, 0.0, 5));
        },
        Aborted,
        100.0,
    );
    // One that flies a way of its own stays in front of it.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.neighbour =
                Some((Point::new(14.0, 12.0, 1.5), FLYING | ON_PLAN | crate::intent::DETOURS, 0.0, 5));
        },
        Aborted,
        140.0,
    );
    // One is below where it lands.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.run(2.0);
            b.neighbour = Some((b.enu + Point::new(1.0, 0.0, -2.5), FLYING | ON_PLAN, 0.0, 5));
            b.run(0.3);
            land(b);
            b.until(LandingHeld, 8.0);
            b.until(Follow, 25.0);
            // Back over its pad there is no room either.
            b.neighbour = Some((START - Point::new(1.35, 0.0, 1.35), FLYING | ON_PLAN, 0.0, 5));
            // Nor aside.
            b.answer_detour = no_way;
            b.until(LandingHeld, 120.0);
            b.run(85.0);
            assert!(b.state() == LandingHeld && b.enu.z > 0.8, "{:?} {:?}", b.texts, b.enu);
            b.neighbour = Some((Point::new(8.0, 30.0, 1.5), FLYING | ON_PLAN, 0.0, 5));
        },
        Aborted,
        30.0,
    );
    // Nor on its way up.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Climb, 20.0);
            b.run(2.0);
            b.neighbour = Some((Point::new(b.enu.x - 1.0, b.enu.y, 0.0), GROUNDED | OUT, 0.0, 5));
            b.run(0.3);
            land(b);
            b.until(LandingHeld, 8.0);
            b.until(Follow, 25.0);
            b.until(Land, 60.0);
            assert!((b.enu - GOAL).xy().norm() < 0.5, "where the way aside ends: {:?}", b.enu);
        },
        Aborted,
        30.0,
    );
    // Over its pad is no room, but aside there is.
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.run(2.0);
            back(b);
            b.neighbour = Some((START - Point::new(1.35, 0.0, 1.35), FLYING | ON_PLAN, 0.0, 5));
            b.until(Land, 120.0);
            assert!((b.enu - GOAL).xy().norm() < 0.5, "where the way aside ends: {:?}", b.enu);
        },
        Aborted,
        30.0,
    );
    scene(
        Bench::accompanied(two_vehicles()),
        &|b| {
            b.until(Follow, 20.0);
            b.run(2.0);
            b.neighbour = Some((b.enu + Point::new(1.0, 0.0, -2.5), FLYING | ON_PLAN, 0.0, 5));
            b.run(0.3);
            land(b);
            b.until(LandingHeld, 8.0);
            b.battery = 5;
        },
        Aborted,
        30.0,
    );
    // Nobody hears it on the ground.
    scene(
        Bench::new(two_vehicles()),
        &|b| {
            b.until(Ready, 6.0);
            b.start();
            b.run(12.0);
        },
        Scheduled,
        1.0,
    );
    // The same before take-off.
    let grounded = |answer| {
        let mut bench = Bench::accompanied(two_vehicles());
        bench.neighbour = in_the_way(OUT);
        bench.answer_detour = answer;
        bench.run(4.5);
        bench
    };
    scene(grounded(Some(Ok(()))), &|_| {}, Done, 60.0);
    scene(grounded(no_way), &|_| {}, Scheduled, 1.0);
    scene(grounded(None), &|_| {}, Scheduled, 6.0);
    let mut unanswered = Bench::new(config());
    unanswered.answer_plan = None;
    scene(
        unanswered,
        &|b| {
            b.run(35.0);
            b.answer_plan = Some(Ok(plan()));
        },
        Ready,
        40.0,
    );
    let mut idle = Bench::new(config());
    idle.answer_plan = Some(Ok(VehiclePlan { goal: None, path: Default::default(), ..plan() }));
    scene(
        idle,
        &|b| {
            b.until(Ready, 6.0);
            b.start();
        },
        Done,
        1.0,
    );
    let mut planless = Bench::new(config());
    planless.answer_plan = Some(Err(PlanFailure::NoRoadmap));
    scene(planless, &|b| b.run(6.0), Aborted, 1.0);
    let mut unreachable = Bench::new(config());
    unreachable.answer_plan = Some(Err(PlanFailure::Unreachable));
    scene(unreachable, &|b| b.run(6.0), Aborted, 1.0);
    // A companion that starts in the air: nothing is sent, the autopilot's failsafe lands.
    let mut found = Bench::new(config());
    (found.armed, found.mode, found.enu.z) = (true, px4::OFFBOARD, 1.5);
    scene(
        found,
        &|b| {
            b.until(Failsafe, 3.0);
            b.start();
            b.run(3.0);
            assert!(b.setpoints.is_empty() && b.commands.iter().all(|c| c.0 != 400 && c.0 != 176));
            (b.armed, b.enu.z) = (false, 0.0);
        },
        Aborted,
        3.0,
    );
    // An autopilot that takes off by command, and does not.
    let mut grounded = Bench::ardupilot(config());
    grounded.refused = std::vec![22];
    grounded.until(Ready, 6.0);
    grounded.start();
    grounded.stays_armed = true;
    scene(grounded, &|b| (b.run(14.0), b.stays_armed = false).1, Aborted, 30.0);
    // After the pilot, after a failsafe.
    let piloted = || {
        let mut bench = flying();
        bench.mode = px4::HOLD;
        bench.until(PilotControl, 3.0);
        bench
    };
    scene(piloted(), &|b| b.armed = false, Aborted, 3.0);
    scene(piloted(), &|b| (b.mode, b.status) = (px4::RTL, 5), Failsafe, 3.0);
    scene(
        piloted(),
        &|b| {
            b.mode = px4::OFFBOARD;
            b.run(2.0);
            resume(b);
        },
        Done,
        60.0,
    );
    scene(
        piloted(),
        &|b| {
            for _ in 0..20 {
                b.enu.y += 0.1;
                b.run(0.1);
            }
            b.mode = px4::OFFBOARD;
            b.run(2.0);
            resume(b);
        },
        Aborted,
        30.0,
    );
    scene(piloted(), &|b| b.run(901.0), PilotControl, 1.0);
    let returned = || {
        let mut bench = piloted();
        bench.mode = px4::OFFBOARD;
        bench.until(PilotReturned, 2.0);
        bench
    };
    scene(returned(), &|b| b.run(901.0), PilotReturned, 1.0);
    scene(returned(), &|b| b.mode = px4::HOLD, PilotControl, 2.0);
    scene(returned(), &|b| land(b), Land, 1.0);
    scene(returned(), &|b| b.silent = true, Land, 65.0);
    // Paused in the climb, and called back.
    scene(to(Climb), &|b| (pause(b), back(b)).1, Land, 1.0);
    // "On ground" in the air: disarming is refused, and the autopilot does not land.
    let hovers = || {
        let mut bench = flying();
        bench.refused = std::vec![176, 400];
        bench.false_ground = true;
        land(&mut bench);
        bench.until(Disarm, 6.0);
        bench
    };
    scene(hovers(), &|b| b.run(6.0), Disarm, 6.0);
    scene(hovers(), &|b| b.false_ground = false, Land, 1.0);
    // Given up in the air: somebody has to land it.
    let given_up = |b: &mut Bench| {
        b.armed = false;
        b.until(Aborted, 2.0);
        b.armed = true;
    };
    scene(flying(), &given_up, Land, 2.0);
    scene(
        flying(),
        &|b| {
            b.silent = true;
            b.until(AutopilotSilent, 5.0);
            b.until(Land, 65.0);
        },
        Aborted,
        130.0,
    );
    // A companion that starts in the air lands it when it is commanded to.
    let mut found = Bench::new(config());
    (found.armed, found.mode, found.enu.z) = (true, px4::OFFBOARD, 1.5);
    scene(found, &|b| (b.until(Failsafe, 3.0), land(b)).1, Land, 1.0);
    scene(
        flying(),
        &|b| {
            (b.mode, b.status) = (px4::RTL, 5);
            b.run(302.0);
            b.armed = false;
        },
        Aborted,
        3.0,
    );
    scene(
        ready(),
        &|b| {
            b.start();
            b.until(Streaming, 3.0);
            land(b);
            b.start();
        },
        Ready,
        6.0,
    );
    for row in crate::table::TABLE.iter().filter(|row| !row.text.is_empty()) {
        assert!(texts.iter().any(|t| t == row.text), "no scene took: {}", row.text);
    }
}
