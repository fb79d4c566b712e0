//! Flights in the formats of ground stations: QGroundControl `.plan`, `.waypoints` (QGC WPL 110),
//! CSV and GeoJSON.
//!
//! A flight consists of NAV_DELAY (93) if the vehicle departs later than others, NAV_TAKEOFF (22),
//! DO_CHANGE_SPEED (178), NAV_WAYPOINT (16) with the camera's trigger, and NAV_RETURN_TO_LAUNCH
//! (20) above the pad. Altitudes are relative to the vehicle's home (frame 3), so that errors of
//! maps and geoid cancel; over terrain too, since home and ground have heights of the same map.
//! With trigger by distance only the two ends of a lane become waypoints.

use planner_core::Point;
use planner_core::coverage::area::RingKind;
use planner_core::coverage::pack::Route;
use planner_core::geo::frames::Geodetic;
use serde_json::{Value, json};

use super::flight::{FlightPoint, WaypointAction, course_deg};
use super::sorties::Sortie;
use super::{CoveragePlan, SortieFlight};
use crate::scenario::AutopilotKind;
use crate::scenario::coverage::{HeadingRule, Trigger};

/// `MAV_CMD` number of NAV_WAYPOINT.
const NAV_WAYPOINT: u16 = 16;
/// `MAV_CMD` number of NAV_RETURN_TO_LAUNCH.
const NAV_RETURN_TO_LAUNCH: u16 = 20;
/// `MAV_CMD` number of NAV_TAKEOFF.
const NAV_TAKEOFF: u16 = 22;
/// `MAV_CMD` number of NAV_DELAY.
const NAV_DELAY: u16 = 93;
/// `MAV_CMD` number of DO_CHANGE_SPEED.
const DO_CHANGE_SPEED: u16 = 178;
/// `MAV_CMD` number of DO_DIGICAM_CONTROL.
const DO_DIGICAM_CONTROL: u16 = 203;
/// `MAV_CMD` number of DO_SET_CAM_TRIGG_DIST.
const DO_SET_CAM_TRIGG_DIST: u16 = 206;
/// MAV_FRAME_GLOBAL_RELATIVE_ALT: frame of a mission item that has a position.
const FRAME_RELATIVE: u8 = 3;
/// MAV_FRAME_MISSION: frame of a mission item without a position.
const FRAME_MISSION: u8 = 2;

/// One MAVLink mission item.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedItem {
    /// Command: a MAV_CMD number.
    pub command: u16,
    /// Coordinate frame: a MAV_FRAME number.
    pub frame: u8,
    /// Parameters 1 to 4. `None` becomes null (NaN: the current value) in `.plan`, and 0 in
    /// `.waypoints`.
    pub params_1_to_4: [Option<f64>; 4],
    /// Latitude and longitude, degrees, and metres above home. If the item has no position: zeros,
    /// but the first number may be another parameter 5 of the command.
    pub params_5_to_7: [f64; 3],
}

impl ExportedItem {
    /// An item without a position; `params` are parameters 1 to 4.
    fn from_command(command: u16, params: [f64; 4]) -> Self {
        Self {
            command,
            frame: FRAME_MISSION,
            params_1_to_4: params.map(Some),
            params_5_to_7: [0.0; 3],
        }
    }
}

/// Home position of a route's vehicle, WGS84: its pad in the scenario, with the pad's altitude.
fn home_position(planned: &CoveragePlan<'_>, route: &Route) -> Geodetic {
    let start = planned.scenario.vehicles[usize::from(route.vehicle_index)].start;
    Geodetic {
        alt_m: planned.area_settings.origin.alt_m + f64::from(start.z),
        ..planned.geodetic_at_origin_altitude(&start)
    }
}

