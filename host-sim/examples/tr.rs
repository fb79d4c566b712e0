use host_sim::map::building;
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::scenario;
fn main() {
    let n: usize = std::env::args().nth(1).map_or(60, |x| x.parse().unwrap());
    let mut text = String::from(
        "[map]\nfile = \"builtin:building\"\nresolution_m = 0.25\n[roadmap]\nnodes = 2300\nedge_min_m = 0.5\nedge_max_m = 8.0\nsafety_margin_m = 0.0\n[mission]\ngoals = [",
    );
    let along = |i: usize| 8.5 + 2.5 * i as f32;
    for i in 0..10 {
        let floor = 1 + i % (building::FLOORS as usize - 1);
        let x = if i % 2 == 0 { 12.1 } else { 29.1 } + if i < 8 { 0.0 } else { 2.0 };
        text += &format!("[{x}, {}, {}], ", 12.1, floor as f32 * building::FLOOR_HEIGHT_M + 1.6);
    }
    text += "]\n";
    for i in 0..10 {
        text += &format!("[[vehicles]]\nid = {}\nstart = [{}, {}, {}]\n", i + 1, along(i), 4.0, 1.5);
    }
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let all: Vec<_> = (0..n)
            .map(|_| {
                pool.install(|| {
                    let m = Mission::prepare(scenario::parse(&text, "x.toml").unwrap(), &Progress::hidden())
                        .unwrap();
                    assert!(m.roadmap.edges.len() > 1000);
                    if std::env::var("SHOW").is_ok() {
                        println!(
                            "{} edges, sum {:.3}",
                            m.roadmap.edges.len(),
                            m.roadmap.edges.iter().map(|e| f64::from(e.clearance_m)).sum::<f64>()
                        );
                    }
                    m.timing
                })
            })
            .collect();
        let part = |f: &dyn Fn(&host_sim::result::Timing) -> f64| {
            let mut v: Vec<f64> = all.iter().map(|t| f(t) * 1e3).collect();
            v.sort_by(f64::total_cmp);
            format!("{:.2}/{:.2}", v[0], v[v.len() / 2])
        };
        println!(
            "{threads} threads, min/median: map {} roadmap {} boxes {} nodes {} edges {} file {}",
            part(&|t| t.map_s),
            part(&|t| t.roadmap_s),
            part(&|t| t.roadmap_parts.boxes_s),
            part(&|t| t.roadmap_parts.nodes_s),
            part(&|t| t.roadmap_parts.edges_s),
            part(&|t| t.roadmap_parts.file_s)
        );
    }
}
