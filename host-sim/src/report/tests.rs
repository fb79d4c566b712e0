use super::*;
use planner_core::Point;

#[test]
fn first_thirty_colors_differ() {
    let mut colors: Vec<_> = (0..30).map(vehicle_color).collect();
    colors.sort_unstable();
    colors.dedup();
    assert_eq!(colors.len(), 30);
}

#[test]
fn data_that_disagrees_with_itself_is_refused() {
    let roadmap = RoadmapLines { nodes: vec![Point::zeros()], edges: vec![[0, 1]] };
    assert!(check(&ReportData { roadmap: Some(roadmap), ..Default::default() }).is_err());
    let curve = Curve { t_s: vec![0.0, 1.0], values: vec![0.0], ..Default::default() };
    let plot = Plot { curves: vec![curve], ..Default::default() };
    assert!(check(&ReportData { plots: vec![plot], ..Default::default() }).is_err());
    assert!(check(&ReportData::default()).is_ok());
}
