//! Divisions of numbered waypoints: a simple planner for the models of fleets, instead of lanes.

use companion::swarm::fleet::{Fleet, VehicleDivisionInput};

/// Length of path per waypoint, decimetres.
pub const WAYPOINT_DM: u16 = 100;

/// The waypoints of each of `count` vehicles, in the order of their flight, after the divisions
/// that `fleet` knows, and a hash of these divisions.
pub fn divide_waypoints<const V: usize>(
    whole: &[u32],
    fleet: &Fleet<V>,
    count: usize,
) -> (Vec<Vec<u32>>, u32) {
    let mut left = whole.to_vec();
    let mut living = vec![true; count];
    let share = |left: &[u32], living: &[bool]| {
        let many = living.iter().filter(|lives| **lives).count();
        let each = left.len().div_ceil(many.max(1)).max(1);
        let mut chunks = left.chunks(each);
        let next = |lives: &bool| {
            if *lives { chunks.next().map(<[u32]>::to_vec).unwrap_or_default() } else { Vec::new() }
        };
        living.iter().map(next).collect::<Vec<_>>()
    };
    let mut parts = share(&left, &living);
    let mut hash = 17u32;
    for inputs in fleet.inputs_of_divisions() {
        let mut done = Vec::new();
        for (rank, input) in inputs.iter().enumerate() {
            let taken = usize::from(input.along_dm / WAYPOINT_DM).min(parts[rank].len());
            // Of a vehicle that is gone the last waypoint passed counts as not done, unless it
            // flew its whole path.
            let sure = input.alive || input.along_dm == VehicleDivisionInput::WHOLE_PATH;
            done.extend(&parts[rank][..if sure { taken } else { taken.saturating_sub(1) }]);
            living[rank] = input.alive;
            hash = hash
                .wrapping_mul(31)
                .wrapping_add(u32::from(input.along_dm) * 2 + u32::from(input.alive));
        }
        left.retain(|waypoint| !done.contains(waypoint));
        parts = share(&left, &living);
    }
    (parts, hash)
}
