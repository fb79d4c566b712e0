//! The checker of coverage plans: it checks that all of the area is photographed, that each
//! waypoint is flown once, on routes without gaps, and that no leg enters a no-fly zone.
//!
//! It takes planned flights, or pictures as they were taken in a flight, computes in f64, and
//! shares no code with the planner. The area is split into square cells of a tenth of the lane
//! spacing. A cell counts if its centre is in the area and outside no-fly zones; it is photographed
//! if one picture shows all four of its corners. Where neighbouring pictures overlap by less than a
//! cell, several pictures together must show a cell's centre and each of its corners that lies in
//! the area.

use planner_core::coverage::Flat;
use planner_core::coverage::area::RingKind;

pub use super::flight::TimedFlight;
use super::flight::{FlightPoint, WaypointAction};
use super::heights::{self, HeightFindings};
pub use super::taken::Picture;
use super::{CoveragePlan, SortieFlight, taken};

/// Most cells of the grid over the area; a larger area gets larger cells.
const MAX_CHECKED_CELLS: f64 = 4e7;

/// Result of the check.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoverageFindings {
    /// Photographed cells divided by all cells that count, 0 to 1; 0 if none counts.
    pub covered_share: f64,
    /// Number of cells that count.
    pub cells_to_cover: u64,
    /// Centre of the first cell that is not photographed, metres east and north; `None` if all are.
    pub first_missing_cell_centre: Option<[f64; 2]>,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Number of pictures.
    pub photos: u64,
    /// Number of waypoints at which no picture is taken.
    pub missed_waypoints: u64,
    /// Number of waypoints that are flown more than once.
    pub repeated_waypoints: u64,
    /// Number of flights whose waypoint numbers do not rise or fall by one from picture to picture.
    pub broken_routes: u64,
    /// Number of legs that enter a no-fly zone.
    pub legs_in_no_fly_zones: u64,
    /// Heights of lanes above terrain; `None` over level ground, and where pictures that were taken
    /// in a flight are checked instead of planned flights.
    pub heights: Option<HeightFindings>,
    /// For each picture, by rising time: its time, seconds after the mission's start, and the
    /// number of cells that are photographed with this picture and were not before.
    pub new_cells_over_time: Vec<(f32, u64)>,
}

impl CoverageFindings {
    /// Whether the area is covered, each waypoint flown once, and no other fault was found. An area
    /// of which no cell counts is not judged, so it is not clean.
    pub fn is_clean(&self) -> bool {
        self.cells_to_cover > 0
            && self.covered_share >= 1.0
            && self.missed_waypoints
                + self.repeated_waypoints
                + self.broken_routes
                + self.legs_in_no_fly_zones
                == 0
            && self.heights.as_ref().is_none_or(HeightFindings::is_clean)
    }
}

/// Checks the flights of a coverage plan.
pub fn check_plan(planned: &CoveragePlan<'_>) -> CoverageFindings {
    let flights: Vec<_> = planned.flights();
    check_flights(planned, &flights_to_check(planned, &flights))
}

/// Pairs each planned flight with the id of its vehicle, as [`check_flights`] needs it.
pub fn flights_to_check<'f>(
    planned: &CoveragePlan<'_>,
    flights: &'f [SortieFlight],
) -> Vec<TimedFlight<'f>> {
    let flown = |(sortie, points, times_s): &'f SortieFlight| {
        let vehicle = planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)].id;
        TimedFlight { vehicle, points, times_s }
    };
    flights.iter().map(flown).collect()
}

/// Checks the waypoints, no-fly zones, heights and pictures of flights.
pub fn check_flights(planned: &CoveragePlan<'_>, flights: &[TimedFlight<'_>]) -> CoverageFindings {
    let mut findings = CoverageFindings::default();
    count_waypoint_faults(planned, flights, &mut findings);
    for flight in flights {
        let enters = |pair: &&[FlightPoint]| {
            does_leg_enter_zone(planned, &pair[0].position.xy(), &pair[1].position.xy())
        };
        findings.legs_in_no_fly_zones += flight.points.windows(2).filter(enters).count() as u64;
    }
    findings.heights = heights::check_heights(planned, flights);
    CoverageCells::refined_until_a_cell_counts(planned).count_photographed_cells(
        planned,
        planned_pictures(planned, flights),
        &mut findings,
    );
    findings
}

