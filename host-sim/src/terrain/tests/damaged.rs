//! Files cut short, with changed bytes or with exaggerated sizes: an error or heights, never a
//! panic.

use las::{Builder, Color, Point as Return, Transform, Vector, Writer};
use rand_core::Rng as _;
use rand_pcg::Pcg32;

use super::*;

#[derive(Clone, Copy, PartialEq)]
enum CloudFile {
    Las,
    Laz,
}

/// A small cloud in metres of UTM zone 30, compressed or not.
fn returns(file: CloudFile, format: u8) -> Vec<u8> {
    let mut builder = Builder::from((1, 4));
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = file == CloudFile::Laz;
    let axis = |offset| Transform { scale: 0.01, offset };
    builder.transforms = Vector { x: axis(500_000.0), y: axis(4_794_000.0), z: axis(0.0) };
    let directory: Vec<u8> = keys(1, 32630).iter().flat_map(|n| n.to_le_bytes()).collect();
    builder.vlrs.push(las::Vlr {
        user_id: "LASF_Projection".to_owned(),
        record_id: 34735,
        description: String::new(),
        data: directory,
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(match file {
        CloudFile::Las => "returns.las",
        CloudFile::Laz => "returns.laz",
    });
    let mut writer = Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for k in 0..400 {
        let (x, y) = (f64::from(k % 20), f64::from(k / 20));
        let point = Return {
            x: 500_000.0 + x,
            y: 4_794_000.0 + y,
            z: x + 2.0 * y,
            gps_time: Some(0.0),
            color: (format == 3).then(Color::default),
            ..Return::default()
        };
        writer.write_point(point).unwrap();
    }
    // The last two returns are higher than all others: one is noise, one was deleted.
    for withheld in [false, true] {
        let noise = las::point::Classification::LowPoint;
        let deleted = Return {
            x: 500_005.0,
            y: 4_794_005.0,
            z: 900.0,
            gps_time: Some(0.0),
            color: (format == 3).then(Color::default),
            classification: if withheld { Default::default() } else { noise },
            is_withheld: withheld,
            ..Return::default()
        };
        writer.write_point(deleted).unwrap();
    }
    writer.close().unwrap();
    drop(writer);
    std::fs::read(path).unwrap()
}

fn decode_tiff(bytes: &[u8]) -> Result<HeightGrid, TerrainError> {
    geotiff::decode(Cursor::new(bytes.to_vec()))?.resampled(&anywhere(&ORIGIN))
}

fn decode_cloud(bytes: &[u8]) -> Result<HeightGrid, TerrainError> {
    super::cloud::decode(Cursor::new(bytes.to_vec()), &anywhere(&ORIGIN))
}

fn decode_asc(bytes: &[u8]) -> Result<HeightGrid, TerrainError> {
    let text = String::from_utf8_lossy(bytes);
    asc::parse(&text, Crs::Unstated)?
        .resampled(&TerrainFrame { without_crs: WithoutCrs::Metres, ..anywhere(&ORIGIN) })
}

#[test]
fn a_cloud_is_the_same_compressed() {
    let (plain, small) = (
        decode_cloud(&returns(CloudFile::Las, 3)).unwrap(),
        decode_cloud(&returns(CloudFile::Laz, 3)).unwrap(),
    );
    assert_eq!(plain.height_range_m(), Some([plain.height_range_m().unwrap()[0], 57.0]));
    assert_eq!(plain.known_cell_count(), small.known_cell_count());
    assert_eq!(plain.height_range_m(), small.height_range_m());
}

#[test]
fn damaged_files_end_in_an_error_or_in_heights() {
    let values: Vec<i16> = (0..300).collect();
    let image = tiff([20, 15], &values, &keys(1, 32630), [500_000.0, 4_794_000.0], 5.0);
    let grid =
        b"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\nNODATA_value -1\n1 2 3\n4 -1 6\n";
    type Decode = fn(&[u8]) -> Result<HeightGrid, TerrainError>;
    let files: [(&str, Vec<u8>, Decode); 5] = [
        ("tif", image, decode_tiff),
        ("las", returns(CloudFile::Las, 3), decode_cloud),
        ("laz", returns(CloudFile::Laz, 3), decode_cloud),
        ("laz in layers", returns(CloudFile::Laz, 6), decode_cloud),
        ("asc", grid.to_vec(), decode_asc),
    ];
    let tries =
        std::env::var("FLOCKMATE_DAMAGED").ok().and_then(|n| n.parse().ok()).unwrap_or(300u32);
    let mut random = Pcg32::new(12, 34);
    for (name, whole, decode) in files {
        decode(&whole).unwrap();
        let (mut refused, mut cuts) = (0, 0);
        for k in 0..tries {
            let mut bytes = whole.clone();
            let at = random.next_u32() as usize % bytes.len();
            match k % 3 {
                0 => {
                    bytes.truncate(at);
                    cuts += u32::from(decode(&bytes).is_ok());
                }
                1 => {
                    // Half of the changes hit the header, where they matter most.
                    let at = if random.next_u32().is_multiple_of(2) {
                        at % 400 % bytes.len()
                    } else {
                        at
                    };
                    bytes[at] = random.next_u32() as u8;
                    refused += u32::from(decode(&bytes).is_err());
                }
                _ => {
                    for byte in bytes.iter_mut().skip(at).take(4) {
                        *byte = if k % 2 == 0 { 0xff } else { 0x7f };
                    }
                    refused += u32::from(decode(&bytes).is_err());
                }
            }
        }
        // Not every change is an error: it may turn a return into another valid one.
        assert!(refused > 0, "{name}: {refused} refused");
        assert!(cuts <= tries / 30, "{name}: {cuts} cut files were read");
    }
}

#[test]
fn damaged_systems_are_refused_or_mean_something() {
    let whole = r#"COMPD_CS["both",PROJCS["NAD83 / x",GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",
        6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],
        PROJECTION["Lambert_Conformal_Conic_2SP"],PARAMETER["standard_parallel_1",43],
        PARAMETER["standard_parallel_2",45.5],PARAMETER["latitude_of_origin",41.75],PARAMETER["central_meridian",-120.5],
        PARAMETER["false_easting",1312335.958],PARAMETER["false_northing",0],UNIT["foot",0.3048]],
        VERT_CS["NAVD88 (ftUS)",VERT_DATUM["North American",2005],UNIT["US survey foot",0.3048006096012192]]]"#;
    let feet = super::crs::wkt_height_unit_m(whole).unwrap();
    assert!((feet - super::crs::US_FOOT_M).abs() < 1e-12);
    assert_eq!(super::crs::CoordinateSystem::wkt(whole).unwrap().unit_m, Some(0.3048));
    let mut random = Pcg32::new(56, 78);
    let mut refused = 0;
    for _ in 0..3000 {
        let mut bytes = whole.as_bytes().to_vec();
        for _ in 0..1 + random.next_u32() % 4 {
            let at = random.next_u32() as usize % bytes.len();
            match random.next_u32() % 3 {
                0 => bytes.truncate(at + 1),
                1 => bytes[at] = b" \"[],.-09eE+PU"[random.next_u32() as usize % 14],
                _ => drop(bytes.remove(at)),
            }
            if bytes.is_empty() {
                bytes.push(b'[');
            }
        }
        let text = String::from_utf8(bytes).unwrap();
        let _ = super::crs::wkt_height_unit_m(&text);
        match super::crs::CoordinateSystem::wkt(&text) {
            Ok(system) => drop(system.to_wgs84_degrees([1_300_000.0, 500_000.0])),
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
    assert!(refused > 300, "{refused}");
}

#[test]
fn files_that_say_that_they_are_vast_are_refused() {
    let vast = "ncols 100000\nnrows 100000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n";
    assert!(matches!(decode_asc(vast.as_bytes()), Err(TerrainError::TooManyCells(10_000_000_000))));
    let few = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n";
    assert!(
        decode_asc(few.as_bytes())
            .unwrap_err()
            .to_string()
            .contains("it has 3 heights, its header says 4")
    );
    // A window of 100 km in cells of 1 m has too many cells.
    let values = vec![5i16; 4];
    let bytes = tiff([2, 2], &values, &keys(1, 32630), [500_000.0, 4_794_000.0], 1.0);
    let window = Some([Flat::repeat(-50_000.0), Flat::repeat(50_000.0)]);
    let raster = geotiff::decode(Cursor::new(bytes)).unwrap();
    let laid = raster.resampled(&TerrainFrame { window, ..anywhere(&ORIGIN) });
    assert!(matches!(laid, Err(TerrainError::TooManyCells(_))));
}
