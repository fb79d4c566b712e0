use super::*;
use crate::scenario;
use crate::scenario::coverage::CoverageMethod;

/// If no cell counts, nothing is known of the area: that is a fault, not a fully covered area.
#[test]
fn an_area_without_a_cell_that_counts_is_not_clean() {
    let text = "[area]\npolygon = [[0, 0], [400, 0], [400, 0.05], [0, 0.05]]\nheight_m = 20.0\n\
                lane_m = 10.0\nwaypoint_m = 5.0\n[mission]\ncruise_mps = 5.0\n\
                [[vehicles]]\nid = 1\nstart = [-10, -10, 0]\n";
    let scenario = scenario::parse(text, "narrow").unwrap();
    let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).unwrap();
    let fine = check_plan(&planned);
    assert!(fine.is_clean() && fine.cells_to_cover > 0 && fine.covered_share == 1.0, "{fine:?}");
    // Cells of one metre, whose centres all lie outside the area.
    let coarse = CoverageCells::new(&planned).halved_until_one_counts(&planned, 0.0);
    let mut findings = CoverageFindings::default();
    let flights = planned.flights();
    let pictures = planned_pictures(&planned, &flights_to_check(&planned, &flights));
    coarse.count_photographed_cells(&planned, pictures, &mut findings);
    assert_eq!((findings.cells_to_cover, findings.covered_share), (0, 0.0));
    assert!(!findings.is_clean() && !CoverageFindings::default().is_clean());
    let whole = CoverageFindings { covered_share: 1.0, ..CoverageFindings::default() };
    assert!(!whole.is_clean());
}