/// Pictures at the photo points of planned flights, each with the lanes' direction as its heading.
pub fn planned_pictures(planned: &CoveragePlan<'_>, flights: &[TimedFlight<'_>]) -> Vec<Picture> {
    let along = planned.tracks.lane_direction();
    let heading = along.y.atan2(along.x);
    let taken = |flight: &TimedFlight<'_>| {
        let vehicle = Some(flight.vehicle);
        let points = flight.points.iter().zip(flight.times_s);
        let photos = points.filter(|(point, _)| matches!(point.action, WaypointAction::Photo(_)));
        let taken = photos.map(|(point, &t_s)| Picture {
            vehicle,
            t_s,
            position: point.position,
            yaw_enu_rad: heading,
        });
        taken.collect::<Vec<_>>()
    };
    flights.iter().flat_map(taken).collect()
}

/// Checks pictures that were taken in a flight, by the true position of the camera. The findings
/// have the numbers of waypoints without a picture and of those flown twice too ([`taken`]).
pub fn check_pictures(planned: &CoveragePlan<'_>, pictures: Vec<Picture>) -> CoverageFindings {
    let (left, twice) = taken::count_missed_and_repeated(planned, &pictures);
    let mut findings = CoverageFindings {
        photos: pictures.len() as u64,
        missed_waypoints: left,
        repeated_waypoints: twice,
        ..CoverageFindings::default()
    };
    CoverageCells::refined_until_a_cell_counts(planned).count_photographed_cells(
        planned,
        pictures,
        &mut findings,
    );
    findings
}

/// For each picture the four corners of the rectangle that it is counted to show, in order around
/// it, metres east and north: the picture's footprint on the ground, or, if that is rotated against
/// the lanes, a rectangle within it.
pub fn footprints(planned: &CoveragePlan<'_>, pictures: &[Picture]) -> Vec<[[f32; 2]; 4]> {
    let cells = CoverageCells::new(planned);
    pictures.iter().map(|picture| cells.footprint_corners(planned, picture)).collect()
}

/// Counts pictures, missed and repeated waypoints, and broken routes of planned flights.
fn count_waypoint_faults(
    planned: &CoveragePlan<'_>,
    flights: &[TimedFlight<'_>],
    findings: &mut CoverageFindings,
) {
    let mut times = vec![0u32; planned.tracks.waypoint_count() as usize];
    for flight in flights {
        let photos = flight.points.iter().filter_map(|point| match point.action {
            WaypointAction::Photo(number) => Some(number),
            _ => None,
        });
        let numbers: Vec<u32> = photos.collect();
        numbers.iter().for_each(|number| times[*number as usize] += 1);
        findings.photos += numbers.len() as u64;
        let step =
            |by: i64| numbers.windows(2).all(|pair| i64::from(pair[1]) - i64::from(pair[0]) == by);
        findings.broken_routes += u64::from(!step(1) && !step(-1));
    }
    findings.missed_waypoints = times.iter().filter(|times| **times == 0).count() as u64;
    findings.repeated_waypoints = times.iter().filter(|times| **times > 1).count() as u64;
}

/// Whether a straight leg enters a no-fly zone. The leg is split where it crosses edges of the
/// zone: it enters if the midpoint of a part lies inside.
fn does_leg_enter_zone(planned: &CoveragePlan<'_>, from: &Flat, to: &Flat) -> bool {
    let wide = |place: &Flat| [f64::from(place.x), f64::from(place.y)];
    let (a, b) = (wide(from), wide(to));
    planned.area_settings.rings_of(RingKind::NoFly).any(|ring| {
        let ring: Vec<[f64; 2]> = ring.iter().map(wide).collect();
        let mut shares = vec![0.0, 1.0];
        for (c, d) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let (rx, ry, sx, sy) = (b[0] - a[0], b[1] - a[1], d[0] - c[0], d[1] - c[1]);
            let cross = rx * sy - ry * sx;
            let share = ((c[0] - a[0]) * sy - (c[1] - a[1]) * sx) / cross;
            if share > 0.0 && share < 1.0 {
                shares.push(share);
            }
        }
        shares.sort_by(f64::total_cmp);
        shares.windows(2).filter(|pair| pair[1] - pair[0] > 1e-9).any(|pair| {
            let share = (pair[0] + pair[1]) / 2.0;
            ring_contains(&ring, [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share])
        })
    })
}

