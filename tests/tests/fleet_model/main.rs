//! Every way in which a small fleet can lose vehicles and messages, searched breadth first.
//!
//! Vehicles decide by the code that flies: [`Fleet`] and the messages that it sends and handles. A
//! tick is 7.5 s: the lease of 20 s is 3 ticks, the silence of 45 s is 6, and a lost vehicle counts
//! as down as soon as it is silent. In a tick each vehicle handles the messages of the tick before
//! that reached it (so messages are a tick late, and their reports of others are older still),
//! decides, and photographs its next waypoint. A vehicle stops within a tick after its lease has
//! run out, and lands after three. One clock may become a tick slow, and right again, at any time.
//! A vehicle may die, or leave and report it. Each flies as far as it may, or only to its
//! commitment: all mixtures are searched.
//!
//! - One owner: there is never a waypoint that two vehicles may still photograph.
//! - Nothing is left out: from every state, if all messages arrive from then on and some vehicle
//!   flies on, all is photographed in the end, and the fleet comes to rest.
//!
//! Planted errors must be found. `FLOCKMATE_MODEL=4` to `7` search more; see `docs/safety.md`.

mod links;
mod model;

use flockmate_tests::number_from_env;
use links::partitions;
use model::{FleetModel, Flight, MOST, Planted, Radio, SETTLES, State};
use stateright::{Checker, Model};

/// Searches until no new state is reached, or each property has a counterexample. Returns the
/// properties with one.
fn search(model: FleetModel) -> Vec<&'static str> {
    let FleetModel { count, radio, losses, slow, planted, .. } = model;
    let checker = model.checker().spawn_bfs().join();
    let found: Vec<&str> = checker.discoveries().into_keys().collect();
    println!(
        "{count} vehicles, {radio:?}, {losses} losses, slow clock {slow:?}, {planted:?}: {} states, found {found:?}",
        checker.unique_state_count()
    );
    found
}

fn search_right(count: usize, radio: Radio, losses: u8, slow: Option<usize>) {
    let model = FleetModel { losses, slow, ..FleetModel::new(count, radio, Planted::Nothing) };
    assert_eq!(search(model), Vec::<&str>::new());
}

/// Whether searches of more than a minute run too.
fn searches_all() -> bool {
    number_from_env("FLOCKMATE_MODEL", 0) >= 4
}

/// Of four vehicles up to two are lost, while any partition changes up to twice: run alone, since
/// that takes minutes and gigabytes.
#[test]
fn four_vehicles_with_two_losses_and_two_changes() {
    match number_from_env("FLOCKMATE_MODEL", 0) {
        5 => search_right(4, Radio::Parts(1), 2, None),
        6 => search_right(4, Radio::Parts(2), 1, None),
        7.. => search_right(4, Radio::Parts(2), 2, None),
        _ => {}
    }
}

#[test]
fn two_vehicles_with_any_messages_lost() {
    for slow in [None, Some(0), Some(1)] {
        search_right(2, Radio::Any, 1, slow);
    }
}

#[test]
fn three_vehicles_with_one_way_links() {
    search_right(3, Radio::Links(1), 1, None);
    for slow in 0..3 {
        search_right(3, Radio::Parts(0), 2, Some(slow));
    }
    if searches_all() {
        search_right(3, Radio::Links(2), 0, None);
        for slow in 0..3 {
            search_right(3, Radio::Parts(1), 2, Some(slow));
        }
    }
}

#[test]
fn four_vehicles_with_partitions() {
    search_right(4, Radio::Parts(0), 2, None);
    search_right(4, Radio::Parts(1), 1, None);
    if searches_all() {
        search_right(4, Radio::Parts(2), 0, None);
    }
}

/// A path holds only half of each part: the rest is requested by a division.
#[test]
fn stretches_with_any_messages_lost() {
    let stretches = |count, radio, losses, slow| {
        let model =
            FleetModel { losses, slow, most: 1, ..FleetModel::new(count, radio, Planted::Nothing) };
        assert_eq!(search(model), Vec::<&str>::new());
    };
    for slow in [None, Some(0), Some(1)] {
        stretches(2, Radio::Any, 1, slow);
    }
    stretches(3, Radio::Parts(0), 1, None);
    if searches_all() {
        stretches(3, Radio::Links(1), 1, None);
        stretches(3, Radio::Parts(1), 1, None);
        stretches(4, Radio::Parts(0), 1, None);
    }
}

#[test]
fn planted_errors_are_found() {
    let cases = [
        (2, Planted::TakenOverEarly, Radio::Any),
        (3, Planted::LeaseIgnored, Radio::Links(1)),
        (3, Planted::PresentAlone, Radio::Links(1)),
        (3, Planted::PromiseBroken, Radio::Links(2)),
    ];
    for (count, planted, radio) in cases {
        let model = FleetModel { losses: 0, ..FleetModel::new(count, radio, planted) };
        assert!(search(model).contains(&"one owner"), "{planted:?}");
    }
}

/// Of two equal parts of a partition the one with the lowest id continues, else the larger one. It
/// photographs all, and the others land.
#[test]
fn of_parts_for_ever_one_goes_on() {
    for count in 2..=MOST {
        let model = FleetModel::new(count, Radio::Parts(0), Planted::Nothing);
        for links in partitions(count) {
            let mut state = State { links, ..model.init_states()[0] };
            let known = &mut *model.known.lock().unwrap();
            for _ in 0..SETTLES {
                state = model.best(known, &state);
            }
            let part = |rank: usize| links[rank] | 1 << rank;
            let wins = |part: u8| {
                let many = 2 * part.count_ones() as usize;
                many > count || (many == count && part & 1 != 0)
            };
            for rank in 0..count {
                let vehicle = &known.vehicles[state.vehicles[rank] as usize];
                let flies = vehicle.flight == Flight::Flies;
                assert_eq!(flies, wins(part(rank)), "{links:?}: {vehicle:?}");
            }
            let taken = (0..count)
                .fold(0, |bits, rank| bits | known.vehicles[state.vehicles[rank] as usize].taken);
            let all = (0..count).any(|rank| wins(part(rank)));
            assert!(
                !all || taken.count_ones() as usize == model.whole.len(),
                "{links:?}: {taken:b}"
            );
        }
    }
}
