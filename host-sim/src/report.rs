//! `report.html`: one self-contained page with the scene in 3D, a time slider, and plots.
//!
//! A command fills [`ReportData`] and calls [`page()`]. The page needs no network: its libraries
//! are inlined from `assets/vendor`, its own scripts from `assets/report`, and the data is JSON in
//! a `<script>` element, in which every long array is base64 of little-endian numbers (see
//! `pack`). Positions are ENU metres of the mission frame, times are seconds since the start of
//! the simulation.

mod coverage;
mod data;
mod figures;
mod pack;
mod page;
mod surface;
mod track;

use anyhow::Context;

pub use coverage::{CoverageLayers, ReportDivision, ReportPart, WaypointTransfer};
pub use data::{
    AreaOutline, Curve, Level, LogEvent, OutlineKind, Plot, PlotLimit, ReportData, ReportVehicle,
    RoadmapLines, SphereObstacle, vehicle_color,
};
pub use figures::{Chart, Figure, MapRoute, Panel, RouteMap, Series};
pub use surface::{MAX_FACES_OR_CREASES, MapSurface};
pub use track::{PictureFootprint, TrackPoint};

/// The report page as one self-contained HTML text of a few megabytes.
///
/// # Errors
/// The data is inconsistent: an edge names a node that does not exist, or a curve or chart has not
/// as many values as times or cases.
pub fn page(data: &ReportData) -> anyhow::Result<String> {
    check(data).context("cannot report")?;
    page::html(data)
}

/// Refuses inconsistent data.
fn check(data: &ReportData) -> anyhow::Result<()> {
    if let Some(roadmap) = &data.roadmap {
        let nodes = roadmap.nodes.len();
        let beyond = roadmap.edges.iter().flatten().find(|&&node| usize::from(node) >= nodes);
        anyhow::ensure!(beyond.is_none(), "roadmap: an edge names node {beyond:?} of {nodes}");
    }
    for curve in data.plots.iter().flat_map(|plot| &plot.curves) {
        let (times, values) = (curve.t_s.len(), curve.values.len());
        anyhow::ensure!(
            times == values,
            "plot curve {:?}: {times} times but {values} values",
            curve.name
        );
    }
    for figure in &data.figures {
        for panel in &figure.panels {
            let (Panel::Bars(chart) | Panel::Lines(chart)) = panel else { continue };
            let odd = chart.series.iter().find(|series| series.values.len() != chart.cases.len());
            anyhow::ensure!(
                odd.is_none(),
                "{}: {odd:?} beside {} cases",
                figure.name,
                chart.cases.len()
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
