//! The autopilot's frame about random EKF origins: a place of the mission converted to it and back
//! stays the same, or the origin is not used.

extern crate std;

use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::link::frame::{self, Framer, Header, MAX_FRAME_LEN};

/// A frame of the autopilot.
fn frame<M: MessageData>(message: &M, sequence: u8) -> Frame {
    let mut out = [0; MAX_FRAME_LEN];
    let header = Header { system: 1, component: crate::AUTOPILOT_COMPONENT, sequence };
    let length = frame::encode(header, message, &mut out);
    let mut input = &out[..length];
    Framer::new().next(Instant::ZERO, &mut input).expect("a whole frame")
}

fn heard(
    kind: AutopilotKind,
    origin: Geodetic,
    latitude: i32,
    longitude: i32,
    altitude: i32,
) -> (Telemetry, TelemetryChange) {
    let mut telemetry = Telemetry { kind: Some(kind), ..Telemetry::new(OriginRange::NearMission) };
    let data = GPS_GLOBAL_ORIGIN_DATA { latitude, longitude, altitude };
    let change = telemetry.handle_frame(Instant::ZERO, &origin, &frame(&data, 0));
    (telemetry, change)
}

/// Greatest distance, metres, from a place to where the autopilot finds it from the NED setpoint;
/// `None` without an EKF origin.
fn worst_m(
    telemetry: &Telemetry,
    kind: AutopilotKind,
    origin: &Geodetic,
    places: &[Point],
) -> Option<f64> {
    let ekf_origin = telemetry.ekf_origin?;
    let off = places.iter().map(|place| {
        let ned = telemetry.to_ned(origin, place).expect("an origin is known").cast::<f64>();
        let sent = frames::ned_to_geodetic(kind.projection(), &ekf_origin, &ned);
        f64::from((frames::geodetic_to_enu(origin, &sent) - place).norm())
    });
    Some(off.fold(0.0, f64::max))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn a_setpoint_survives_the_autopilots_frame_or_its_origin_is_refused(
        mission in (-80.0f64..80.0, -180.0f64..180.0, -100.0f64..4000.0),
        away in (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0),
        range_m in prop_oneof![Just(1e2), Just(1e4), Just(1e5), Just(1e6), Just(2e7)],
        places in proptest::collection::vec((-80.0f32..80.0, -80.0f32..80.0, -10.0f32..60.0), 1..8),
        px4 in any::<bool>(),
    ) {
        let kind = if px4 { AutopilotKind::Px4 } else { AutopilotKind::ArduPilot };
        let origin = Geodetic { lat_deg: mission.0, lon_deg: mission.1, alt_m: mission.2 };
        let degrees = range_m / 111_000.0;
        let latitude = ((mission.0 + away.0 * degrees).clamp(-90.0, 90.0) * 1e7) as i32;
        let longitude = ((mission.1 + away.1 * degrees).clamp(-180.0, 180.0) * 1e7) as i32;
        let altitude = ((mission.2 + away.2 * range_m) * 1e3) as i32;
        let (telemetry, change) = heard(kind, origin, latitude, longitude, altitude);
        let places: Vec<Point> = places.iter().map(|(x, y, z)| Point::new(*x, *y, *z)).collect();
        match worst_m(&telemetry, kind, &origin, &places) {
            // As much as the geofence leaves for it.
            Some(off_m) => prop_assert!(off_m < 2e-3, "{off_m} m off"),
            None => {
                prop_assert!(matches!(change, TelemetryChange::OriginFar(_)), "{change:?}");
                prop_assert!(range_m > 1e4, "refused although near");
            }
        }
    }
}

#[test]
fn a_far_origin_takes_the_place_of_none_in_flight_and_leaves_none_on_the_ground() {
    let origin = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 };
    let near = (400_000_000, -30_000_000, 700_000);
    for armed in [false, true] {
        let (mut telemetry, _) = heard(AutopilotKind::Px4, origin, near.0, near.1, near.2);
        telemetry.armed = armed;
        telemetry.update_origin_trust();
        let far =
            GPS_GLOBAL_ORIGIN_DATA { latitude: 410_000_000, longitude: near.1, altitude: near.2 };
        let change = telemetry.handle_frame(Instant::ZERO, &origin, &frame(&far, 1));
        match armed {
            true => {
                assert_eq!(
                    (change, telemetry.ekf_origin.is_some()),
                    (TelemetryChange::OriginDoubted, true)
                );
            }
            false => {
                assert_eq!((change, telemetry.ekf_origin), (TelemetryChange::OriginFar(111), None));
            }
        }
    }
}
