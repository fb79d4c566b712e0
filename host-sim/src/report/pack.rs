//! Serializes long arrays as base64 of little-endian numbers: a third of the size of decimal text,
//! and decoded to a typed array in the page.
//!
//! Points are `x y z` as f32, track points `t x y z` as f32, footprints `t vehicle` and four `x y`
//! as f32, edges two u16. `decode` in `data.js` reads them.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use planner_core::Point;
use serde::{Serialize, Serializer};

use super::track::{PictureFootprint, TrackPoint};

/// Writes bytes as a Base64 string.
fn base64<S: Serializer>(
    bytes: impl Iterator<Item = u8>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&STANDARD.encode(bytes.collect::<Vec<u8>>()))
}

/// Writes little-endian f32 as Base64.
pub(super) fn floats<S: Serializer>(values: &[f32], serializer: S) -> Result<S::Ok, S::Error> {
    base64(values.iter().flat_map(|v| v.to_le_bytes()), serializer)
}

/// Writes little-endian u16 as Base64.
pub(super) fn words<S: Serializer>(values: &[u16], serializer: S) -> Result<S::Ok, S::Error> {
    base64(values.iter().flat_map(|v| v.to_le_bytes()), serializer)
}

/// Writes x, y and z of each point as [`floats`].
pub(super) fn points<S: Serializer>(points: &[Point], serializer: S) -> Result<S::Ok, S::Error> {
    base64(points.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f32::to_le_bytes), serializer)
}

/// Writes both numbers of each pair as [`words`].
pub(super) fn pairs<S: Serializer>(pairs: &[[u16; 2]], serializer: S) -> Result<S::Ok, S::Error> {
    base64(pairs.iter().flatten().flat_map(|v| v.to_le_bytes()), serializer)
}

/// Writes time, x, y and z of each point as [`floats`].
pub(super) fn track<S: Serializer>(track: &[TrackPoint], serializer: S) -> Result<S::Ok, S::Error> {
    let floats = track.iter().flat_map(|p| [p.t_s, p.position.x, p.position.y, p.position.z]);
    base64(floats.flat_map(f32::to_le_bytes), serializer)
}

/// Writes the numbers of each footprint as [`floats`].
pub(super) fn footprints<S: Serializer>(
    all: &[PictureFootprint],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let floats = all.iter().flat_map(|f| {
        let corners = f.corners.as_flattened().iter().copied();
        [f.t_s, f32::from(f.vehicle)].into_iter().chain(corners)
    });
    base64(floats.flat_map(f32::to_le_bytes), serializer)
}

/// Writes a point as a list of x, y and z.
pub(super) fn point<S: Serializer>(p: &Point, serializer: S) -> Result<S::Ok, S::Error> {
    [p.x, p.y, p.z].serialize(serializer)
}

/// As [`point`]; `null` for none.
pub(super) fn maybe_point<S: Serializer>(
    p: &Option<Point>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    p.map(|p| [p.x, p.y, p.z]).serialize(serializer)
}

#[cfg(test)]
mod tests;
