//! Timed segments: a flight cut into short parts, each with the interval of time in which it is
//! held.

use heapless::Vec;
use libm::fmaxf;

use super::config::{ScheduleConfig, ScheduleError};
use crate::flight::{Flight, Waypoint};
use crate::geo::distance::segments_distance_sq;
use crate::{Length, Point};

/// Longest timed segment of a flight that needs at most [`MAX_TIMED_SEGMENTS`] of them, metres.
/// With shorter ones vehicles follow one another more closely, longer ones cost less.
pub const DEFAULT_MAX_SEGMENT_M: f32 = 1.5;
/// Most timed segments of one flight; a flight that would need more gets longer ones.
pub const MAX_TIMED_SEGMENTS: usize = 320;
/// Most doublings of the length of timed segments: to 1.5 km.
const MAX_SEGMENT_DOUBLINGS: usize = 10;
/// Least time after take-off for which the pad is held, seconds, however short the climb is: a
/// vehicle that stands on its pad has not left it.
pub(super) const MIN_PAD_HOLD_S: f32 = 0.05;

/// A timed segment: a straight part of a flight, and the interval in which it is held. Times are
/// seconds after take-off ([`super::sipp`]: after the mission's start); the pad is held from −∞,
/// the landing place to +∞.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimedSegment {
    /// Beginning, ENU metres in the mission frame.
    pub(super) from: Point,
    /// End, ENU metres in the mission frame.
    pub(super) to: Point,
    /// Arc length at which the vehicle would wait before it enters this segment, metres. That is
    /// the segment's beginning, or for a segment of a climb or descent the beginning of the whole
    /// climb or descent, within which no vehicle waits.
    pub(super) wait_at_m: f32,
    /// Arc length at which the segment ends, metres.
    pub(super) end_m: f32,
    /// Time from which the segment is held, seconds: when the vehicle leaves `wait_at_m`.
    pub(super) held_from_s: f32,
    /// Time at which the vehicle has left the segment, seconds.
    pub(super) held_until_s: f32,
    /// Whether the vehicle stands on the ground: on its pad or landing place.
    pub(super) parked: bool,
}

impl<const W: usize> Flight<W> {
    /// Sets `max_segment_m` to the shortest of [`DEFAULT_MAX_SEGMENT_M`], twice that, four times
    /// that … with which the flight has at most [`MAX_TIMED_SEGMENTS`] timed segments.
    pub(crate) fn choose_segment_length(&mut self) {
        self.max_segment_m = DEFAULT_MAX_SEGMENT_M;
        for _ in 0..MAX_SEGMENT_DOUBLINGS {
            // Each leg's number of segments is rounded up, so the path's length alone may show that
            // there are too many.
            let too_many =
                self.path.length_m() > self.max_segment_m * (MAX_TIMED_SEGMENTS + 1) as f32;
            if !too_many && self.segment_count() <= MAX_TIMED_SEGMENTS {
                break;
            }
            self.max_segment_m *= 2.0;
        }
    }

    /// Time from take-off to landing by the schedule, seconds; zero for a vehicle that stays on its
    /// pad.
    pub(crate) fn duration_s(&self, cfg: &ScheduleConfig) -> f32 {
        let landed_s = |w: &Waypoint| w.leave_s + self.descent_m / cfg.vertical_mps;
        self.path.waypoints().last().filter(|_| self.task.leaves_pad()).map_or(0.0, landed_s)
    }

    /// Number of timed segments into which [`cut_into_segments`] cuts the flight, counted from the
    /// same f32 lengths.
    pub(crate) fn segment_count(&self) -> usize {
        let waypoints = self.path.waypoints();
        let legs = waypoints.windows(2).map(|leg| leg[1].along_m - leg[0].along_m);
        let down_m = |waypoint: Option<&Waypoint>, m: f32| {
            waypoint.map_or(0.0, |w| libm::fabsf(w.position.z - (w.position.z - m)))
        };
        let ends =
            [down_m(waypoints.first(), self.climb_m), down_m(waypoints.last(), self.descent_m)];
        let lengths = ends.into_iter().chain(legs);
        let moving = lengths
            .map(|length_m| leg_segment_count(length_m, self.max_segment_m))
            .fold(0, u32::saturating_add);
        let holds = self.path.waypoints().iter().filter(|w| w.leave_s > w.arrive_s).count();
        (moving as usize).saturating_add(2 + holds)
    }
}

