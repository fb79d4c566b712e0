//! Figures below the 3D scene: route maps, bar charts and line charts. `figures.js` draws them.

use planner_core::Point;
use serde::Serialize;

use super::pack;

/// A figure: its panels side by side, and a caption.
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
    /// Routes from above, over the area's border.
    Map(RouteMap),
    /// A chart with a bar for each case and series.
    Bars(Chart),
    /// A chart with a line for each series, over the cases.
    Lines(Chart),
}

/// A map of routes seen from above, metres.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RouteMap {
    /// Heading of the panel.
    pub title: String,
    /// Note below the panel.
    pub note: String,
    /// Corners of the area.
    #[serde(serialize_with = "pack::points")]
    pub area: Vec<Point>,
    /// Start and path of each vehicle; the path is empty where no route is drawn.
    pub routes: Vec<MapRoute>,
}

/// A vehicle's start and path on a route map.
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
    /// Name of the value axis: charts of the page with the same name have the same largest value.
    #[serde(rename = "scale")]
    pub scale_group: &'static str,
}

/// One series of a chart: a value for each case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Series {
    /// Name of the series.
    pub name: String,
    /// Values, one for each case, in the order of the cases.
    pub values: Vec<f64>,
}
