use super::*;
use crate::scenario;

#[test]
fn what_strikes_a_companion_is_refused_where_that_is_elsewhere() {
    let refused = |companion: &str, kind: &str, whom: &str| {
        let text = format!(
            "[map]\nfile = \"builtin:building\"\n[mission]\ngoals = [[8.0, 2.0, 1.5]]\n\
             [[vehicles]]\nid = 1\nstart = [4.0, 2.0, 1.5]\n{companion}\n\
             [[vehicles]]\nid = 2\nstart = [4.0, 4.0, 1.5]\n\
             [[faults]]\nat_s = 1.0\nkind = \"{kind}\"\n{whom}\n"
        );
        check(&scenario::parse(&text, "faults.toml").expect("a scenario")).is_err()
    };
    let board = "companion = \"tcp:127.0.0.1:5761\"\nradio = \"tcp:127.0.0.1:5762\"";
    let alone = "companion = \"tcp:127.0.0.1:5761\"";
    for kind in ["companion-reset", "late-plan", "bad-roadmap"] {
        assert!(refused(board, kind, "vehicle = 1") && refused(board, kind, ""), "{kind}");
        assert!(!refused(board, kind, "vehicle = 2") && !refused("", kind, ""), "{kind}");
    }
    assert!(refused(alone, "radio-cut", "") && !refused(board, "radio-cut", ""));
    assert!(!refused(alone, "kill", "vehicle = 1"));
}

#[test]
fn over_level_ground_there_is_no_file_to_damage() {
    for (kind, refused) in [("bad-roadmap", true), ("late-plan", false)] {
        let text = format!(
            "[area]\npolygon = [[0, 0], [40, 0], [44, 24], [4, 26]]\nheight_m = 14.0\n\
             camera = {{ fov_deg = 73.7, aspect = 1.5 }}\n\
             [[vehicles]]\nid = 1\nstart = [-6, 0, 0]\n\
             [[faults]]\nat_s = 1.0\nkind = \"{kind}\"\n"
        );
        let scenario = scenario::parse(&text, "level.toml").expect("a scenario");
        assert_eq!(check(&scenario).is_err(), refused, "{kind}");
    }
}
