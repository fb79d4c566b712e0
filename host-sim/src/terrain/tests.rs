//! Tests of the readers: on real files, against brute force over random grids, and on damaged
//! files.

mod damaged;
mod real;

use std::io::Cursor;

use planner_core::coverage::Flat;
use planner_core::geo::frames::Geodetic;
use proptest::prelude::*;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

use super::crs::Crs;
use super::raster::Raster;
use super::*;

/// A place in UTM zone 30 north.
pub(super) const ORIGIN: Geodetic = Geodetic { lat_deg: 43.3, lon_deg: -2.9, alt_m: 0.0 };

pub(super) fn anywhere(origin: &Geodetic) -> TerrainFrame<'_> {
    TerrainFrame { origin, without_crs: WithoutCrs::Refused, window: None }
}

/// A GeoTIFF of signed 16-bit heights with the GeoKeys `system`; `corner` is the north-western one,
/// 99 stands for no height.
pub(super) fn tiff(
    size: [u32; 2],
    values: &[i16],
    system: &[u16],
    corner: [f64; 2],
    cell: f64,
) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<colortype::GrayI16>(size[0], size[1]).unwrap();
    image.rows_per_strip(3).unwrap();
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[cell, cell, 0.0][..]).unwrap();
    tags.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, corner[0], corner[1], 0.0][..]).unwrap();
    tags.write_tag(Tag::GeoKeyDirectoryTag, system).unwrap();
    tags.write_tag(Tag::GdalNodata, "99").unwrap();
    image.write_data(values).unwrap();
    bytes.into_inner()
}

/// GeoKeys of a coordinate system, by its model (1 projected, 2 geographic) and EPSG code.
pub(super) fn keys(model: u16, code: u16) -> Vec<u16> {
    let key = if model == 1 { 3072 } else { 2048 };
    vec![1, 1, 0, 3, 1024, 0, 1, model, 1025, 0, 1, 1, key, 0, 1, code]
}