/// Yaw commanded at point `index`, degrees clockwise from north, rounded to 0.01: the lanes' common
/// direction, or, with [`HeadingRule::DirectionOfFlight`], the direction of flight along the
/// point's lane.
fn yaw_deg(planned: &CoveragePlan<'_>, points: &[FlightPoint], index: usize) -> f64 {
    let along = planned.tracks.lane_direction();
    let sweep = course_deg(&Point::zeros(), &Point::new(along.x, along.y, 0.0));
    let own = points[index].lane;
    let neighbours = [index.checked_sub(1).map(|i| (i, index)), Some((index, index + 1))];
    let step = neighbours.into_iter().flatten().find_map(|(a, b)| {
        let (from, to) = (points.get(a)?, points.get(b)?);
        let apart = (to.position - from.position).xy().norm() > 1e-3;
        (apart && own.is_some() && from.lane == own && to.lane == own)
            .then(|| course_deg(&from.position, &to.position))
    });
    let yaw = match planned.area_settings.heading {
        HeadingRule::SameOnAllLanes => sweep,
        HeadingRule::DirectionOfFlight => step.unwrap_or(sweep),
    };
    f64::from((yaw * 100.0).round() / 100.0)
}

/// All mission items of one flight, from its delay and take-off to the return.
pub fn flight_items(
    planned: &CoveragePlan<'_>,
    sortie: &Sortie,
    points: &[FlightPoint],
) -> Vec<ExportedItem> {
    let (scenario, route) = (planned.scenario, &sortie.route);
    let home = home_position(planned, route);
    let start = scenario.vehicles[usize::from(route.vehicle_index)].start;
    let place = |position: &Point| {
        let place = planned.geodetic_at_origin_altitude(position);
        [
            round_to_parts(place.lat_deg, 1e9),
            round_to_parts(place.lon_deg, 1e9),
            round_to_parts(f64::from(position.z - start.z), 1e3),
        ]
    };
    let waypoint = |index: usize| ExportedItem {
        command: NAV_WAYPOINT,
        frame: FRAME_RELATIVE,
        params_1_to_4: [Some(0.0), Some(0.0), Some(0.0), Some(yaw_deg(planned, points, index))],
        params_5_to_7: place(&points[index].position),
    };
    let speed = f64::from(planned.vehicles[usize::from(route.vehicle_index)].cruise_mps);
    let top = points.get(1).map_or(0.0, |point| f64::from(point.position.z - start.z));
    let mut items = Vec::new();
    if sortie.departure_delay_s > 0.0 {
        items.push(ExportedItem::from_command(
            NAV_DELAY,
            [f64::from(sortie.departure_delay_s), -1.0, -1.0, -1.0],
        ));
    }
    items.extend([
        ExportedItem {
            command: NAV_TAKEOFF,
            frame: FRAME_RELATIVE,
            params_1_to_4: [Some(0.0), Some(0.0), Some(0.0), None],
            params_5_to_7: [
                round_to_parts(home.lat_deg, 1e9),
                round_to_parts(home.lon_deg, 1e9),
                round_to_parts(top, 1e3),
            ],
        },
        ExportedItem::from_command(DO_CHANGE_SPEED, [1.0, round_to_parts(speed, 1e3), -1.0, 0.0]),
    ]);
    for (index, point) in points.iter().enumerate().skip(2) {
        let lane_at = |i: Option<usize>| i.and_then(|i| points.get(i)).and_then(|point| point.lane);
        let begins = point.lane.is_some() && lane_at(index.checked_sub(1)) != point.lane;
        let ends = point.lane.is_some() && lane_at(Some(index + 1)) != point.lane;
        match (point.action, planned.area_settings.trigger) {
            (WaypointAction::OnPad, _) => {
                items.push(ExportedItem::from_command(NAV_RETURN_TO_LAUNCH, [0.0; 4]));
            }
            (WaypointAction::Photo(_), Trigger::Waypoint) => {
                items.push(waypoint(index));
                items.push(ExportedItem::from_command(DO_DIGICAM_CONTROL, [0.0; 4]));
                // Parameter 5 of DO_DIGICAM_CONTROL is 1: take a picture.
                if let Some(last) = items.last_mut() {
                    last.params_5_to_7[0] = 1.0;
                }
            }
            (WaypointAction::Photo(_), trigger) => {
                if begins || ends {
                    items.push(waypoint(index));
                }
                if trigger == Trigger::Distance && begins && !ends {
                    let mut later =
                        points[index + 1..].iter().take_while(|next| next.lane == point.lane);
                    let next = later.find(|next| matches!(next.action, WaypointAction::Photo(_)));
                    let step = next
                        .map_or(planned.area_settings.spacing.max_waypoint_spacing_m, |next| {
                            (next.position - point.position).xy().norm()
                        });
                    // Takes a picture at once, then one each `step` metres.
                    let trigger = [round_to_parts(f64::from(step), 1e3), 0.0, 1.0, 0.0];
                    items.push(ExportedItem::from_command(DO_SET_CAM_TRIGG_DIST, trigger));
                }
                if trigger == Trigger::Distance && ends {
                    // Takes the last picture at once and stops the trigger. Autopilots check the
                    // distance some times a second, so pictures are a little further apart than
                    // `step`, and the last one would otherwise lie beyond the lane's end.
                    items.push(ExportedItem::from_command(
                        DO_SET_CAM_TRIGG_DIST,
                        [0.0, 0.0, 1.0, 0.0],
                    ));
                }
            }
            (WaypointAction::Transit | WaypointAction::AtLaneHeight, _) => {
                items.push(waypoint(index));
            }
        }
    }
    items
}

