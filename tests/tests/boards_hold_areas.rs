//! If a board cannot hold an area's mission, planning reports it, before anything is uploaded.

use host_sim::capacity::{BOARD_NO_FLY_CORNERS, BOARDS};
use host_sim::coverage::CoveragePlan;
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;

/// A regular polygon.
fn polygon(corners: usize, [x, y]: [f64; 2], radius_m: f64) -> String {
    let corner = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos();
        format!("[{:.3}, {:.3}]", x + radius_m * cos, y + radius_m * sin)
    };
    let corners: Vec<String> = (0..corners).map(corner).collect();
    format!("[{}]", corners.join(", "))
}

/// An area with vehicles south of it.
fn field(area: &str, height_m: f64, vehicles: usize, south_m: f64) -> String {
    let vehicle = |id: usize| {
        let x = 6.0 * id as f64;
        format!(
            "[[vehicles]]\nid = {id}\nendurance_s = 36000.0\nspeed_max_mps = 12.0\nstart = [{x}, {south_m}, 0]\n"
        )
    };
    let vehicles: String = (1..=vehicles).map(vehicle).collect();
    format!(
        "[area]\n{area}\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = {height_m}\noverlap_side = 0.5\n\
         [mission]\ncruise_mps = 3.0\n{vehicles}[simulation]\nestimator = \"rtk\"\nradio_range_m = 3000.0\n"
    )
}

/// For each board what it cannot hold of the area (`None`: it holds all), and the number of lanes.
fn excess(text: &str) -> ([Option<String>; 3], usize) {
    let scenario = || scenario::parse(text, "area").expect("a good scenario");
    let lanes = CoveragePlan::plan_as_companions(&scenario()).expect("lanes").tracks.lanes().len();
    let mut mission = PreparedMission::prepare(scenario(), &Progress::hidden()).expect("an area");
    let plan = mission.plan().expect("a plan");
    (BOARDS.each_ref().map(|board| mission.board_limit_exceeded(&plan, board)), lanes)
}

#[test]
fn vertices_zones_and_lanes_beyond_a_boards_are_named() {
    for vertices in [3, 255, 256, 257, 300] {
        let area = format!("polygon = {}", polygon(vertices, [0.0, 60.0], 50.0));
        for excess in excess(&field(&area, 20.0, 2, -8.0)).0 {
            assert_eq!(
                excess.is_some_and(|why| why.contains("vertices")),
                vertices > 256,
                "{vertices}"
            );
        }
    }
    for corners in [16, 17] {
        let zones =
            [[-20.0, 60.0], [20.0, 60.0]].map(|middle| polygon(corners, middle, 6.0)).join(", ");
        let area = format!("polygon = {}\nno_fly = [{zones}]", polygon(8, [0.0, 60.0], 50.0));
        for excess in excess(&field(&area, 20.0, 2, -8.0)).0 {
            assert_eq!(
                excess.is_some_and(|why| why.contains("corners")),
                2 * corners > BOARD_NO_FLY_CORNERS
            );
        }
    }
    let mut seen = [false; 2];
    for width_m in [60.0, 1600.0] {
        let area = format!(
            "polygon = [[0, 0], [{width_m}, 0], [{width_m}, 30], [0, 30]]\nangle_deg = 90.0"
        );
        let (excess, lanes) = excess(&field(&area, 8.0, 16, -8.0));
        let says = |why: &Option<String>| why.as_ref().is_some_and(|why| why.contains("lanes"));
        assert_eq!(says(&excess[2]), lanes > 256, "{lanes} {excess:?}");
        assert_eq!(says(&excess[0]), lanes > 512, "{lanes} {excess:?}");
        seen[usize::from(lanes > 256)] = true;
    }
    assert_eq!(seen, [true; 2], "few lanes and many");
}
