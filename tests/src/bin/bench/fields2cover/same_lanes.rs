//! Our order of the lanes that Fields2Cover laid: the part of the difference in length that is not
//! due to the lanes themselves.

use anyhow::Result;
use companion::planner::coverage::BOARD_SEARCH_STEPS;
use host_sim::coverage::{MAX_LANES, MAX_NO_FLY_CORNERS};
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::given::order_given_lanes;
use planner_core::coverage::tracks::Tracks;
use planner_core::coverage::transit::TransitGraph;

use super::routes::{EastNorth, Obstacles, to_f64};

/// Length of our way along these lanes and between them, around `obstacles` in the ring `outer`,
/// metres: searched as long as boards search, measured as theirs is.
///
/// # Errors
/// The field or its lanes are refused.
pub fn our_length_on_lanes_m(
    outer: &[Flat],
    obstacles: &Obstacles,
    lanes: &[[EastNorth; 2]],
    lane_m: f32,
) -> Result<f64> {
    // Fields2Cover's lanes end at the obstacles. So our graph has the obstacles slightly shrunk, as
    // those are by which Fields2Cover's routes are measured.
    let mut vertices = outer.to_vec();
    let mut rings = vec![Ring { end: outer.len() as u16, kind: RingKind::Outer }];
    for ring in obstacles.rings() {
        vertices.extend(ring.iter().map(to_flat));
        rings.push(Ring { end: vertices.len() as u16, kind: RingKind::NoFly });
    }
    let area = Area::new(&vertices, &rings).map_err(|error| anyhow::anyhow!("{error:?}"))?;
    let mut transit = Box::new(TransitGraph::<MAX_NO_FLY_CORNERS>::empty());
    transit.set_area(area).map_err(|error| anyhow::anyhow!("{error:?}"))?;
    let footprint = Footprint { along_m: lane_m, across_m: lane_m };
    let spacing = Spacing { footprint, max_lane_spacing_m: lane_m, max_waypoint_spacing_m: lane_m };
    let given: Vec<[Flat; 2]> =
        lanes.iter().map(|ends| [0, 1].map(|k| to_flat(&ends[k]))).collect();
    let mut found: Box<Tracks<MAX_LANES>> = Box::default();
    order_given_lanes(&given, &spacing, BOARD_SEARCH_STEPS, &transit, &mut found)
        .map_err(|error| anyhow::anyhow!("{error:?}"))?;
    let ordered: Vec<[EastNorth; 2]> =
        found.lanes().iter().map(|lane| [lane.from, lane.to].map(to_f64)).collect();
    Ok(obstacles.measure(&ordered).1)
}

fn to_flat(at: &EastNorth) -> Flat {
    Flat::new(at[0] as f32, at[1] as f32)
}