/// A straight part of a flight: a stay at its beginning, a leg, a stay at its end. Either stay may
/// be missing; a leg of length 0 has no segments.
#[derive(Clone, Copy, Debug)]
pub(super) struct StraightPart {
    /// The stay on the pad, or the hover at the waypoint where the leg begins. `None` without one.
    stay_before: Option<TimedSegment>,
    pub(super) leg: Leg,
    /// Arc lengths of the leg's beginning and end, metres.
    from_m: f32,
    to_m: f32,
    /// The stay at the landing place. `None` without one.
    stay_after: Option<TimedSegment>,
}

impl StraightPart {
    /// Refuses a leg of more than `most` timed segments: enormous lengths would make billions of
    /// them.
    pub(super) fn check_segment_count(
        &self,
        max_segment_m: f32,
        most: usize,
    ) -> Result<(), ScheduleError> {
        let fits = leg_segment_count(self.leg.length_m, max_segment_m) as usize <= most;
        if fits { Ok(()) } else { Err(ScheduleError::SegmentsFull) }
    }

    /// Passes the part's timed segments, the leg's at most `max_segment_m` long, to `visit` in
    /// order. Not inlined: a board has little flash.
    #[inline(never)]
    pub(super) fn for_each_segment(&self, max_segment_m: f32, visit: &mut dyn FnMut(TimedSegment)) {
        self.stay_before.into_iter().for_each(&mut *visit);
        self.leg.segments(self.from_m, self.to_m, max_segment_m).for_each(&mut *visit);
        self.stay_after.into_iter().for_each(visit);
    }
}

/// Straight part `part` of a flight that descends at `vertical_mps`. Part 0 is the pad and the
/// climb; then each leg is a part, with the hold at its beginning; the last is the descent and the
/// landing place. `None` for a larger `part`.
///
/// A climb is flown without a stop, and so is a descent with the landing place at its end. All
/// segments of such a group are held from the group's beginning, each until the vehicle has left
/// it.
pub(super) fn straight_part<const W: usize>(
    vertical_mps: f32,
    flight: &Flight<W>,
    part: usize,
) -> Option<StraightPart> {
    let waypoints = flight.path.waypoints();
    if part == 0 {
        return waypoints.first().map(|first| climb_part(flight, first));
    }
    let (begin, next) = (waypoints.get(part - 1)?, waypoints.get(part));
    if !flight.task.leaves_pad() {
        return None;
    }
    let holds = begin.leave_s > begin.arrive_s;
    let hold = hold_segment(begin.position, begin.along_m, begin.arrive_s, begin.leave_s);
    let before = holds.then_some(TimedSegment { parked: false, ..hold });
    Some(match next {
        Some(next) => StraightPart { stay_before: before, ..leg_part(begin, next) },
        None => StraightPart { stay_before: before, ..descent_part(flight, begin, vertical_mps) },
    })
}

/// The ends of the leg of straight part `part`, the same as in [`straight_part`]; `None` for a
/// larger `part`.
pub(super) fn part_leg_ends<const W: usize>(
    flight: &Flight<W>,
    part: usize,
) -> Option<(Point, Point)> {
    let waypoints = flight.path.waypoints();
    let below = |place: Point, m: f32| place - Point::new(0.0, 0.0, m);
    let leaves = flight.task.leaves_pad();
    if part == 0 {
        let first = waypoints.first()?.position;
        let pad = below(first, flight.climb_m);
        return Some((pad, if leaves { first } else { pad }));
    }
    let begin = waypoints.get(part - 1).filter(|_| leaves)?.position;
    let next = waypoints.get(part).map(|next| next.position);
    Some((begin, next.unwrap_or(below(begin, flight.descent_m))))
}

/// Timed segment of a vehicle that is parked at a point; the caller sets the times.
pub(super) fn parked_segment(at: Point) -> TimedSegment {
    hold_segment(at, 0.0, 0.0, 0.0)
}

