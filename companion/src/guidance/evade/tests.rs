extern crate std;

use planner_core::detour::ZoneKind;

use super::*;

fn path() -> Path<4> {
    let mut path = Path::new();
    for (x, y) in [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0)] {
        path.push(Point::new(x, y, 1.0), 0.8).unwrap();
    }
    path
}

fn above(x: f32, y: f32, z: f32) -> Neighbour {
    Neighbour {
        id: 9,
        rank: 1,
        position: Point::new(x, y, z),
        velocity: Point::zeros(),
        age_s: 0.0,
        progress_m: None,
        grounded: false,
        out_of_plan: false,
        on_detour: false,
    }
}

/// The column of a vehicle that comes down from 8 m.
fn column(x: f32, y: f32, radius_m: f32) -> KeepOutZone {
    let (from, to) = (Point::new(x, y, 8.0), Point::new(x, y, 0.0));
    KeepOutZone { from, to, radius_m, kind: ZoneKind::LandingColumn }
}

/// Result of a search for a waiting place back from 9 m along the path, and the steps that it
/// takes.
fn search(columns: &[KeepOutZone]) -> (EvadeTarget, usize) {
    let path = path();
    let mut search = EvadeSearch { last_target: EvadeTarget::Back(99.0), ..EvadeSearch::default() };
    for steps in 1.. {
        // Each neighbour gives up to 16 columns.
        let of = |i: usize| columns.chunks(16).nth(i).unwrap_or_default();
        search.continue_search(&path, 9.0, 31, |i, visit| {
            of(i).iter().for_each(|column| visit(*column));
        });
        if search.last_target != EvadeTarget::Back(99.0) {
            return (search.last_target, steps);
        }
        assert!(steps < 100);
    }
    unreachable!();
}

#[test]
fn a_place_below_one_that_comes_down_is_exchanged_for_one_before_it() {
    let (EvadeTarget::Back(to_m), 1) = search(&[column(6.0, 3.0, 2.1)]) else {
        panic!("one is looked at in a step")
    };
    assert!((5.0..7.0).contains(&to_m), "{to_m}");
    assert_eq!(search(&[column(0.0, 3.0, 2.1)]), (EvadeTarget::Here, 1));
    assert_eq!(search(&[column(6.0, 3.0, 20.0)]), (EvadeTarget::Nowhere, 2), "nowhere is better");
    // A waiting place that is no whole number of steps from the start of the path.
    let mut search = EvadeSearch::default();
    search.continue_search(&path(), 1.1, 1, |_, visit| visit(column(2.1, 0.0, 2.0)));
    assert_eq!(search.last_target, EvadeTarget::Back(0.0), "its start is the last place");
}

#[test]
fn a_search_among_all_columns_there_can_be_takes_a_dozen_steps() {
    let mut columns = std::vec![column(60.0, 0.0, 2.1); 31 * 16];
    let (found, steps) = search(&columns);
    assert!(found == EvadeTarget::Here && (5..8).contains(&steps), "{steps}");
    let last = columns.len() - 1;
    columns[last] = column(6.0, 3.0, 2.1);
    let (found, steps) = search(&columns);
    assert!(matches!(found, EvadeTarget::Back(_)) && steps < 20, "{found:?} after {steps}");
}

#[test]
fn it_goes_back_slowly_round_the_corner_and_not_into_a_follower() {
    let path = path();
    let mut reference = ReferenceState { along_m: 9.0, ..ReferenceState::default() };
    let mut follower = above(0.0, 0.0, 1.0);
    follower.progress_m = Some(0.0);
    let mut steps = 0;
    while reference.along_m > 4.0 && steps < 400 {
        step_back(&path, &mut reference, 4.0, &[follower], 1.5, 0.05).unwrap();
        let corner_m = (reference.along_m - 6.0).abs();
        assert!(
            corner_m > 0.05 || reference.speed_mps.abs() < MAX_CORNER_MPS + 0.15,
            "{reference:?}"
        );
        steps += 1;
    }
    assert!(reference.along_m < 4.05 && steps < 200, "{reference:?} after {steps}");
    let mut near = ReferenceState { along_m: 2.0, ..ReferenceState::default() };
    while step_back(&path, &mut near, 0.0, &[follower], 1.5, 0.05).is_some() {}
    assert!(near.along_m > 1.5, "{near:?}");
}