/// Rounds to the nearest multiple of 1 / `by`.
fn round_to_parts(value: f64, by: f64) -> f64 {
    (value * by).round() / by
}

/// The mission of one flight as a QGroundControl `.plan` document (JSON).
pub fn qgc_plan(planned: &CoveragePlan<'_>, route: &Route, items: &[ExportedItem]) -> Value {
    let home = home_position(planned, route);
    let vehicle = &planned.scenario.vehicles[usize::from(route.vehicle_index)];
    let item = |(index, item): (usize, &ExportedItem)| {
        let mut params: Vec<Value> =
            item.params_1_to_4.iter().map(|p| p.map_or(Value::Null, Value::from)).collect();
        params.extend(item.params_5_to_7.map(Value::from));
        let mut value = json!({
            "autoContinue": true,
            "command": item.command,
            "doJumpId": index + 1,
            "frame": item.frame,
            "params": params,
            "type": "SimpleItem",
        });
        if item.frame == FRAME_RELATIVE {
            value["AMSLAltAboveTerrain"] = Value::Null;
            value["Altitude"] = json!(item.params_5_to_7[2]);
            value["AltitudeMode"] = json!(1);
        }
        value
    };
    let firmware = match vehicle.autopilot {
        AutopilotKind::Px4 => 12,
        AutopilotKind::ArduPilot => 3,
    };
    let speed = planned.vehicles[usize::from(route.vehicle_index)].cruise_mps;
    json!({
        "fileType": "Plan",
        "geoFence": { "circles": [], "polygons": [], "version": 2 },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed,
            "firmwareType": firmware,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": speed,
            "items": items.iter().enumerate().map(item).collect::<Vec<_>>(),
            "plannedHomePosition": [
                round_to_parts(home.lat_deg, 1e9),
                round_to_parts(home.lon_deg, 1e9),
                round_to_parts(home.alt_m, 1e3),
            ],
            "vehicleType": 2,
            "version": 2,
        },
        "rallyPoints": { "points": [], "version": 2 },
        "version": 1,
    })
}