/// Whether a place is inside a ring, by the number of edges that a ray from it crosses.
fn ring_contains(ring: &[[f64; 2]], place: [f64; 2]) -> bool {
    let mut inside = false;
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        if (a[1] <= place[1]) != (b[1] <= place[1]) {
            inside ^= place[0] < a[0] + (place[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
        }
    }
    inside
}

/// A grid of square cells over the area, with axes along and across the lanes.
struct CoverageCells {
    /// Unit vector along the lanes, east and north.
    lane_direction: [f64; 2],
    /// Least corner of the grid, metres along and across the lanes from the mission's origin.
    low_corner: [f64; 2],
    /// Side of a cell, metres.
    side_m: f64,
    /// Numbers of columns (along the lanes) and of rows.
    column_row_counts: [usize; 2],
}

impl CoverageCells {
    /// The grid with cells of a tenth of the lane spacing, or larger, so that there are at most
    /// about [`MAX_CHECKED_CELLS`].
    fn new(planned: &CoveragePlan<'_>) -> Self {
        let along = planned.tracks.lane_direction();
        let along = [f64::from(along.x), f64::from(along.y)];
        let mut cells = Self {
            lane_direction: along,
            low_corner: [f64::INFINITY; 2],
            side_m: 0.0,
            column_row_counts: [0; 2],
        };
        let mut high = [f64::NEG_INFINITY; 2];
        for vertex in planned.area_settings.rings_of(RingKind::Outer).flatten() {
            let place = cells.to_lane_frame(vertex);
            for axis in 0..2 {
                cells.low_corner[axis] = cells.low_corner[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let [wide, tall] = [high[0] - cells.low_corner[0], high[1] - cells.low_corner[1]];
        let lane_m = f64::from(planned.area_settings.spacing.max_lane_spacing_m);
        cells.side_m = (lane_m / 10.0).max((wide * tall / MAX_CHECKED_CELLS).sqrt());
        cells.column_row_counts =
            [wide, tall].map(|side| (side / cells.side_m).ceil().max(1.0) as usize);
        cells
    }

    /// A grid whose cells are halved until at least one of them counts, so that an area narrower
    /// than a cell is checked too; never more than [`MAX_CHECKED_CELLS`] by halving.
    fn refined_until_a_cell_counts(planned: &CoveragePlan<'_>) -> Self {
        Self::new(planned).halved_until_one_counts(planned, MAX_CHECKED_CELLS)
    }

    /// The grid with its cells halved until the centre of one lies in the area and outside no-fly
    /// zones, or halving would give more than `most` cells.
    fn halved_until_one_counts(mut self, planned: &CoveragePlan<'_>, most: f64) -> Self {
        let fits = |[columns, rows]: [usize; 2]| (columns * rows) as f64 * 4.0 <= most;
        while !self.points_inside_area(planned, self.column_row_counts, 0.5).contains(&true)
            && fits(self.column_row_counts)
        {
            self.side_m /= 2.0;
            self.column_row_counts = self.column_row_counts.map(|count| 2 * count);
        }
        self
    }

    /// Coordinates of a place along and across the lanes, metres from the mission's origin.
    fn to_lane_frame(&self, place: &Flat) -> [f64; 2] {
        let (x, y) = (f64::from(place.x), f64::from(place.y));
        [
            x * self.lane_direction[0] + y * self.lane_direction[1],
            y * self.lane_direction[0] - x * self.lane_direction[1],
        ]
    }

    /// For each point of a grid, row by row: whether it lies in the area and outside no-fly zones.
    /// The points are the centres of the cells (`offset` 0.5), or their corners (`offset` 0, one
    /// more column and row).
    fn points_inside_area(
        &self,
        planned: &CoveragePlan<'_>,
        [columns, rows]: [usize; 2],
        offset: f64,
    ) -> Vec<bool> {
        let area = planned.area_settings;
        let rings = |kind| {
            let turned =
                |ring: &[Flat]| ring.iter().map(|v| self.to_lane_frame(v)).collect::<Vec<_>>();
            area.rings_of(kind).map(turned).collect::<Vec<_>>()
        };
        let wanted: Vec<_> =
            rings(RingKind::Outer).into_iter().chain(rings(RingKind::Hole)).collect();
        let zones = rings(RingKind::NoFly);
        let mut held = vec![false; columns * rows];
        for (row, line) in held.chunks_mut(columns).enumerate() {
            let at = [
                self.low_corner[0] + offset * self.side_m,
                self.low_corner[1] + (row as f64 + offset) * self.side_m,
            ];
            self.for_each_row_point_in_rings(line, &wanted, at, |place| *place = true);
            for zone in &zones {
                self.for_each_row_point_in_rings(line, std::slice::from_ref(zone), at, |place| {
                    *place = false;
                });
            }
        }
        held
    }

    /// Applies `to` to each point of a grid row that lies inside the rings by the even-odd rule;
    /// the row's first point is `at`.
    fn for_each_row_point_in_rings(
        &self,
        row: &mut [bool],
        rings: &[Vec<[f64; 2]>],
        at: [f64; 2],
        mut to: impl FnMut(&mut bool),
    ) {
        let v = at[1];
        let mut crossings = Vec::new();
        for ring in rings {
            for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                if (a[1] <= v) != (b[1] <= v) {
                    crossings.push(a[0] + (v - a[1]) * (b[0] - a[0]) / (b[1] - a[1]));
                }
            }
        }
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let index = |u: f64| ((u - at[0]) / self.side_m).ceil().max(0.0) as usize;
            let (from, end) = (index(pair[0]), index(pair[1]).min(row.len()));
            row.get_mut(from..end).into_iter().flatten().for_each(&mut to);
        }
    }

    /// Half the length of a picture's footprint along the lanes and across them, metres, at the
    /// camera's height above the ground. Of a picture that is rotated against the lanes: the
    /// largest rectangle of the same aspect ratio, parallel to the lanes, that lies within the
    /// footprint.
    fn half_footprint(&self, planned: &CoveragePlan<'_>, picture: &Picture) -> [f64; 2] {
        let (footprint, height_m) =
            (planned.area_settings.spacing.footprint, planned.area_settings.picture_height_m);
        let above_m =
            picture.position.z - planned.area_settings.ground_height_m(&picture.position.xy());
        let half = [f64::from(footprint.along_m) / 2.0, f64::from(footprint.across_m) / 2.0];
        let askew =
            f64::from(picture.yaw_enu_rad) - self.lane_direction[1].atan2(self.lane_direction[0]);
        let (cos, sin) = (askew.cos().abs(), askew.sin().abs());
        let fits = |own: f64, other: f64| own / (own * cos + other * sin);
        let share = fits(half[0], half[1]).min(fits(half[1], half[0])).min(1.0);
        half.map(|side| side * share * f64::from(above_m) / f64::from(height_m))
    }

    /// The four corners of the rectangle that a picture is counted to show, in order around it,
    /// metres east and north.
    fn footprint_corners(&self, planned: &CoveragePlan<'_>, picture: &Picture) -> [[f32; 2]; 4] {
        let ([u, v], [along, across]) =
            (self.to_lane_frame(&picture.position.xy()), self.half_footprint(planned, picture));
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[i, j]| {
            let (u, v) = (u + i * along, v + j * across);
            let [x, y] = self.lane_direction;
            [u * x - v * y, u * y + v * x].map(|metres| metres as f32)
        })
    }

    /// Writes to `findings` which cells count, how many of these the pictures show, and when.
    fn count_photographed_cells(
        &self,
        planned: &CoveragePlan<'_>,
        mut pictures: Vec<Picture>,
        findings: &mut CoverageFindings,
    ) {
        let spacing = planned.area_settings.spacing;
        let counted = self.points_inside_area(planned, self.column_row_counts, 0.5);
        // Whether neighbouring pictures overlap by a cell or more: then one picture must show all
        // corners of a cell.
        let whole = f64::from(spacing.footprint.across_m - spacing.max_lane_spacing_m)
            .min(f64::from(spacing.footprint.along_m - spacing.max_waypoint_spacing_m))
            >= self.side_m;
        pictures.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        let [columns, rows] = self.column_row_counts;
        // Otherwise corners outside the area are marked as shown; all other corners, and the cell's
        // centre, must be in some picture.
        let mut corners: Vec<bool> = match whole {
            true => vec![false; (columns + 1) * (rows + 1)],
            false => self
                .points_inside_area(planned, [columns + 1, rows + 1], 0.0)
                .iter()
                .map(|held| !held)
                .collect(),
        };
        let mut middles = vec![whole; counted.len()];
        let mut shown = vec![false; counted.len()];
        for picture in pictures {
            let (time, place) = (picture.t_s, self.to_lane_frame(&picture.position.xy()));
            let half = self.half_footprint(planned, &picture);
            // Range of cell corners in the picture; 1e-3 cell of tolerance absorbs rounding.
            let range = |axis: usize, most: usize| {
                let from = (place[axis] - half[axis] - self.low_corner[axis]) / self.side_m;
                let to = (place[axis] + half[axis] - self.low_corner[axis]) / self.side_m;
                let to = (to + 1e-3).floor().clamp(-1.0, most as f64);
                ((from - 1e-3).ceil().max(0.0) as i64, to as i64)
            };
            let ((c0, c1), (r0, r1)) = (range(0, columns), range(1, rows));
            for row in r0..=r1 {
                for column in c0..=c1 {
                    corners[row as usize * (columns + 1) + column as usize] = true;
                }
            }
            let middle_shown = |axis: usize, index: i64| {
                let middle = self.low_corner[axis] + (index as f64 + 0.5) * self.side_m;
                (middle - place[axis]).abs() <= half[axis]
            };
            // Cells that the picture shows whole; without `whole`, also those it shows in part.
            let more = i64::from(!whole);
            let mut new = 0;
            for row in (r0 - more).max(0)..(r1 + more).min(rows as i64) {
                for column in (c0 - more).max(0)..(c1 + more).min(columns as i64) {
                    let middle = middle_shown(0, column) && middle_shown(1, row);
                    let (row, column) = (row as usize, column as usize);
                    let corner =
                        |r: usize, c: usize| corners[(row + r) * (columns + 1) + column + c];
                    let all = corner(0, 0) && corner(0, 1) && corner(1, 0) && corner(1, 1);
                    let cell = row * columns + column;
                    middles[cell] |= middle;
                    if all && middles[cell] && counted[cell] && !shown[cell] {
                        shown[cell] = true;
                        new += 1;
                    }
                }
            }
            findings.new_cells_over_time.push((time, new));
        }
        findings.cell_m = self.side_m;
        findings.cells_to_cover = counted.iter().filter(|counted| **counted).count() as u64;
        let missing = counted.iter().zip(&shown).position(|(counted, shown)| *counted && !shown);
        findings.first_missing_cell_centre = missing.map(|cell| {
            let at = |axis: usize, index: usize| {
                self.low_corner[axis] + (index as f64 + 0.5) * self.side_m
            };
            let (u, v) = (at(0, cell % columns), at(1, cell / columns));
            [
                u * self.lane_direction[0] - v * self.lane_direction[1],
                u * self.lane_direction[1] + v * self.lane_direction[0],
            ]
        });
        let good =
            counted.iter().zip(&shown).filter(|(counted, shown)| **counted && **shown).count();
        findings.covered_share = if findings.cells_to_cover == 0 {
            0.0
        } else {
            good as f64 / findings.cells_to_cover as f64
        };
    }
}

#[cfg(test)]
mod tests;
