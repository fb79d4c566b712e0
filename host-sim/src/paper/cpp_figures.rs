//! Figs. 8, 9, 10, 12 and 13 of paper CPP, drawn with our plans. The paper prints them as pictures
//! only: its values in Figs. 12 and 13 are drawn here from the times in its Tables A1 to A12. It
//! does not state the areas of Figs. 8 to 10; ours are in `cpp.rs`.

use planner_core::Point;
use planner_core::coverage::area::RingKind;

use super::cpp_rows::{TableRow, ValueSummary};
use crate::coverage::CoveragePlan;
use crate::report::{Chart, Figure, MapRoute, Panel, RouteMap, Series};
use crate::result::rounded;
use crate::scenario::Scenario;
use crate::scenario::coverage::CoverageMethod;

/// Numbers of UAVs: Fig. 12 has two panels for each, ours and the paper's.
const FLEET_SIZES: [usize; 2] = [3, 5];
/// Tracks: Fig. 13 has two panels for each, ours and the paper's.
const TRACKS: [&str; 2] = ["short", "long"];

/// Fig. 8: an area with its UAVs, and the routes of three methods. Fig. 9: those routes in two
/// further areas, without the routes of other works. Fig. 10: a fleet that finishes sooner with
/// fewer UAVs.
///
/// # Errors
/// As [`CoveragePlan::new`].
pub(super) fn route_figures(
    convex: &Scenario,
    others: &[Scenario; 2],
    small: &Scenario,
) -> anyhow::Result<[Figure; 3]> {
    let three = [
        (CoverageMethod::SimpleBinpat, "SIMPLE-BINPAT"),
        (CoverageMethod::Binpat, "BINPAT"),
        (CoverageMethod::PowellBinpat, "POWELL-BINPAT"),
    ];
    let mut fig_8 = vec![route_map(
        "(a) area and UAVs".to_owned(),
        &CoveragePlan::new(convex, CoverageMethod::Binpat)?,
        MapContent::Area,
    )];
    for ((method, name), letter) in three.iter().zip('b'..) {
        fig_8.push(route_map(
            format!("({letter}) {name}"),
            &CoveragePlan::new(convex, *method)?,
            MapContent::Routes,
        ));
    }
    let mut fig_9 = Vec::new();
    for ((method, name), letters) in three.iter().zip([['c', 'd'], ['e', 'f'], ['g', 'h']]) {
        for (scenario, letter) in others.iter().zip(letters) {
            fig_9.push(route_map(
                format!("({letter}) {name}"),
                &CoveragePlan::new(scenario, *method)?,
                MapContent::Routes,
            ));
        }
    }
    let mut fig_10 = Vec::new();
    for ((method, name), letter) in three[1..].iter().zip('a'..) {
        fig_10.push(route_map(
            format!("({letter}) {name}"),
            &CoveragePlan::new(small, *method)?,
            MapContent::Routes,
        ));
    }
    let figure = |name: &str, caption: &str, panels| Figure {
        name: name.to_owned(),
        caption: caption.to_owned(),
        panels,
    };
    Ok([
        figure(
            "Fig. 8",
            "Routes of the three methods in the area of Table 2 (ours: theirs is not stated).",
            fig_8,
        ),
        figure(
            "Fig. 9",
            "The same with two more areas (ours). (a) and (b) of the paper are routes of other works, which are not drawn again.",
            fig_9,
        ),
        figure(
            "Fig. 10",
            "Table 4's case: POWELL-BINPAT leaves the UAV that is far away on the ground, and all is done sooner.",
            fig_10,
        ),
    ])
}

/// What a map from above shows.
#[derive(Clone, Copy, PartialEq)]
enum MapContent {
    /// The area and the UAVs.
    Area,
    /// Also the routes, and their costs.
    Routes,
}

/// A map from above.
fn route_map(title: String, planned: &CoveragePlan<'_>, content: MapContent) -> Panel {
    let corners = planned.area_settings.rings_of(RingKind::Outer).flatten();
    let flights = planned.flights();
    let (mut costs, mut most_s) = (Vec::new(), 0.0f32);
    let vehicles = planned.scenario.vehicles.iter().enumerate();
    let route = |(index, vehicle): (usize, &crate::scenario::VehicleSection)| {
        let own =
            flights.iter().find(|(sortie, _, _)| usize::from(sortie.route.vehicle_index) == index);
        let own = own.filter(|_| content == MapContent::Routes);
        let (cost_m, cost_s) =
            own.map_or((0.0, 0.0), |(sortie, _, _)| (sortie.route.cost_m, sortie.route.cost_s));
        costs.push(cost_m);
        most_s = most_s.max(cost_s);
        let path = own.map_or(Vec::new(), |(_, points, _)| {
            points.iter().map(|point| point.position).collect()
        });
        MapRoute { vehicle: vehicle.id, start: vehicle.start, path }
    };
    let routes = vehicles.map(route).collect();
    let most_m = costs.iter().copied().fold(0.0, f32::max);
    let all: Vec<String> = costs.iter().map(|cost_m| format!("{cost_m:.0}")).collect();
    Panel::Map(RouteMap {
        title,
        note: match content {
            MapContent::Area => String::new(),
            MapContent::Routes => {
                format!("{} m; at most {most_m:.1} m, {most_s:.1} s", all.join(", "))
            }
        },
        area: corners.map(|corner| Point::new(corner.x, corner.y, 0.0)).collect(),
        routes,
    })
}