fn asc(columns: usize, corner: [f64; 2], cell: f64, rows: &[Vec<Option<f32>>]) -> String {
    let mut text = format!(
        "ncols {columns}\nnrows {}\nxllcorner {}\nyllcorner {}\ncellsize {cell}\nNODATA_value -9999\n",
        rows.len(),
        corner[0],
        corner[1]
    );
    for row in rows {
        let words: Vec<String> =
            row.iter().map(|h| h.map_or("-9999".to_owned(), |h| h.to_string())).collect();
        text += &(words.join(" ") + "\n");
    }
    text
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_grid_holds_what_its_file_says(
        rows in (1usize..12).prop_flat_map(|columns| prop::collection::vec(
            prop::collection::vec(prop::option::weighted(0.9, -50f32..2000.0), columns), 1..12)),
        corner in [-500i32..500, -500i32..500],
        cell in 1u8..20,
        boxes in prop::collection::vec([-0.2f32..1.2, -0.2f32..1.2, 0f32..0.5, 0f32..0.5], 8),
    ) {
        let (columns, count, cell) = (rows[0].len(), rows.len(), f32::from(cell));
        let corner = corner.map(|at| at as f32);
        let text = asc(columns, corner.map(f64::from), f64::from(cell), &rows);
        let frame = TerrainFrame { origin: &ORIGIN, without_crs: WithoutCrs::Metres, window: None };
        let raster = asc::parse(&text, Crs::Unstated).unwrap();
        let grid = raster.resampled(&frame).unwrap();
        prop_assert_eq!(grid.size(), [columns, count]);
        prop_assert_eq!(grid.cell_m(), cell);
        for (row, heights) in rows.iter().rev().enumerate() {
            for (column, height_m) in heights.iter().enumerate() {
                prop_assert_eq!(grid.height_at(&grid.cell_centre([column, row])), *height_m);
            }
        }
        for [x, y, wide, tall] in boxes {
            let sides = Flat::new(columns as f32, count as f32) * cell;
            let low = Flat::new(corner[0], corner[1]) + sides.component_mul(&Flat::new(x, y));
            let high = low + sides.component_mul(&Flat::new(wide, tall));
            let mut want = BoxHeights { highest_m: None, has_holes: false };
            let touches = |axis: usize, index: usize| {
                let from = corner[axis] + index as f32 * cell;
                high[axis] >= from && low[axis] < from + cell
            };
            for (row, heights) in rows.iter().rev().enumerate() {
                for (column, height_m) in heights.iter().enumerate() {
                    if touches(0, column) && touches(1, row) {
                        want.has_holes |= height_m.is_none();
                        want.highest_m =
                            (*height_m).into_iter().chain(want.highest_m).reduce(f32::max);
                    }
                }
            }
            want.has_holes |= (0..2).any(|a| low[a] < corner[a] || high[a] > corner[a] + sides[a]);
            prop_assert_eq!(grid.highest_in_box(&low, &high), want);
        }
    }

    #[test]
    fn no_height_is_lost_where_grids_are_turned(
        values in prop::collection::vec(-20i16..100, 24 * 17),
        (model, code, corner, cell) in prop::sample::select(vec![
            // Far from the zone's central meridian, so that grid north is not true north; degrees;
            // feet.
            (1u16, 32631u16, [40_000.0, 4_800_000.0], 7.0),
            (2, 4326, [-2.91, 43.31], 2e-4),
            (1, 2225, [6_000_000.0, 2_000_000.0], 30.0),
        ]),
    ) {
        let raster = geotiff_of(&values, model, code, corner, cell);
        let Crs::Stated(system) = &raster.crs else { panic!("it names its system") };
        let [lon_deg, lat_deg] = system.to_wgs84_degrees(corner).unwrap();
        // A frame with its origin at that corner, as missions are near their origin.
        let origin = Geodetic { lat_deg, lon_deg, alt_m: 0.0 };
        let grid = raster.resampled(&anywhere(&origin)).unwrap();
        let unit_m = if code == 2225 { 0.3048 } else { 1.0 };
        for row in 0..17 {
            for column in 0..24 {
                let value = f32::from(values[row * 24 + column]);
                for (s, t) in [(0.1, 0.1), (0.5, 0.5), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)] {
                    let at = [
                        corner[0] + (column as f64 + s) * cell,
                        corner[1] - (row as f64 + t) * cell,
                    ];
                    let place = raster.crs.to_mission_frame(&origin, at).unwrap();
                    let reach = Flat::repeat(grid.cell_m());
                    let near = grid.highest_in_box(&(place - reach), &(place + reach));
                    if value != 99.0 {
                        prop_assert!(near.highest_m.unwrap() >= value * unit_m - 1e-3);
                    }
                    // The height at the place is that of a near cell.
                    let around = (row.saturating_sub(3)..(row + 4).min(17)).flat_map(|r| {
                        (column.saturating_sub(3)..(column + 4).min(24)).map(move |c| r * 24 + c)
                    });
                    if let Some(found) = grid.height_at(&place) {
                        let mut around = around.map(|i| f32::from(values[i]) * unit_m);
                        prop_assert!(around.any(|v| (v - found).abs() < 1e-3), "{found}");
                    }
                }
            }
        }
    }

    #[test]
    fn gaps_between_returns_are_bridged_by_no_less_than_beside_them(
        mut known in prop::collection::vec(prop::option::weighted(0.6, 0u8..100), 10 * 10),
    ) {
        known[55] = Some(7);
        let mut grid = HeightGrid::new([Flat::zeros(), Flat::repeat(10.0)], 1.0).unwrap();
        for (index, height) in known.iter().enumerate() {
            if let Some(height) = height {
                grid.raise_cell(
                    &Flat::new((index % 10) as f32 + 0.5, (index / 10) as f32 + 0.5),
                    f32::from(*height),
                );
            }
        }
        let before = grid.clone();
        grid.fill_holes(2);
        for row in 0..10usize {
            for column in 0..10usize {
                let (own, was) =
                    (grid.cell_height([column, row]), before.cell_height([column, row]));
                let at = |c: i64, r: i64| {
                    before.cell_height([usize::try_from(c).ok()?, usize::try_from(r).ok()?])
                };
                let (c, r) = (column as i64, row as i64);
                let between = [(1, 0), (0, 1)].iter().any(|(dx, dy)| {
                    let side = |sign: i64| {
                        (1..=2).any(|k| at(c + sign * k * dx, r + sign * k * dy).is_some())
                    };
                    side(1) && side(-1)
                });
                prop_assert_eq!(own.is_some(), was.is_some() || between);
                if was.is_some() {
                    prop_assert_eq!(own, was);
                } else if let Some(own) = own {
                    let near = (-2..=2).flat_map(|dx| (-2..=2).map(move |dy| (dx, dy)));
                    let highest =
                        near.filter_map(|(dx, dy)| at(c + dx, r + dy)).fold(f32::MIN, f32::max);
                    prop_assert_eq!(own, highest);
                }
            }
        }
    }
}

