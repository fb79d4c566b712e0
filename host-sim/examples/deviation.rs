use host_sim::*;
fn main() -> anyhow::Result<()> {
    for a in std::env::args().skip(1) {
        let s = scenario::load(std::path::Path::new(&a))?;
        let mut m = mission::Mission::prepare(s, &progress::Progress::hidden())?;
        let p = m.plan()?;
        let f = swarm::fly(&m, &p, "fly", false, &progress::Progress::hidden())?;
        for (i, t) in f.tracks.iter().enumerate() {
            let path = &p.flights[i].path;
            let mut worst = (0.0f32, 0.0f32, 0.0f32);
            for (ts, pos) in t {
                if pos.z < path.waypoints()[0].position.z - 0.05 { continue; }
                // distance to whole polyline
                let mut best = f32::INFINITY; let mut al = 0.0;
                for l in path.waypoints().windows(2) {
                    let d = l[1].position - l[0].position;
                    let s = ((pos - l[0].position).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
                    let e = (l[0].position + d * s - pos).norm();
                    if e < best { best = e; al = l[0].along_m + s * d.norm(); }
                }
                if al < path.length_m() - 0.01 && best > worst.0 { worst = (best, *ts, al); }
            }
            let k = path.waypoints().iter().position(|w| w.along_m >= worst.2).unwrap_or(0);
            println!("{a} v{} worst deviation {:.3} m at t {:.1} along {:.2} of {:.1}; wp {:?}", i + 1, worst.0, worst.1, worst.2, path.length_m(),
              path.waypoints()[k.saturating_sub(1)..(k+2).min(path.waypoints().len())].iter().map(|w| (w.along_m, w.clearance_m)).collect::<Vec<_>>());
        }
    }
    Ok(())
}
