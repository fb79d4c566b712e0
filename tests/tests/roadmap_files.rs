//! Changed roadmap files with a right CRC: each is refused, or every search on it is right and
//! bounded.

use std::collections::BTreeMap;

use flockmate_tests::meeting::dice::Dice;
use flockmate_tests::roadmaps::Forger;
use planner_core::roadmap::RoadmapError;

/// Number of files forged from one roadmap.
const OF_ONE: usize = 50;

/// `FLOCKMATE_FILES` sets the number of files.
#[test]
fn forged_files_are_refused_or_searched_right() {
    let files =
        std::env::var("FLOCKMATE_FILES").map_or(20_000, |count| count.parse().expect("a number"));
    let mut dice = Dice::new(1);
    let mut forger = Forger::new(&mut dice);
    let mut verdicts: BTreeMap<String, usize> = BTreeMap::new();
    for file in 0..files {
        if file % OF_ONE == 0 {
            forger = Forger::new(&mut dice);
        }
        let verdict = match forger.forge(&mut dice) {
            Ok(()) => "searched".to_owned(),
            // The name of the error without its numbers.
            Err(error) => {
                let name = match error {
                    RoadmapError::File(error) => format!("{error:?}"),
                    error => format!("{error:?}"),
                };
                name.split(['(', ' ']).next().unwrap_or_default().to_owned()
            }
        };
        *verdicts.entry(verdict).or_default() += 1;
    }
    println!("{files} forged files: {verdicts:?}");
    let seen = |verdict: &str| verdicts.get(verdict).copied().unwrap_or(0);
    assert!(seen("searched") > files / 100, "{verdicts:?}");
    // Each check of the reader refused some files.
    for check in [
        "Magic",
        "Version",
        "Length",
        "TooManyNodes",
        "Header",
        "Node",
        "Offset",
        "Target",
        "OneWay",
        "EdgeClearance",
        "EdgeLength",
        "Landmark",
        "Height",
    ] {
        assert!(seen(check) > 0, "{check}: {verdicts:?}");
    }
}
