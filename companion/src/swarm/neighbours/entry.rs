//! The table's entry of one neighbour, and how a message changes it.

use heapless::Vec;
use planner_core::Point;
use planner_core::track::deconflict::Neighbour;
use planner_core::track::safety::{PlaceOnPoints, ReportedPathReach};

use super::bounds::*;
use crate::link::echo::MessageDelay;
use crate::link::intent::{MAX_POINTS, ON_DETOUR, OUT_OF_PLAN};
use crate::link::sequence::SequenceFilter;
use crate::time::{Duration, Instant};

/// The table's entry of one neighbour: what was last heard of it.
#[derive(Clone, Debug)]
pub(crate) struct NeighbourEntry {
    /// MAVLink system id.
    pub(super) id: u8,
    /// Index in the roster sorted by id, this vehicle included; [`RANK_OUTSIDE_ROSTER`] for a
    /// stranger.
    pub(super) rank: u16,
    /// Rejects intents that are no newer than the last one.
    pub(super) sequence: SequenceFilter,
    /// When a valid position, or an intent of our mission, was last heard; `None` before.
    pub(super) heard_at: Option<Instant>,
    /// When a valid position was last heard; `None` before.
    pub(super) position_at: Option<Instant>,
    /// `time_boot_ms` of that position.
    pub(super) position_boot_ms: u32,
    /// Flags of the last intent, such as [`OUT_OF_PLAN`].
    pub(super) flags: u8,
    /// Since when the neighbour has reported that it is out of the plan, with its position known;
    /// `None` while it does not.
    pub(super) out_of_plan_since: Option<Instant>,
    /// When the neighbour last reported that it hears this vehicle; `None` before.
    pub(super) hears_us_at: Option<Instant>,
    /// Vehicles that the neighbour hears, by its last intent, a bit for each rank.
    pub(super) heard_bits: u32,
    /// The neighbour's progress along the shared plan as others relayed it, metres; `None` without
    /// a relay for the present plan.
    pub(super) relayed_progress_m: Option<f32>,
    /// When the neighbour made the newest report that others relayed; `None` as
    /// `relayed_progress_m`.
    pub(super) relayed_report_at: Option<Instant>,
    /// Sequence number of the neighbour's last intent.
    pub(super) intent_sequence: u8,
    /// Estimated one-way delay of the neighbour's messages.
    pub(super) message_delay: MessageDelay,
    /// When the neighbour's last intent of our mission was heard; `None` before.
    pub(super) intent_at: Option<Instant>,
    /// Points that the neighbour flies along next, by its last intent.
    pub(super) points: Vec<Point, MAX_POINTS>,
    /// Number of points, at the end of `points`, to which the neighbour flies only if no vehicle
    /// hears it; before them is the point where it will stop for now.
    pub(super) unheard_flight_point_count: u8,
    /// Where the neighbour's position is on its reported points.
    pub(super) place_on_points: PlaceOnPoints,
    /// How far the neighbour's points, up to where it will stop for now, lead it from its position.
    pub(super) reported_path_reach: ReportedPathReach,
    /// Greatest distance of the points, up to where it will stop for now, from the first, metres.
    pub(super) points_extent_m: f32,
    /// Length of the polyline from the neighbour's position through all its points, metres: in a
    /// coverage mission it flies all of them if no vehicle hears it, as far as its lease allows.
    /// −1 in other missions, and before the first intent.
    pub(super) points_length_m: f32,
    /// Whether the neighbour may come down from where it is, by its last intent.
    pub(super) may_come_down: bool,
    /// Height of the ground below the neighbour as it reported it, ENU up, metres; NaN before its
    /// first intent.
    pub(super) ground_m: f32,
    /// Place along its path up to which the neighbour's gates were open, or would open after a
    /// wait, metres: it flies on to there even if no vehicle hears it. −∞ if unknown.
    pub(super) gates_open_up_to_m: f32,
    /// Seconds by which gates and climb delay its flight to `gates_open_up_to_m`, compared with a
    /// flight at `min_unheard_progress_mps`.
    pub(super) unheard_flight_delay_s: u8,
    /// Whether the neighbour's last position was so far from this vehicle that the radio may not
    /// reach.
    pub(super) at_range_edge: bool,
    /// Least speed at which the neighbour is assumed to make progress while none hears it, m/s.
    pub(super) min_unheard_progress_mps: f32,
    /// Distance along its points within which the neighbour comes to rest once no vehicle hears it,
    /// metres, without what the delay of messages adds. Greater where the radio's range is known.
    pub(super) max_unheard_travel_m: f32,
    /// Greatest speed at which the neighbour is assumed to fly on while none hears it, m/s: that of
    /// the mission's fastest vehicle.
    pub(super) fastest_vehicle_mps: f32,
    /// The neighbour's speed at its last position, m/s.
    pub(super) speed_mps: f32,
    /// Whether the neighbour's plan has our plan's CRC, whether it follows that plan or not.
    pub(super) shares_plan: bool,
    /// Whether the neighbour follows a plan of our mission with another CRC than ours.
    pub(super) follows_other_plan: bool,
    /// When a position last showed the neighbour faster than [`MAX_HOVER_MPS`].
    pub(super) moved_at: Instant,
    /// Greatest progress that is believed of the neighbour, metres along its path, at an instant;
    /// the bound grows from then on. `None` before the first report of progress.
    pub(super) max_progress: Option<(f32, Instant)>,
    /// The neighbour's place before its take-off: its autopilot may fly it back there. `None` if it
    /// was not heard on the ground with a position.
    pub(super) pad: Option<Point>,
    /// Place where the neighbour, out of the plan, rested when the present detour was planned; NaN
    /// for none.
    pub(super) avoided_place: Point,
    /// State as last heard, for `deconflict::advise`. `age_s`, `out_of_plan` and `on_detour` are
    /// not kept in it: [`super::Neighbours::states_with_age`] computes them.
    pub(super) state: Neighbour,
}

