use super::*;

#[test]
fn names_fit_are_sorted_and_defaults_in_range() {
    assert!(TABLE.windows(2).all(|pair| pair[0].name < pair[1].name));
    let mut values = Parameters::default();
    for (index, parameter) in TABLE.iter().enumerate() {
        assert!(parameter.name.len() <= NAME_LEN && parameter.name.is_ascii());
        assert_eq!(values.set(index, parameter.default), Ok(false));
        assert_eq!(values.set(index, parameter.max), Ok(parameter.max != parameter.default));
        for bad in [f32::NAN, f32::INFINITY, parameter.min - 0.1, parameter.max * 1.1 + 0.1] {
            assert_eq!(values.set(index, bad), Err(ParameterError::Range));
        }
        assert_eq!(
            parameter.whole,
            values.set(index, parameter.min + 0.5) == Err(ParameterError::Range)
        );
    }
    assert_eq!(values.set(PARAMETER_COUNT, 1.0), Err(ParameterError::Unknown));
}

#[test]
fn the_readme_prints_the_table() {
    extern crate std;
    let readme = include_str!("../../../README.md");
    for p in TABLE {
        let row = std::format!("| {} | {} | {} | {} |", p.name, p.min, p.max, p.default);
        assert!(readme.contains(&row), "{row}");
    }
}

#[test]
fn kept_values_come_back_and_foreign_ones_do_no_harm() {
    let mut values = Parameters::default();
    values.set(SPEED_MAX, 3.5).unwrap();
    values.set(SYS_ID, 7.0).unwrap();
    let bytes = values.to_bytes();
    let (entries, _) = bytes.as_chunks::<ENTRY_LEN>();
    let mut back = Parameters::default();
    entries.iter().for_each(|entry| back.restore(entry));
    assert_eq!((back, back.system_id()), (values, Some(7)));
    for foreign in [
        [0xFF; ENTRY_LEN],
        *b"FLK_ACCEL\0\0\0\0\0\0\0\xFF\xFF\xFF\xFF",
        *b"FLK_NEWER\0\0\0\0\0\0\0\0\0\0\0",
    ] {
        back.restore(&foreign);
    }
    assert_eq!(back, values);
}

#[test]
fn limits_only_slow_a_mission_down() {
    use planner_core::{Point, geo::frames::Geodetic};
    let origin = Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 };
    let mission = Config::<1>::new(1, Point::zeros(), origin);
    let mut config = mission.clone();
    Parameters::default().apply(&mut config);
    assert_eq!(config, mission, "the defaults change nothing");
    let mut values = Parameters::default();
    values.set(SPEED_MAX, 0.5).unwrap();
    values.set(BATT_LOW, 30.0).unwrap();
    values.apply(&mut config);
    assert_eq!((config.cruise_mps, config.battery_low_percent), (0.5, 30));
}
