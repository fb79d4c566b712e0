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
    scenes.play(returned(), |b| b.run(901.0), PilotReturned, 1.0);
    scenes.play(returned(), pilot_takes, PilotControl, 2.0);
    scenes.play(returned(), land, Land, 1.0);
    scenes.play(returned(), |b| b.silent = true, Land, 65.0);
}