impl NeighbourEntry {
    /// The entry of a neighbour that has not been heard yet.
    // Inlined at its only caller: a board's stack has no room for a copy.
    #[inline(always)]
    pub(super) fn new_not_heard_yet(
        id: u8,
        rank: u16,
        min_unheard_progress_mps: f32,
        [max_unheard_travel_m, fastest_vehicle_mps]: [f32; 2],
    ) -> Self {
        let state = Neighbour {
            id,
            rank,
            position: Point::zeros(),
            velocity: Point::zeros(),
            age_s: 0.0,
            progress_m: None,
            grounded: false,
            out_of_plan: false,
            on_detour: false,
        };
        Self {
            id,
            rank,
            sequence: SequenceFilter::default(),
            heard_at: None,
            position_at: None,
            position_boot_ms: 0,
            flags: 0,
            out_of_plan_since: None,
            hears_us_at: None,
            heard_bits: 0,
            relayed_progress_m: None,
            relayed_report_at: None,
            intent_sequence: 0,
            message_delay: MessageDelay::default(),
            intent_at: None,
            points: Vec::new(),
            unheard_flight_point_count: 0,
            place_on_points: PlaceOnPoints::Unknown,
            points_extent_m: 0.0,
            reported_path_reach: ReportedPathReach::UNBOUNDED,
            points_length_m: -1.0,
            may_come_down: false,
            gates_open_up_to_m: f32::NEG_INFINITY,
            unheard_flight_delay_s: 0,
            at_range_edge: false,
            min_unheard_progress_mps,
            max_unheard_travel_m,
            fastest_vehicle_mps,
            ground_m: f32::NAN,
            speed_mps: 0.0,
            shares_plan: false,
            follows_other_plan: false,
            moved_at: Instant::ZERO,
            max_progress: None,
            pad: None,
            avoided_place: NO_PLACE,
            state,
        }
    }

    /// Whether the neighbour would fly on to the last of its points if no vehicle heard it: so it
    /// is in coverage missions, once an intent was heard. Says nothing of whether it is heard now.
    pub(crate) fn would_fly_all_points_unheard(&self) -> bool {
        self.points_length_m >= 0.0
    }

    /// The neighbour's points up to where it will stop for now.
    pub(super) fn points_to_stop(&self) -> &[Point] {
        &self.points
            [..self.points.len().saturating_sub(usize::from(self.unheard_flight_point_count))]
    }

    /// Whether a position or intent of the neighbour was heard less than `span` ago.
    pub(super) fn heard_within(&self, now: Instant, span: Duration) -> bool {
        self.heard_at.is_some_and(|at| now - at < span)
    }

    /// Whether the neighbour follows the shared plan, as last heard.
    pub(super) fn on_plan(&self) -> bool {
        self.state.progress_m.is_some() && !self.reports_any(ON_DETOUR | OUT_OF_PLAN)
    }

    /// Whether the neighbour's last intent had any of these flags.
    pub(super) fn reports_any(&self, flags: u8) -> bool {
        self.flags & flags != 0
    }

    /// The part of a reported progress that is believed, metres: no more than the vehicle can have
    /// flown since the report before, at `fastest_mps`. The rest is believed as time passes; so is
    /// a landing, whose report jumps to the end of the path. A lower progress is believed: it opens
    /// no gate. The first report of a plan is believed in full.
    pub(super) fn plausible_progress_m(
        &mut self,
        progress_m: f32,
        fastest_mps: f32,
        now: Instant,
    ) -> f32 {
        let furthest =
            self.max_progress.map(|(at_m, at)| at_m + fastest_mps * (now - at).as_secs_f32());
        let believed_m =
            furthest.map_or(progress_m, |furthest_m| libm::fminf(progress_m, furthest_m));
        let late_m = believed_m + fastest_mps * MAX_MESSAGE_DELAY_S + MAX_PROGRESS_JUMP_M;
        self.max_progress =
            Some((furthest.map_or(late_m, |furthest_m| libm::fminf(furthest_m, late_m)), now));
        believed_m
    }

    /// Finds where the neighbour's position is on its points; to be called when either is received.
    pub(super) fn update_place_on_points(&mut self) {
        let (at, points) = (&self.state, self.points_to_stop());
        let place = PlaceOnPoints::find(&at.position, points, &at.velocity);
        self.reported_path_reach =
            ReportedPathReach::new(&at.position, points, &place, self.points_extent_m);
        self.place_on_points = place;
        if self.would_fly_all_points_unheard() {
            let mut at = self.state.position;
            let legs = self.points.iter().map(|next| next - core::mem::replace(&mut at, *next));
            self.points_length_m = legs.map(|leg| fpu::sqrtf(leg.norm_squared())).sum();
        }
    }
}
