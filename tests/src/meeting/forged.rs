//! Forges the messages of a vehicle that lies in its reports.

use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::link::intent::Intent;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{GLOBAL_POSITION_INT_DATA, TUNNEL_DATA};
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames::{self, Geodetic};

use super::packet::ORIGIN;
use super::scene::Lie;

/// Position and velocity of a report, ENU metres and m/s.
pub(super) fn reported_position_and_velocity(data: &GLOBAL_POSITION_INT_DATA) -> (Point, Point) {
    let place = Geodetic {
        lat_deg: f64::from(data.lat) * 1e-7,
        lon_deg: f64::from(data.lon) * 1e-7,
        alt_m: f64::from(data.alt) * 1e-3,
    };
    let cm = Vector3::new(f32::from(data.vx), f32::from(data.vy), f32::from(data.vz));
    (frames::geodetic_to_enu(&ORIGIN, &place), frames::swap_enu_ned(&(cm * 0.01)))
}

/// The frame with the lie in its data; `None` if the lie is about other data.
pub(super) fn forge_report(frame: &frame::Frame, lie: Lie) -> Option<Vec<u8>> {
    let header =
        Header { system: frame.system, component: frame.component, sequence: frame.sequence };
    let mut out = [0; MAX_FRAME_LEN];
    if let Some(mut data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
        let (mut place, mut velocity) = reported_position_and_velocity(&data);
        match lie {
            Lie::Position(off) => place += off,
            Lie::Velocity(off) => velocity += off,
            Lie::Still => velocity = Point::zeros(),
            Lie::Progress(_) | Lie::Points(_) => return None,
        }
        let wrong = frames::enu_to_geodetic(&ORIGIN, &place);
        data.lat = (wrong.lat_deg * 1e7).round() as i32;
        data.lon = (wrong.lon_deg * 1e7).round() as i32;
        data.alt = (wrong.alt_m * 1e3).round() as i32;
        let cm = frames::swap_enu_ned(&velocity) * 100.0;
        (data.vx, data.vy, data.vz) = (cm.x as i16, cm.y as i16, cm.z as i16);
        let length = frame::encode(header, &data, &mut out);
        return Some(out[..length].to_vec());
    }
    if frame.message_id != TUNNEL_DATA::ID {
        return None;
    }
    let mut intent = Intent::decode(frame.padded_payload(), frame.system)?;
    match lie {
        Lie::Progress(ahead_m) => intent.progress_m += ahead_m,
        Lie::Points(off) => intent.points.iter_mut().for_each(|point| *point += off),
        _ => return None,
    }
    let mut payload = [0; 133];
    let length = intent.encode(&mut payload);
    let length = frame::encode_raw(
        header,
        TUNNEL_DATA::ID,
        TUNNEL_DATA::EXTRA_CRC,
        &payload[..length],
        &mut out,
    );
    Some(out[..length].to_vec())
}
