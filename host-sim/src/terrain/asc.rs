//! Reads ESRI ASCII grids: a header, then heights row by row from the north. The format states no
//! units: heights are metres. A `.prj` file beside the grid has its coordinate system.

use std::iter::Peekable;
use std::path::Path;

use super::crs::{CoordinateSystem, Crs};
use super::error::TerrainError;
use super::limits::{MAX_BYTES, MAX_CELLS};
use super::raster::Raster;
use crate::files;

/// Name of the format in errors.
const FORMAT: &str = "an ESRI grid";

/// Reads an ASCII grid file.
pub(super) fn read(path: &Path) -> Result<Raster, TerrainError> {
    let length = files::regular_file_len(path)?;
    if length > MAX_BYTES {
        return Err(TerrainError::TooLong(length));
    }
    let text = String::from_utf8(files::read(path, MAX_BYTES)?);
    let text = text.map_err(|_| TerrainError::malformed(FORMAT, &"it is not text"))?;
    let beside = path.with_extension("prj");
    let crs = match beside.is_file() {
        true => parse_coordinate_system(&files::read_text(&beside)?)?,
        false => Crs::Unstated,
    };
    parse(&text, crs)
}

/// The coordinate system of a `.prj` file; units other than metres and degrees are refused.
fn parse_coordinate_system(text: &str) -> Result<Crs, TerrainError> {
    let system = CoordinateSystem::wkt(text.trim())?;
    if system.unit_m.is_some_and(|unit_m| unit_m != 1.0) {
        let hint = "heights of an .asc are metres, and those of a grid in feet may be feet: gdalwarp -t_srs to metres";
        return Err(TerrainError::UnusableCrs {
            what: "units that are not metres".to_owned(),
            hint,
        });
    }
    Ok(Crs::Stated(Box::new(system)))
}

/// Values of the header, the lines before the heights.
struct GridHeader {
    /// Columns and rows.
    size: [usize; 2],
    /// Outer corner of the south-western cell, in the file's coordinates.
    south_west_corner: [f64; 2],
    /// Sides of a cell, in x and in y, in the file's units.
    cell_sides: [f64; 2],
    /// The number that stands for no height.
    missing_value: f64,
}

impl GridHeader {
    /// Reads the header; the next of `words` is then the first height.
    fn read<'a>(words: &mut Peekable<impl Iterator<Item = &'a str>>) -> Result<Self, TerrainError> {
        let bad = |why: &str| TerrainError::malformed(FORMAT, &why);
        let (mut size, mut corner, mut middle) = ([None; 2], [None; 2], [false; 2]);
        let (mut cell, mut missing) = ([None; 2], -9999.0);
        // Of words that begin with n only these are keys: others may be the height `nan`.
        while let Some(key) = words.next_if(|word| {
            word.starts_with(|c: char| c.is_ascii_alphabetic() && c != 'n' && c != 'N')
                || ["ncols", "nrows", "nodata_value"].contains(&word.to_ascii_lowercase().as_str())
        }) {
            let value = words.next().ok_or_else(|| bad("it ends in its header"))?;
            let value: f64 =
                value.parse().map_err(|_| bad(&format!("{key} is {value}, no number")))?;
            match key.to_ascii_lowercase().as_str() {
                "ncols" => size[0] = Some(value),
                "nrows" => size[1] = Some(value),
                "xllcorner" => corner[0] = Some(value),
                "yllcorner" => corner[1] = Some(value),
                "xllcenter" => (corner[0], middle[0]) = (Some(value), true),
                "yllcenter" => (corner[1], middle[1]) = (Some(value), true),
                "cellsize" => cell = [Some(value); 2],
                "dx" => cell[0] = Some(value),
                "dy" => cell[1] = Some(value),
                "nodata_value" => missing = value,
                other => return Err(bad(&format!("its header has a {other}"))),
            }
        }
        let need = |value: Option<f64>, name: &str| {
            value.ok_or_else(|| bad(&format!("{name} is missing")))
        };
        let [columns, rows] = [need(size[0], "ncols")?, need(size[1], "nrows")?];
        let whole = |n: f64| n >= 1.0 && n.fract() == 0.0;
        if !whole(columns) || !whole(rows) {
            return Err(bad("it has no cells"));
        }
        if columns * rows > MAX_CELLS as f64 {
            return Err(TerrainError::TooManyCells((columns * rows) as u128));
        }
        let cell = [need(cell[0], "cellsize")?, need(cell[1], "cellsize")?];
        let mut low = [need(corner[0], "xllcorner")?, need(corner[1], "yllcorner")?];
        if !cell.iter().all(|side| *side > 0.0 && side.is_finite())
            || !low.iter().all(|at| at.is_finite())
        {
            return Err(bad("its cells have no size or place"));
        }
        for axis in 0..2 {
            low[axis] -= if middle[axis] { cell[axis] / 2.0 } else { 0.0 };
        }
        Ok(Self {
            size: [columns as usize, rows as usize],
            south_west_corner: low,
            cell_sides: cell,
            missing_value: missing,
        })
    }
}

/// Reads the text of an ASCII grid with these coordinates.
pub(super) fn parse(text: &str, crs: Crs) -> Result<Raster, TerrainError> {
    let bad = |why: &str| TerrainError::malformed(FORMAT, &why);
    let mut words = text.split_ascii_whitespace().peekable();
    let GridHeader {
        size: [columns, rows],
        south_west_corner: low,
        cell_sides: cell,
        missing_value: missing,
    } = GridHeader::read(&mut words)?;
    let mut heights_m = Vec::with_capacity((columns * rows).min(text.len() / 2 + 1));
    for word in words {
        let value: f64 = word.parse().map_err(|_| bad(&format!("{word} is no height")))?;
        heights_m.push(if value == missing || !value.is_finite() {
            f32::NAN
        } else {
            value as f32
        });
    }
    if heights_m.len() != columns * rows {
        return Err(bad(&format!(
            "it has {} heights, its header says {}",
            heights_m.len(),
            columns * rows
        )));
    }
    Ok(Raster {
        crs,
        columns,
        rows,
        north_west_corner: [low[0], low[1] + rows as f64 * cell[1]],
        cell_sides: cell,
        heights_m,
    })
}
