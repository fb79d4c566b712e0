//! Figures below the scene: small maps of routes, bars and lines by case. `figures.js` draws them.

use planner_core::Point;
use serde::Serialize;

use super::pack;

/// A figure: panels side by side.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Name of the figure, such as `Fig. 8`.
    pub name: String,
    /// Caption of the figure.
    pub caption: String,
    /// Panels of the figure, in order.
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
    /// Heading of the panel.
    pub title: String,
    /// Note below the panel.
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
    /// Start of the path.
    #[serde(serialize_with = "pack::point")]
    pub start: Point,
    /// Path from pad to pad.
    #[serde(serialize_with = "pack::points")]
    pub path: Vec<Point>,
}

/// Values by case and series.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// Heading of the panel.
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
    /// Name of the series.
    pub name: String,
    /// Values, as many as cases.
    pub values: Vec<f64>,
}
