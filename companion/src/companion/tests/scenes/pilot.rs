//! The pilot takes the vehicle, and gives it back.

use super::State::*;
use super::*;

/// A vehicle that its pilot took over in flight.
fn piloted() -> Bench {
    let mut bench = flying();
    pilot_takes(&mut bench);
    bench.run_until(PilotControl, 3.0);
    bench
}

/// The pilot gives the vehicle back: it is in Offboard again.
fn gives_back(b: &mut Bench) {
    b.mode = px4::OFFBOARD;
}

/// A vehicle that its pilot gave back, before the resume command.
fn returned() -> Bench {
    let mut bench = piloted();
    gives_back(&mut bench);
    bench.run_until(PilotReturned, 2.0);
    bench
}

/// The pilot gives the vehicle back, and the ground station resumes the mission.
fn resumed(b: &mut Bench) {
    gives_back(b);
    b.run(2.0);
    resume(b);
}

pub(super) fn takes_over(scenes: &mut Scenes) {
    scenes.play(flying(), pilot_takes, PilotControl, 3.0);
    scenes.play(landing(), pilot_takes, PilotControl, 3.0);
    scenes.play(piloted(), |b| b.armed = false, Aborted, 3.0);
    scenes.play(piloted(), fails_safe, Failsafe, 3.0);
    scenes.play(piloted(), |b| b.run(901.0), PilotControl, 1.0);
}

pub(super) fn returns(scenes: &mut Scenes) {
    scenes.play(piloted(), resumed, Done, 60.0);
    let flown_off_the_path = |b: &mut Bench| {
        for _ in 0..20 {
            b.enu.y += 0.1;
            b.run(0.1);
        }
        resumed(b);
    };
    scenes.play(piloted(), flown_off_the_path, Aborted, 30.0);
    // Over an area: as far from its path as no leg's clearance reaches, it is ordered back.
    let ordered_home = |b: &mut Bench| {
        for _ in 0..60 {
            b.enu.y += 0.3;
            b.run(0.1);
        }
        gives_back(b);
        b.run(2.0);
        b.neighbour = landings::beside_the_column(b);
        land(b);
        b.answer_detour = None;
        b.run_until(Replanning, 60.0);
        b.answer_detour = Some(Ok(()));
        back(b);
        b.run_until(Follow, 20.0);
        let place = b.enu;
        b.run_until(Land, 10.0);
        assert!((b.enu - place).norm() < 0.5, "{place:?} {:?}", b.enu);
        b.neighbour = on_pad(ON_PLAN);
    };
    let mut over_an_area = losses::over_a_field(Follow);
    pilot_takes(&mut over_an_area);
    over_an_area.run_until(PilotControl, 3.0);
    scenes.play(over_an_area, ordered_home, Aborted, 60.0);
    scenes.play(returned(), |b| b.run(901.0), PilotReturned, 1.0);
    scenes.play(returned(), pilot_takes, PilotControl, 2.0);
    scenes.play(returned(), land, Land, 1.0);
    scenes.play(returned(), |b| b.silent = true, Land, 65.0);
}