/// Timed segment of a vehicle that stays at a point, whose arc length is `m`. `parked` is true; for
/// a hover the caller sets it to false.
fn hold_segment(at: Point, m: f32, from_s: f32, to_s: f32) -> TimedSegment {
    TimedSegment {
        from: at,
        to: at,
        wait_at_m: m,
        end_m: m,
        held_from_s: from_s,
        held_until_s: to_s,
        parked: true,
    }
}

/// Part 0: the pad and the climb; for a vehicle that stays, its pad at all times.
fn climb_part<const W: usize>(flight: &Flight<W>, first: &Waypoint) -> StraightPart {
    let pad = first.position - Point::new(0.0, 0.0, flight.climb_m);
    let (from_m, to_m) = (-flight.climb_m, 0.0);
    if !flight.task.leaves_pad() {
        let before = Some(hold_segment(pad, from_m, f32::NEG_INFINITY, f32::INFINITY));
        return StraightPart {
            stay_before: before,
            leg: Leg::vertical_leg(pad, pad, 0.0),
            from_m,
            to_m: from_m,
            stay_after: None,
        };
    }
    let leg = Leg::vertical_leg(pad, first.position, first.arrive_s);
    let (left_m, left_s) = leg.first_segment_length_and_duration(flight.max_segment_m);
    let on_pad = hold_segment(pad, from_m, f32::NEG_INFINITY, fmaxf(left_s, MIN_PAD_HOLD_S));
    let before = Some(TimedSegment { end_m: left_m - flight.climb_m, ..on_pad });
    StraightPart { stay_before: before, leg, from_m, to_m, stay_after: None }
}

/// The leg between two waypoints, without the hover at its beginning.
fn leg_part(begin: &Waypoint, next: &Waypoint) -> StraightPart {
    let leg = Leg {
        from: begin.position,
        to: next.position,
        length_m: next.along_m - begin.along_m,
        from_s: begin.leave_s,
        to_s: next.arrive_s,
        waiting_places: WaitingPlaces::BeforeEachSegment,
    };
    StraightPart {
        stay_before: None,
        leg,
        from_m: begin.along_m,
        to_m: next.along_m,
        stay_after: None,
    }
}

/// The last part: the descent and the landing place, without the hover before the descent.
fn descent_part<const W: usize>(
    flight: &Flight<W>,
    last: &Waypoint,
    vertical_mps: f32,
) -> StraightPart {
    let ground = last.position - Point::new(0.0, 0.0, flight.descent_m);
    let end_m = last.along_m + flight.descent_m;
    let landed_s = last.leave_s + flight.descent_m / vertical_mps;
    let leg = Leg {
        from_s: last.leave_s,
        to_s: landed_s,
        ..Leg::vertical_leg(last.position, ground, 0.0)
    };
    let landed = hold_segment(ground, end_m, last.leave_s, f32::INFINITY);
    let after = Some(TimedSegment { wait_at_m: last.along_m, ..landed });
    StraightPart { stay_before: None, leg, from_m: last.along_m, to_m: end_m, stay_after: after }
}

/// Cuts a flight into timed segments of at most `flight.max_segment_m` metres.
pub(super) fn cut_into_segments<const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    out: &mut Vec<TimedSegment, MAX_TIMED_SEGMENTS>,
) -> Result<(), ScheduleError> {
    out.clear();
    let mut full = false;
    for part in (0..).map_while(|part| straight_part(cfg.vertical_mps, flight, part)) {
        part.check_segment_count(flight.max_segment_m, MAX_TIMED_SEGMENTS - out.len())?;
        part.for_each_segment(flight.max_segment_m, &mut |segment| {
            full |= out.push(segment).is_err();
        });
    }
    if full { Err(ScheduleError::SegmentsFull) } else { Ok(()) }
}

/// Where on a leg a vehicle may wait for another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WaitingPlaces {
    /// Before each timed segment of the leg.
    BeforeEachSegment,
    /// Before the whole leg only.
    BeforeLegOnly,
}

