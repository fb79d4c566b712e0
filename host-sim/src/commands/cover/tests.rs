use super::*;

#[test]
fn one_lane_is_counted_in_the_singular() {
    let line = |width_m: u32| {
        let text = format!(
            "[area]\npolygon = [[0, 0], [50, 0], [50, {width_m}], [0, {width_m}]]\n\
             angle_deg = 0.0\ncamera = {{ fov_deg = 73.7 }}\nheight_m = 25.0\n\
             lane_m = 10.0\nwaypoint_m = 10.0\n\
             [[vehicles]]\nid = 1\nstart = [-10, -10, 0]\n"
        );
        let scenario = scenario::parse(&text, "lanes").unwrap();
        let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).unwrap();
        let flights = planned.flights();
        let flown = check::flights_to_check(&planned, &flights);
        let findings = check::check_flights(&planned, &flown);
        area_line(&cover_result(&planned, &findings).coverage, &findings)
    };
    assert!(line(8).contains(" waypoints on 1 lane at "), "{}", line(8));
    assert!(line(18).contains(" waypoints on 2 lanes at "), "{}", line(18));
}

#[test]
fn plans_of_an_earlier_run_are_removed_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let kept = [
        "vehicle-1-sortie-1.plan",
        "vehicle-1-sortie-1.waypoints",
        "vehicle-x.plan",
        "my.plan",
        "vehicle-1.txt",
    ];
    let stale = ["vehicle-1.plan", "vehicle-1.waypoints", "vehicle-2-sortie-3.plan"];
    for name in kept.iter().chain(&stale) {
        fs::write(folder.path().join(name), name).unwrap();
    }
    let written: Vec<String> = kept[..2].iter().map(|name| (*name).to_owned()).collect();
    remove_stale_plan_files(folder.path(), &written).unwrap();
    let there = |name: &&str| folder.path().join(name).exists();
    assert!(kept.iter().all(&there) && !stale.iter().any(there));
}