/// The mission of one flight as `.waypoints` text: one item a line, home first.
pub fn waypoints_file(planned: &CoveragePlan<'_>, route: &Route, items: &[ExportedItem]) -> String {
    let home = home_position(planned, route);
    let mut text = "QGC WPL 110\n".to_owned();
    let mut line =
        |index: usize, current: u8, frame: u8, command: u16, params: [f64; 4], place: [f64; 3]| {
            let numbers: Vec<String> = params.iter().map(|p| format!("{p:.8}")).collect();
            let [lat, lon, alt] = place;
            text += &format!(
                "{index}\t{current}\t{frame}\t{command}\t{}\t{lat:.9}\t{lon:.9}\t{alt:.6}\t1\n",
                numbers.join("\t")
            );
        };
    line(0, 1, 0, NAV_WAYPOINT, [0.0; 4], [home.lat_deg, home.lon_deg, home.alt_m]);
    for (index, item) in items.iter().enumerate() {
        line(
            index + 1,
            0,
            item.frame,
            item.command,
            item.params_1_to_4.map(|p| p.unwrap_or(0.0)),
            item.params_5_to_7,
        );
    }
    text
}

/// A CSV table with every point of every flight: vehicle, order, time, action, waypoint number
/// where a picture is taken, WGS84 and ENU position, sortie, and height of the ground there.
pub fn flights_csv(planned: &CoveragePlan<'_>, flights: &[SortieFlight]) -> String {
    let mut text =
        "vehicle,order,time_s,act,waypoint,lat_deg,lon_deg,east_m,north_m,up_m,sortie,ground_m\n"
            .to_owned();
    for (sortie, points, times) in flights {
        let id = planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)].id;
        for (order, (point, time)) in points.iter().zip(times).enumerate() {
            let (act, number) = match point.action {
                WaypointAction::OnPad => ("pad", String::new()),
                WaypointAction::Transit => ("transit", String::new()),
                WaypointAction::AtLaneHeight => ("lane", String::new()),
                WaypointAction::Photo(number) => ("photo", number.to_string()),
            };
            let p = point.position;
            let place = planned.geodetic_at_origin_altitude(&p);
            text += &format!(
                "{id},{order},{time:.2},{act},{number},{:.9},{:.9},{:.3},{:.3},{:.3},{},{:.3}\n",
                place.lat_deg,
                place.lon_deg,
                p.x,
                p.y,
                p.z,
                sortie.number,
                planned.area_settings.ground_height_m(&p.xy())
            );
        }
    }
    text
}

/// GeoJSON features: the rings of the area, its holes and no-fly zones, and a line along the lanes
/// of each flight.
pub fn area_geojson(planned: &CoveragePlan<'_>, flights: &[SortieFlight]) -> Value {
    let place = |x: f32, y: f32| {
        let place = planned.geodetic_at_origin_altitude(&Point::new(x, y, 0.0));
        json!([round_to_parts(place.lon_deg, 1e9), round_to_parts(place.lat_deg, 1e9)])
    };
    let kinds = [(RingKind::Outer, "area"), (RingKind::Hole, "hole"), (RingKind::NoFly, "no-fly")];
    let mut features = Vec::new();
    for (kind, name) in kinds {
        for ring in planned.area_settings.rings_of(kind) {
            let mut places: Vec<Value> = ring.iter().map(|v| place(v.x, v.y)).collect();
            places.extend(places.first().cloned());
            features.push(json!({
                "type": "Feature",
                "properties": { "kind": name },
                "geometry": { "type": "Polygon", "coordinates": [places] },
            }));
        }
    }
    for (sortie, points, _) in flights {
        let photos = points.iter().filter(|point| {
            matches!(point.action, WaypointAction::Photo(_) | WaypointAction::AtLaneHeight)
        });
        let places: Vec<Value> =
            photos.map(|point| place(point.position.x, point.position.y)).collect();
        let geometry = match places.as_slice() {
            [one] => json!({ "type": "Point", "coordinates": one }),
            all => json!({ "type": "LineString", "coordinates": all }),
        };
        features.push(json!({
            "type": "Feature",
            "properties": {
                "kind": "route",
                "vehicle": planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)].id,
                "sortie": sortie.number,
            },
            "geometry": geometry,
        }));
    }
    json!({ "type": "FeatureCollection", "features": features })
}