/// A straight leg flown at constant speed. `from_s` and `to_s` are the times at its ends, seconds,
/// after take-off or after the beginning of the leg.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Beginning, ENU metres in the mission frame.
    pub(super) from: Point,
    /// End, ENU metres in the mission frame.
    pub(super) to: Point,
    /// Length, metres.
    pub(super) length_m: f32,
    pub(super) from_s: f32,
    pub(super) to_s: f32,
    /// Where on the leg the vehicle may wait.
    pub(super) waiting_places: WaitingPlaces,
}

impl Leg {
    /// A vertical leg, up or down, that begins at time 0.
    pub(super) fn vertical_leg(from: Point, to: Point, to_s: f32) -> Self {
        Self {
            from,
            to,
            length_m: libm::fabsf(to.z - from.z),
            from_s: 0.0,
            to_s,
            waiting_places: WaitingPlaces::BeforeLegOnly,
        }
    }

    /// Length in metres and duration in seconds of the leg's first timed segment.
    pub(super) fn first_segment_length_and_duration(&self, max_segment_m: f32) -> (f32, f32) {
        let share = 1.0 / fmaxf(leg_segment_count(self.length_m, max_segment_m) as f32, 1.0);
        (self.length_m * share, (self.to_s - self.from_s) * share)
    }

    /// The timed segments of the leg, at most `max_segment_m` long; `from_m` and `to_m` are the arc
    /// lengths of its ends.
    pub(super) fn segments(
        self,
        from_m: f32,
        to_m: f32,
        max_segment_m: f32,
    ) -> impl Iterator<Item = TimedSegment> {
        let parts = leg_segment_count(self.length_m, max_segment_m);
        let at = move |part: u32| {
            if part == parts {
                // The next leg begins at exactly this point, bit by bit.
                return (self.to, to_m, self.to_s);
            }
            let share = part as f32 / parts as f32;
            let mix = |a: f32, b: f32| a + (b - a) * share;
            (
                self.from + (self.to - self.from) * share,
                mix(from_m, to_m),
                mix(self.from_s, self.to_s),
            )
        };
        let mut begin = at(0);
        (0..parts).map(move |part| {
            let (to, to_m, to_s) = at(part + 1);
            let (from, start_m, start_s) = core::mem::replace(&mut begin, (to, to_m, to_s));
            let (from_m, from_s) = if self.waiting_places == WaitingPlaces::BeforeLegOnly {
                (from_m, self.from_s)
            } else {
                (start_m, start_s)
            };
            TimedSegment {
                from,
                to,
                wait_at_m: from_m,
                end_m: to_m,
                held_from_s: from_s,
                held_until_s: to_s,
                parked: false,
            }
        })
    }
}

/// A straight leg that begins at time 0 and takes `duration_s`.
pub(super) fn leg_at_time_zero(from: Point, to: Point, duration_s: f32) -> Leg {
    let length_m = (to - from).length();
    Leg {
        from,
        to,
        length_m,
        from_s: 0.0,
        to_s: duration_s,
        waiting_places: WaitingPlaces::BeforeEachSegment,
    }
}

/// Number of timed segments of a leg; 0 for length 0.
pub(super) fn leg_segment_count(length_m: f32, max_segment_m: f32) -> u32 {
    libm::ceilf(length_m / max_segment_m) as u32
}

/// Whether two timed segments come nearer than the separation, whatever their times are.
pub(super) fn is_conflict(cfg: &ScheduleConfig, p: &TimedSegment, q: &TimedSegment) -> bool {
    if p.parked && q.parked && p.held_from_s.is_infinite() == q.held_from_s.is_infinite() {
        // Two pads, or two landing places, never conflict: their distance is given by the mission.
        return false;
    }
    let apart = if p.parked || q.parked { cfg.parked_separation_m } else { cfg.separation_m };
    let reach = apart + 0.5 * (p.end_m - p.wait_at_m + q.end_m - q.wait_at_m);
    let middles = (p.from + p.to - q.from - q.to) * 0.5;
    middles.norm_squared() < reach * reach
        && segments_distance_sq((&p.from, &p.to), (&q.from, &q.to)) < apart * apart
}
