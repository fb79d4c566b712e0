//! Reads point clouds (LAS, LAZ): each cell of the grid gets the highest return in it.
//!
//! Cells are so large that they hold four returns on average, so that few are empty; an empty cell
//! between cells with heights gets the highest height near it. Returns classified as noise do not
//! count, nor do those flagged as withheld: their producer deleted them.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use las::point::Classification;
use las::{Header, PointDataBuilder, Reader};
use planner_core::coverage::Flat;

use super::crs::{CoordinateSystem, Crs, wkt_height_unit_m};
use super::error::TerrainError;
use super::frame::{TerrainFrame, widened_window};
use super::geokeys::GeoKeys;
use super::grid::HeightGrid;
use super::limits::MAX_BYTES;
use super::{declared_sizes, guard};
use crate::files;

/// Name of the format in errors.
const FORMAT: &str = "a point cloud";
/// Mean number of returns in a cell, from which the cell's side follows.
const RETURNS_PER_CELL: f64 = 4.0;
/// Least side of a cell of the grid, metres.
const MIN_CLOUD_CELL_M: f64 = 0.5;
/// An empty cell is filled if cells on both sides in its row or column, at most this many cells
/// away, have heights.
const MAX_BRIDGED_CELLS: usize = 3;
/// Number of returns decoded at a time.
const RETURNS_PER_BATCH: u64 = 4096;
/// Classes of returns that are measurement errors.
const NOISE_CLASSES: [Classification; 2] = [Classification::LowPoint, Classification::HighNoise];

/// Reads the ground's heights from a LAS or LAZ file.
pub(super) fn read(path: &Path, frame: &TerrainFrame<'_>) -> Result<HeightGrid, TerrainError> {
    let length = files::regular_file_len(path)?;
    if length > MAX_BYTES {
        return Err(TerrainError::TooLong(length));
    }
    decode(BufReader::new(File::open(path)?), frame)
}

/// The error for a file that is no sound point cloud.
fn malformed(why: &impl ToString) -> TerrainError {
    TerrainError::malformed(FORMAT, why)
}

/// As [`read`], from an open file.
pub(super) fn decode<R>(mut file: R, frame: &TerrainFrame<'_>) -> Result<HeightGrid, TerrainError>
where
    R: Read + Seek + Send + Sync + 'static,
{
    declared_sizes::check_declared_sizes(&mut file)?.map_err(|why| malformed(&why))?;
    let decoded = guard::catch_panic(|| grid_of_returns(file, frame));
    decoded.unwrap_or_else(|| Err(malformed(&"its returns are damaged")))
}

/// Puts the returns of a cloud into a grid; the decoder may panic.
fn grid_of_returns<R>(file: R, frame: &TerrainFrame<'_>) -> Result<HeightGrid, TerrainError>
where
    R: Read + Seek + Send + Sync + 'static,
{
    let mut reader = Reader::new(file).map_err(|error| malformed(&error))?;
    let (crs, unit_m) = crs_and_height_unit_m(reader.header())?;
    crs.check_usable(frame.without_crs)?;
    let mut grid = empty_grid(reader.header(), &crs, frame)?;
    let mut points = PointDataBuilder::new().for_header(reader.header()).build();
    let most = reader.header().number_of_points();
    let mut count = 0;
    while count < most {
        let read = reader
            .fill_points(RETURNS_PER_BATCH.min(most - count), &mut points)
            .map_err(|error| malformed(&error))?;
        if read == 0 {
            return Err(malformed(&format!("it has {count} returns, its header says {most}")));
        }
        count += read;
        for point in points.points() {
            let point = point.map_err(|error| malformed(&error))?;
            let deleted = point.is_withheld || NOISE_CLASSES.contains(&point.classification);
            if deleted || !point.z.is_finite() {
                continue;
            }
            if let Some(place) = crs.to_mission_frame(frame.origin, [point.x, point.y]) {
                grid.raise_cell(&place, (point.z * unit_m) as f32);
            }
        }
    }
    grid.fill_holes(MAX_BRIDGED_CELLS);
    Ok(grid)
}

/// The cloud's coordinate system, and metres in its unit of height: without a unit of their own,
/// heights are in the unit of the coordinates.
fn crs_and_height_unit_m(header: &Header) -> Result<(Crs, f64), TerrainError> {
    let record = |id: u16| {
        let found = header
            .all_vlrs()
            .find(|vlr| vlr.user_id.starts_with("LASF_Projection") && vlr.record_id == id);
        found.map(|vlr| &vlr.data[..])
    };
    let text =
        record(2112).map(|bytes| String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned());
    let directory =
        record(34735).unwrap_or_default().chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let keys = GeoKeys::new(&directory.collect::<Vec<_>>());
    let crs = match (&text, header.has_wkt_crs()) {
        (Some(text), true) => Crs::Stated(Box::new(CoordinateSystem::wkt(text)?)),
        _ => keys.crs(text.as_deref())?,
    };
    let said = match text.as_deref().and_then(wkt_height_unit_m) {
        Some(unit_m) => Some(unit_m),
        None => keys.height_unit_m()?,
    };
    let unit_m = said.unwrap_or(crs.default_height_unit_m());
    if !(1e-3..=1e3).contains(&unit_m) {
        return Err(TerrainError::unusable_crs("heights in a unit of no length"));
    }
    Ok((crs, unit_m))
}

/// An empty grid over the cloud's extent, or over the frame's window.
fn empty_grid(
    header: &Header,
    crs: &Crs,
    frame: &TerrainFrame<'_>,
) -> Result<HeightGrid, TerrainError> {
    let bounds = header.bounds();
    let (low, high) = ([bounds.min.x, bounds.min.y], [bounds.max.x, bounds.max.y]);
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let corners = corners.iter().filter_map(|corner| crs.to_mission_frame(frame.origin, *corner));
    let whole =
        corners.map(|place| [place, place]).reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
    let count = header.number_of_points();
    let Some([low, high]) = whole.filter(|_| count > 0) else {
        return HeightGrid::new([Flat::zeros(); 2], 1.0);
    };
    let sides = high - low;
    let cell_m = (f64::from(sides.x) * f64::from(sides.y) * RETURNS_PER_CELL / count as f64)
        .sqrt()
        .max(MIN_CLOUD_CELL_M);
    let cell_m = cell_m as f32;
    // Half a cell more on each side, so that the last return is in a cell too.
    let half = Flat::repeat(cell_m / 2.0);
    let window =
        frame.window.map_or([low - half, high + half], |window| widened_window(window, cell_m));
    HeightGrid::new(window, cell_m)
}
