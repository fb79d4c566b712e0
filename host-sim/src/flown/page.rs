//! The report page of a flight.

use crate::mission::{HostPlan, PreparedMission};
use crate::output::planned_page;
use crate::report::{Curve, Plot, PlotLimit, ReportData, TrackPoint};
use crate::swarm::SwarmFlight;
use crate::swarm::referee::DistanceSample;

/// Report page of a flown mission: the page of its plan, with tracks, event log and plots of the
/// smallest distances.
pub fn flown_page(
    mission: &PreparedMission,
    plan: &HostPlan,
    flight: &SwarmFlight,
) -> anyhow::Result<ReportData> {
    let mut page = planned_page(mission, plan, &flight.result)?;
    let flown = flight.tracks.iter().zip(&flight.power_lost_at_s);
    for (vehicle, (track, lost_s)) in page.vehicles.iter_mut().zip(flown) {
        vehicle.track = track.iter().map(|&(t_s, position)| TrackPoint { t_s, position }).collect();
        vehicle.power_lost_at_s = *lost_s;
    }
    page.events = flight.log.clone();
    let t_s: Vec<f32> = flight.samples.iter().map(|s| s.t_s).collect();
    let plot = |title: &str, limit: PlotLimit, value: fn(&DistanceSample) -> f32| Plot {
        title: title.to_owned(),
        unit: "m".to_owned(),
        limit: Some(limit),
        curves: vec![Curve {
            name: "smallest".to_owned(),
            vehicle: None,
            t_s: t_s.clone(),
            values: flight.samples.iter().map(value).collect(),
        }],
    };
    let safety = PlotLimit {
        value: mission.scenario.deconfliction.safety_distance_m,
        label: "safety distance".to_owned(),
    };
    let largest_m = mission.scenario.vehicles.iter().map(|v| v.radius_m).fold(0.0, f32::max);
    let body = PlotLimit { value: largest_m, label: "vehicle radius".to_owned() };
    page.plots = vec![plot("Smallest separation", safety, |s| s.min_separation_m)];
    // A coverage mission has no walls, so no clearance to them is plotted.
    if !mission.scenario.covers_area() {
        page.plots.push(plot("Smallest wall clearance", body, |s| s.min_clearance_m));
    }
    Ok(page)
}