fn geotiff_of(values: &[i16], model: u16, code: u16, corner: [f64; 2], cell: f64) -> Raster {
    let mut keys = keys(model, code);
    if code == 2225 {
        // Its heights are in feet.
        keys[3] += 1;
        keys.extend([4099, 0, 1, 9002]);
    }
    geotiff::decode(Cursor::new(tiff([24, 17], values, &keys, corner, cell))).unwrap()
}

#[test]
fn what_cannot_be_honoured_is_refused_by_name() {
    let refused = |keys: &[u16]| {
        let bytes = tiff([2, 2], &[1, 2, 3, 4], keys, [500_000.0, 4_800_000.0], 10.0);
        let read = geotiff::decode(Cursor::new(bytes))
            .and_then(|raster| raster.resampled(&anywhere(&ORIGIN)));
        read.map(|grid| grid.known_cell_count()).unwrap_err().to_string()
    };
    for (keys, text) in [
        (keys(1, 1), "EPSG:1,"),
        (keys(1, 32767), "a system of its own"),
        // NAD27 needs a grid of datum shifts; EPSG:2225 is in feet, and does not state the unit of
        // heights.
        (keys(2, 4267), "EPSG:4267"),
        (keys(1, 2225), "feet, and does not say"),
        (vec![1, 1, 0, 0], "does not say where it is"),
        (keys(3, 4978), "middle of the earth"),
        (vec![1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32630, 3076, 0, 1, 9002], "units of 0.3048 m"),
        (vec![1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32630, 4096, 0, 1, 9999], "EPSG:9999"),
        (
            vec![1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32630, 4099, 0, 1, 9095],
            "units of EPSG:9095",
        ),
    ] {
        let error = refused(&keys);
        assert!(error.contains(text), "{error}");
        assert!(!error.contains('\n') && error.len() < 300, "{error}");
    }
    let error = super::read(Path::new("hills.png"), &anywhere(&ORIGIN)).unwrap_err().to_string();
    assert!(error.contains("no known format"), "{error}");
}

#[test]
fn a_prj_says_where_an_esri_grid_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hill.asc");
    let text = asc(
        2,
        [500_000.0, 4_794_000.0],
        10.0,
        &[vec![Some(1.0), Some(2.0)], vec![Some(3.0), None]],
    );
    std::fs::write(&path, text).unwrap();
    let error = super::read(&path, &anywhere(&ORIGIN)).unwrap_err().to_string();
    assert!(error.contains("does not say where it is"), "{error}");
    let wkt = r#"PROJCS["ETRS_1989_UTM_Zone_30N",GEOGCS["GCS_ETRS_1989",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,
        298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],
        PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",-3.0],
        PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#;
    std::fs::write(path.with_extension("prj"), wkt).unwrap();
    let grid = super::read(&path, &anywhere(&ORIGIN)).unwrap();
    // The same place by its EPSG number.
    let named = geotiff_of(&[1; 24 * 17], 1, 32630, [500_000.0, 4_794_020.0], 10.0);
    let place = named.crs.to_mission_frame(&ORIGIN, [500_005.0, 4_794_015.0]).unwrap();
    assert_eq!(grid.height_at(&place), Some(1.0));
    assert_eq!(grid.known_cell_count(), 3);
    let feet = wkt.replace(r#"UNIT["Meter",1.0]"#, r#"UNIT["Foot_US",0.3048006096012192]"#);
    std::fs::write(path.with_extension("prj"), feet).unwrap();
    let error = super::read(&path, &anywhere(&ORIGIN)).unwrap_err().to_string();
    assert!(error.contains("not metres"), "{error}");
}
