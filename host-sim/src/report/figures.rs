//! Figures below the scene: small maps of routes, bars and lines by case. `figures.js` draws them.

use planner_core::Point;
use serde::Serialize;

use super::pack;

/// A figure: panels side by side.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Such as `Fig. 8`.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Its panels, in order.
    pub panels: Vec<Panel>,
}

/// One panel.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Panel {
    /// Routes from above.
    Map(RouteMap),
    /// A bar for each case and series.
    Bars(Chart),
    /// A line over the cases for each series.
    Lines(Chart),
}

/// Routes from above, metres.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RouteMap {
    /// Its heading.
    pub title: String,
    /// What stands below it.
    pub note: String,
    /// Corners of the area.
    #[serde(serialize_with = "pack::points")]
    pub area: Vec<Point>,
    /// Each vehicle's place, and its way; empty where it has none.
    pub routes: Vec<MapRoute>,
}

/// A vehicle on a map.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MapRoute {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Where it starts.
    #[serde(serialize_with = "pack::point")]
    pub start: Point,
    /// From pad to pad.
    #[serde(serialize_with = "pack::points")]
    pub path: Vec<Point>,
}

/// Values by case and series.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// Its heading.
    pub title: String,
    /// Unit of the values.
    pub unit: String,
    /// Names of the cases, along the axis.
    pub cases: Vec<String>,
    /// The series.
    pub series: Vec<Series>,
    /// Charts with the same word here have one scale.
    pub scale: &'static str,
}

/// One series: a value for each case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// As many as cases.
    pub values: Vec<f64>,
}
