//! Tests of the readers on real files with heights, where the shared data is present.

use std::path::{Path, PathBuf};

use super::*;

fn data(name: &str) -> Option<PathBuf> {
    let path =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/height")).join(name);
    if path.is_file() {
        return Some(path);
    }
    println!("skipped: no {}", path.display());
    None
}

#[test]
fn bilbao_is_where_its_system_says() {
    // Number of cells along a side and sum of all heights as another reader finds them.
    for (name, size, sum, range) in [
        ("bilbao_DEM.tif", 680, 9_637_843.0, [-2.0, 103.0]),
        ("bilbao_BDSM.tif", 1359, 4_762_879.0, [0.0, 52.0]),
    ] {
        let Some(path) = data(name) else { return };
        let raster = geotiff::read(&path).unwrap();
        assert_eq!((raster.columns, raster.rows), (size, size));
        assert_eq!(raster.heights_m.iter().map(|h| f64::from(*h)).sum::<f64>(), sum);
        // The central meridian of UTM zone 30 is 3° west; there a metre east in the file is 1 /
        // 0.9996 m.
        let on_meridian = |x: f64| {
            let origin = Geodetic { lat_deg: 43.3, lon_deg: -3.0, alt_m: 0.0 };
            raster.crs.to_mission_frame(&origin, [x, 4_794_000.0]).unwrap()
        };
        assert!(on_meridian(500_000.0).x.abs() < 0.01, "{}", on_meridian(500_000.0));
        assert!((on_meridian(501_000.0).x - 1000.4).abs() < 0.02, "{}", on_meridian(501_000.0));
        let origin = Geodetic { lat_deg: latitude_deg(4_796_000.0), lon_deg: -3.0, alt_m: 0.0 };
        let place = raster.crs.to_mission_frame(&origin, [500_000.0, 4_796_000.0]).unwrap();
        assert!(place.norm() < 0.05, "{place}");
        let window = Some([Flat::repeat(-400.0), Flat::repeat(900.0)]);
        let grid = super::read(
            &path,
            &TerrainFrame { origin: &origin, without_crs: WithoutCrs::Refused, window },
        )
        .unwrap();
        let highest = grid.highest_in_box(&Flat::repeat(-300.0), &Flat::repeat(800.0));
        assert!(!highest.has_holes, "{name}");
        // Compared with the file's own cells in that box, whose sides are along the file's rows
        // here.
        let cells = |from: f64, to: f64, corner: f64, side: f64| {
            ((from - corner) / side) as usize..((to - corner) / side) as usize
        };
        let columns =
            cells(499_702.0, 500_798.0, raster.north_west_corner[0], raster.cell_sides[0]);
        let rows =
            cells(4_797_200.0 - 4_796_798.0, 4_797_200.0 - 4_795_702.0, 0.0, raster.cell_sides[1]);
        let own = rows.flat_map(|row| columns.clone().map(move |column| row * size + column));
        let own = own.map(|index| raster.heights_m[index]).fold(f32::MIN, f32::max);
        assert!(highest.highest_m.unwrap() >= own, "{name}: {highest:?}, not {own}");
        let [low, high] = grid.height_range_m().unwrap();
        assert!(low >= range[0] && high <= range[1]);
    }
}

/// The latitude of a northing on a zone's central meridian, by summing its arc (GRS 1980).
fn latitude_deg(northing_m: f64) -> f64 {
    let (a, e2) = (6_378_137.0, 0.006_694_380_022_90);
    let (steps, mut lat, mut arc) = (200_000, 0.0f64, 0.0);
    let step = std::f64::consts::FRAC_PI_2 / f64::from(steps);
    let radius = |lat: f64| a * (1.0 - e2) / (1.0 - e2 * lat.sin().powi(2)).powf(1.5);
    while arc < northing_m / 0.9996 {
        let length = radius(lat + step / 2.0) * step;
        let share = ((northing_m / 0.9996 - arc) / length).min(1.0);
        (lat, arc) = (lat + share * step, arc + length);
    }
    lat.to_degrees()
}

/// Longitude and latitude (degrees) of a place in the file's Lambert conformal conic projection,
/// independently by Snyder's formulas (1987, 15-7 to 15-11).
fn autzen([x, y]: [f64; 2]) -> [f64; 2] {
    let e = 0.006_694_380_022_90f64.sqrt();
    let [lat1, lat2, lat0] = [43.0f64, 45.5, 41.75].map(f64::to_radians);
    let m = |lat: f64| lat.cos() / (1.0 - (e * lat.sin()).powi(2)).sqrt();
    let t = |lat: f64| {
        let s = e * lat.sin();
        (std::f64::consts::FRAC_PI_4 - lat / 2.0).tan() / ((1.0 - s) / (1.0 + s)).powf(e / 2.0)
    };
    let n = (m(lat1) / m(lat2)).ln() / (t(lat1) / t(lat2)).ln();
    let scale = 6_378_137.0 * m(lat1) / (n * t(lat1).powf(n));
    let rho0 = scale * t(lat0).powf(n);
    let (east, north) = (x * 0.3048 - 400_000.0, y * 0.3048);
    let rho = (east * east + (rho0 - north).powi(2)).sqrt();
    let small = (rho / scale).powf(1.0 / n);
    let mut lat = std::f64::consts::FRAC_PI_2 - 2.0 * small.atan();
    for _ in 0..10 {
        let s = e * lat.sin();
        lat = std::f64::consts::FRAC_PI_2
            - 2.0 * (small * ((1.0 - s) / (1.0 + s)).powf(e / 2.0)).atan();
    }
    let lon = (east / (rho0 - north)).atan() / n + (-120.5f64).to_radians();
    [lon.to_degrees(), lat.to_degrees()]
}