/// Whose values a panel shows: ours, or those that the paper printed.
#[derive(Clone, Copy)]
enum ValueSource {
    Ours,
    Theirs,
}

impl ValueSource {
    /// Both sources, each with its name in a panel's title.
    const BOTH: [(Self, &'static str); 2] =
        [(Self::Ours, "ours, planned"), (Self::Theirs, "theirs, flown in Gazebo")];

    /// The row's summary of these values; `None` without one.
    fn summary_of(self, row: &TableRow) -> Option<ValueSummary> {
        match self {
            Self::Ours => row.ours_summary,
            Self::Theirs => row.theirs_summary,
        }
    }
}

/// Fig. 12: average time of the UAVs by case, for three and five UAVs. Fig. 13: coefficient of
/// variation (CV) by case, on the short and the long track.
pub(super) fn spread_figures(rows: &[TableRow]) -> [Figure; 2] {
    let rows: Vec<&TableRow> = rows.iter().filter(|row| row.track.is_some()).collect();
    let (mut times, mut spreads) = (Vec::new(), Vec::new());
    for (fleet, letter) in FLEET_SIZES.into_iter().zip('a'..) {
        for (whose, name) in ValueSource::BOTH {
            let title = format!("({letter}) {fleet} UAVs: {name}");
            let own = |row: &&&TableRow| row.ours.len() == fleet;
            let value = |row: &TableRow| whose.summary_of(row).map(|summary| summary.mean);
            let own: Vec<&TableRow> = rows.iter().filter(own).copied().collect();
            times.push(Panel::Bars(chart(title, ("Av, s", "average"), &own, value)));
        }
    }
    for (track, letter) in TRACKS.into_iter().zip('a'..) {
        for (whose, name) in ValueSource::BOTH {
            let title = format!("({letter}) {track} track: {name}");
            let own: Vec<&TableRow> =
                rows.iter().filter(|row| row.track == Some(track)).copied().collect();
            let value = |row: &TableRow| whose.summary_of(row).map(|summary| summary.cv_percent);
            spreads.push(Panel::Lines(chart(title, ("CV, %", "spread"), &own, value)));
        }
    }
    [
        Figure {
            name: "Fig. 12".to_owned(),
            caption: "Average time of the UAVs in Tables A1 to A12: track, lane spacing and height. Ours are planned costs, \
                      without turns."
                .to_owned(),
            panels: times,
        },
        Figure {
            name: "Fig. 13".to_owned(),
            caption: "CV = 100 · SD / Av of the same. Theirs from their printed times: the CV printed in A1 to A3 was divided \
                      by UAV 3's time."
                .to_owned(),
            panels: spreads,
        },
    ]
}

/// A chart of rows: one series a method (and number of UAVs, if the rows differ in it), one case a
/// pair of spacing and height (and track, if the rows differ in it). Charts with the same `scale`
/// have the same largest value on their axes.
fn chart(
    title: String,
    (unit, scale): (&str, &'static str),
    rows: &[&TableRow],
    value: impl Fn(&TableRow) -> Option<f64>,
) -> Chart {
    let fleets = rows.iter().any(|row| row.ours.len() != rows[0].ours.len());
    let tracks = rows.iter().any(|row| row.track != rows[0].track);
    let (mut cases, mut series) = (Vec::<String>::new(), Vec::<Series>::new());
    for row in rows {
        let track = if tracks { row.track.unwrap_or_default() } else { "" };
        let case = format!("{track} {}/{}", row.lane_m, row.height_m).trim().to_owned();
        if !cases.contains(&case) {
            cases.push(case);
        }
        let fleet = if fleets { format!(", {} UAVs", row.ours.len()) } else { String::new() };
        let name = format!("{}{fleet}", row.method);
        if !series.iter().any(|own| own.name == name) {
            series.push(Series { name: name.clone(), values: Vec::new() });
        }
        // The rows of each series come in the order of the cases, so values can be appended.
        if let (Some(own), Some(value)) =
            (series.iter_mut().find(|own| own.name == name), value(row))
        {
            own.values.push(rounded(value as f32));
        }
    }
    Chart { title, unit: unit.to_owned(), cases, series, scale_group: scale }
}
