//! Reads GeoTIFF: one band of heights, in strips or tiles, raw, deflate or LZW.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use super::crs::Crs;
use super::error::TerrainError;
use super::geokeys::GeoKeys;
use super::limits::{MAX_BYTES, MAX_CELLS};
use super::raster::Raster;
use crate::files;

/// Name of the format in errors.
const FORMAT: &str = "a GeoTIFF";
/// Longest strip or tile that is decoded, bytes.
const MAX_CHUNK_BYTES: usize = 1 << 27;

/// Reads a GeoTIFF file.
pub(super) fn read(path: &Path) -> Result<Raster, TerrainError> {
    let length = files::regular_file_len(path)?;
    if length > MAX_BYTES {
        return Err(TerrainError::TooLong(length));
    }
    decode(BufReader::new(File::open(path)?))
}

/// The error for a file that is no sound GeoTIFF.
fn bad_file(why: &impl ToString) -> TerrainError {
    TerrainError::malformed(FORMAT, why)
}

/// An error of the decoder: one of reading the file, or else the file is malformed.
fn tiff_error(error: TiffError) -> TerrainError {
    match error {
        TiffError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            error.into()
        }
        other => bad_file(&other),
    }
}

/// As [`read`], from an open file.
pub(super) fn decode<R: Read + Seek>(file: R) -> Result<Raster, TerrainError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_CHUNK_BYTES;
    limits.intermediate_buffer_size = MAX_CHUNK_BYTES;
    limits.ifd_value_size = 1 << 24;
    let mut decoder = Decoder::new(file).map_err(tiff_error)?.with_limits(limits);
    let (columns, rows) = decoder.dimensions().map_err(tiff_error)?;
    let (columns, rows) = (columns as usize, rows as usize);
    if columns.saturating_mul(rows) > MAX_CELLS {
        return Err(TerrainError::TooManyCells(columns as u128 * rows as u128));
    }
    if columns == 0 || rows == 0 {
        return Err(bad_file(&"it has no cells"));
    }
    match decoder.colortype().map_err(tiff_error)? {
        ColorType::Gray(_) => {}
        other => {
            return Err(bad_file(&format!("it has colours ({other:?}), not one height a cell")));
        }
    }
    let keys = decoder.find_tag_unsigned_vec(Tag::GeoKeyDirectoryTag).map_err(tiff_error)?;
    let keys = GeoKeys::new(&keys.unwrap_or_default());
    let crs = keys.crs(None)?;
    let unit_m = match (keys.height_unit_m()?, &crs) {
        (Some(unit_m), _) => unit_m,
        (None, Crs::Stated(system)) if system.unit_m.is_some_and(|unit_m| unit_m != 1.0) => {
            let hint = "gdal_edit.py -a_srs EPSG:2994+8228, with your numbers, says the unit of its heights";
            return Err(TerrainError::UnusableCrs {
                what: "feet, and does not say whether its heights are".to_owned(),
                hint,
            });
        }
        (None, _) => 1.0,
    };
    let missing = decoder.find_tag(Tag::GdalNodata).map_err(tiff_error)?;
    let missing = missing.and_then(|value| value.into_string().ok());
    let missing: Option<f64> = missing.and_then(|text| text.trim_matches(['\0', ' ']).parse().ok());
    let (corner, cell) = georeference(&mut decoder, &keys)?;
    let value_m = |value: f64| match missing.is_some_and(|m| is_missing_value(value, m))
        || !value.is_finite()
    {
        true => f32::NAN,
        false => (value * unit_m) as f32,
    };
    let heights_m = read_heights(&mut decoder, columns, rows, value_m)?;
    Ok(Raster { crs, columns, rows, north_west_corner: corner, cell_sides: cell, heights_m })
}

/// The heights row by row, from strips or tiles.
fn read_heights<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    columns: usize,
    rows: usize,
    value_m: impl Fn(f64) -> f32,
) -> Result<Vec<f32>, TerrainError> {
    let mut heights_m = vec![f32::NAN; columns * rows];
    let (wide, tall) = decoder.chunk_dimensions();
    let (wide, tall) = (wide.max(1) as usize, tall.max(1) as usize);
    let across = columns.div_ceil(wide);
    for chunk in 0..across * rows.div_ceil(tall) {
        let (own_wide, own_tall) = decoder.chunk_data_dimensions(chunk as u32);
        let (own_wide, own_tall) = (own_wide as usize, own_tall as usize);
        let values = decoder.read_chunk(chunk as u32).map_err(tiff_error)?;
        let (left, top) = (chunk % across * wide, chunk / across * tall);
        let mut values = values_as_f64(values)?;
        for row in top..(top + own_tall).min(rows) {
            for column in left..left + own_wide {
                let value = values.next().ok_or_else(|| bad_file(&"a part of it ends early"))?;
                if column < columns {
                    heights_m[row * columns + column] = value_m(value);
                }
            }
        }
    }
    Ok(heights_m)
}

/// Whether a value is the no-data value. GDAL writes that as decimal text, which may differ from
/// the raster's f32 in the last digits, so they are also compared as f32.
fn is_missing_value(value: f64, missing: f64) -> bool {
    value == missing || value as f32 == missing as f32
}

/// Coordinates of the first cell's outer (north-western) corner, and the sides of cells, in the
/// file's units.
fn georeference<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    keys: &GeoKeys,
) -> Result<([f64; 2], [f64; 2]), TerrainError> {
    let mut tag = |tag: Tag| -> Result<Option<Vec<f64>>, TerrainError> {
        let found = decoder.find_tag(tag).map_err(tiff_error)?;
        found.map(|value| value.into_f64_vec().map_err(tiff_error)).transpose()
    };
    let scale = tag(Tag::ModelPixelScaleTag)?;
    let tie = tag(Tag::ModelTiepointTag)?;
    let (mut corner, cell) = match (scale.as_deref(), tie.as_deref()) {
        (Some([dx, dy, ..]), Some([column, row, _, x, y, ..])) => {
            ([x - column * dx, y + row * dy], [*dx, *dy])
        }
        _ => match tag(Tag::ModelTransformationTag)?.as_deref() {
            Some([a, b, _, x, c, d, _, y, ..]) => {
                if *b != 0.0 || *c != 0.0 || *d > 0.0 {
                    return Err(TerrainError::unusable_crs(
                        "rows that do not run from west to east",
                    ));
                }
                ([*x, *y], [*a, -d])
            }
            _ => {
                return Err(TerrainError::NoGeoreference("gdal_translate -a_ullr -a_srs says it"));
            }
        },
    };
    if !cell.iter().all(|side| *side > 0.0 && side.is_finite())
        || !corner.iter().all(|at| at.is_finite())
    {
        return Err(bad_file(&"its cells have no size or place"));
    }
    if keys.is_pixel_point() {
        corner = [corner[0] - cell[0] / 2.0, corner[1] + cell[1] / 2.0];
    }
    Ok((corner, cell))
}

/// The decoded numbers as f64.
fn values_as_f64(values: DecodingResult) -> Result<Box<dyn Iterator<Item = f64>>, TerrainError> {
    Ok(match values {
        DecodingResult::U8(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::I8(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::U16(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::I16(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::U32(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::I32(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::F32(v) => Box::new(v.into_iter().map(f64::from)),
        DecodingResult::F64(v) => Box::new(v.into_iter()),
        _ => return Err(bad_file(&"its heights are no numbers of 8, 16, 32 or 64 bits")),
    })
}