#[test]
fn autzen_is_in_feet_and_where_its_system_says() {
    let Some(path) = data("autzen_trim.las") else { return };
    // The file decoded here without the reader: 34 bytes a return from byte 2038 on.
    let bytes = std::fs::read(&path).unwrap();
    let number =
        |at: usize| f64::from(i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())) * 0.01;
    let returns: Vec<[f64; 3]> =
        (0..110_000).map(|i| [0, 4, 8].map(|k| number(2038 + 34 * i + k))).collect();
    let [lon_deg, lat_deg] = autzen([636_600.0, 849_200.0]);
    // The stadium is at 44.058° north, 123.068° west.
    assert!(
        (lat_deg - 44.054).abs() < 0.006 && (lon_deg + 123.071).abs() < 0.006,
        "{lat_deg} {lon_deg}"
    );
    let origin = Geodetic { lat_deg, lon_deg, alt_m: 0.0 };
    let grid = super::read(&path, &anywhere(&origin)).unwrap();
    let range = grid.height_range_m().unwrap();
    assert!(range[0] > 123.8 && (range[1] - 158.651).abs() < 0.01, "{range:?}");
    let places: Vec<(Flat, f32)> = returns
        .iter()
        .map(|[x, y, z]| {
            let [lon_deg, lat_deg] = autzen([*x, *y]);
            let place = Geodetic { lat_deg, lon_deg, alt_m: 0.0 };
            (planner_core::geo::frames::geodetic_to_enu(&origin, &place).xy(), (z * 0.3048) as f32)
        })
        .collect();
    let cell_m = grid.cell_m();
    assert!((0.5..3.0).contains(&cell_m), "{cell_m}");
    let mut compared = 0;
    for k in 0..40 {
        let low = Flat::new(-120.0 + 6.0 * k as f32, -60.0 + ((k * 37) % 100) as f32);
        let high = low + Flat::new(2.0 + (k % 7) as f32, 2.0 + (k % 5) as f32);
        let beside = Flat::repeat(cell_m);
        let inside = |by: Flat| {
            let held = places.iter().filter(move |(p, _)| {
                p.x >= low.x - by.x
                    && p.x <= high.x + by.x
                    && p.y >= low.y - by.y
                    && p.y <= high.y + by.y
            });
            held.map(|(_, z)| *z).fold(f32::MIN, f32::max)
        };
        let found = grid.highest_in_box(&low, &high);
        let (least, most) = (inside(Flat::zeros()), inside(beside * 4.0));
        if least == f32::MIN {
            continue;
        }
        compared += 1;
        let highest_m = found.highest_m.unwrap();
        assert!(
            highest_m >= least - 0.01 && highest_m <= most + 0.01,
            "{k}: {highest_m} {least} {most}"
        );
    }
    assert!(compared > 25, "{compared}");
    assert!(places.iter().all(|(place, height_m)| grid.height_at(place) >= Some(*height_m - 0.01)));
}

#[test]
fn clouds_without_returns_or_a_system_are_refused_by_name() {
    let (Some(none), Some(simple)) = (data("no-points.las"), data("simple.las")) else { return };
    let error = super::read(&none, &anywhere(&ORIGIN)).unwrap_err().to_string();
    assert!(error.contains("no height here"), "{error}");
    let error = super::read(&simple, &anywhere(&ORIGIN)).unwrap_err().to_string();
    assert!(error.contains("does not say where it is"), "{error}");
    // If the mission's coordinates are metres, the file's are taken for metres too.
    let grid = super::read(
        &simple,
        &TerrainFrame { without_crs: WithoutCrs::Metres, ..anywhere(&ORIGIN) },
    )
    .unwrap();
    let range = grid.height_range_m().unwrap();
    assert!(range[0] >= 406.59 && (range[1] - 586.38).abs() < 0.01, "{range:?}");
    // The file's coordinates are far from any mission.
    let window = Some([Flat::repeat(-100.0), Flat::repeat(100.0)]);
    let error = super::read(
        &simple,
        &TerrainFrame { without_crs: WithoutCrs::Metres, window, ..anywhere(&ORIGIN) },
    )
    .unwrap_err();
    assert!(error.to_string().contains("lies elsewhere"), "{error}");
}
