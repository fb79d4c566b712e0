//! The deconfliction suite over a few seeds; `cargo xtask bench --only deconfliction` flies a
//! hundred of each case.

use std::process::Command;

use serde_json::Value;

/// Seeds of each case: the whole suite takes minutes.
const SEEDS: u64 = 2;

/// The rows of the suite, run with these arguments.
fn suite(args: &[&str]) -> Vec<Value> {
    let dir = tempfile::tempdir().unwrap();
    let rows = dir.path().join("rows.json");
    let suite = Command::new(env!("CARGO_BIN_EXE_deconfliction"))
        .args(args)
        .arg("--out")
        .arg(&rows)
        .status();
    assert!(suite.unwrap().success());
    serde_json::from_str(&std::fs::read_to_string(rows).unwrap()).unwrap()
}

/// Each vehicle departs as late as the schedule says, so none waits in the air for a later one; and
/// each lands near enough to its place for the others to pass.
#[test]
fn forty_swap_places_and_none_stands() {
    let rows = suite(&["--only", "circle, 40", "--method", "priority", "--seeds", "1"]);
    let row = rows.iter().find(|row| row["method"] == "priority").unwrap();
    for count in ["unplanned", "violations", "wall_contacts", "deadlocks", "held_up"] {
        assert_eq!(row[count], 0, "{row}");
    }
    assert_eq!(row["complete"], 1, "{row}");
}

#[test]
fn hard_meetings_end_without_a_touch_or_a_standstill() {
    let rows = suite(&["--small", "--seeds", &SEEDS.to_string()]);
    let ours: Vec<&Value> = rows.iter().filter(|row| row["method"] == "priority").collect();
    assert!(ours.len() >= 16, "{} cases", ours.len());
    for row in ours {
        // If a silent vehicle may lie anywhere on a stretch, another vehicle's goal may be out of
        // reach.
        let lost = row["name"]
            .as_str()
            .is_some_and(|name| name.starts_with("radio") || name.starts_with("circle, 30 %"));
        assert!(lost || row["complete"] == SEEDS, "{row}");
        // Most reach their goals all the same: one vehicle of eight in every flight may land short.
        assert!(
            row["held_up"].as_u64().is_some_and(|held_up| held_up <= if lost { SEEDS } else { 0 }),
            "{row}"
        );
        for count in ["violations", "wall_contacts", "deadlocks"] {
            assert_eq!(row[count], 0, "{row}");
        }
    }
}

/// Three of the seeds 101 to 400 in which a vehicle once came too near to a silent one on the
/// ground. The silent one lay at the end of the stretch that others keep clear of (123, 160), or
/// where it had flown through gates that opened after it was last heard (360).
#[test]
fn a_vehicle_that_only_hears_lies_where_others_look_for_it() {
    for seed in ["123", "160", "360"] {
        let case =
            ["--only", "radio only hears", "--method", "priority", "--seeds", "1", "--first", seed];
        let rows = suite(&case);
        assert_eq!(rows.len(), 1, "{rows:?}");
        for count in ["violations", "wall_contacts", "deadlocks"] {
            assert_eq!(rows[0][count], 0, "seed {seed}: {}", rows[0]);
        }
    }
}
