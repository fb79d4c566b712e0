use super::*;

#[test]
fn what_was_printed_agrees_with_itself() {
    let mut mean_max = [[0.0; 3]; 2];
    for table in &FLIGHT_TIMES_TABLES {
        let index = METHODS.iter().position(|m| m.name() == table.method).expect("a method");
        for times in table.times_s {
            mean_max[usize::from(table.is_long_track)][index] += ValueSummary::of(times).max / 12.0;
        }
    }
    for (ours, printed) in mean_max.iter().flatten().zip(MEAN_LARGEST_TIME_S.iter().flatten()) {
        assert!((ours - printed).abs() < 0.01, "{ours} {printed}");
    }
    assert!((ValueSummary::of(&TABLE_2_COSTS_M[2]).sd - 3.53).abs() < 0.01);
}

#[test]
fn fewer_vehicles_finish_sooner() {
    let mut tables = Tables { rows: Vec::new(), all_checks_passed: true, worst: None };
    table_4(&mut tables).expect("a plan");
    let [binpat, powell] = [&tables.rows[0].ours, &tables.rows[1].ours];
    let max = |costs: &[f64]| costs.iter().copied().fold(0.0, f64::max);
    assert!(
        tables.all_checks_passed && !binpat.contains(&0.0) && powell.contains(&0.0),
        "{binpat:?} {powell:?}"
    );
    assert!(max(powell) < max(binpat));
}
