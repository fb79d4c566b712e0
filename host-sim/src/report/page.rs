//! Assembles the HTML page: template, styles, libraries, scripts, data.

use serde::Serialize;

use super::data::{ReportData, vehicle_color};

/// The page, with places for style, scripts and data.
const TEMPLATE: &str = include_str!("../../assets/report/page.html");
/// The page's style sheets.
const STYLE: &str = concat!(
    include_str!("../../assets/vendor/uPlot.min.css"),
    include_str!("../../assets/report/style.css")
);
/// The libraries that the page's scripts use.
const LIBRARIES: &str = concat!(
    include_str!("../../assets/vendor/three.iife.min.js"),
    "\n",
    include_str!("../../assets/vendor/uPlot.iife.min.js")
);
/// All our own scripts in one function scope, so that none of their names is global.
const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("../../assets/report/data.js"),
    include_str!("../../assets/report/map.js"),
    include_str!("../../assets/report/scene.js"),
    include_str!("../../assets/report/coverage.js"),
    include_str!("../../assets/report/view.js"),
    include_str!("../../assets/report/panels.js"),
    include_str!("../../assets/report/plots.js"),
    include_str!("../../assets/report/figures.js"),
    include_str!("../../assets/report/main.js"),
    "})();\n"
);

/// The data as the scripts read it, as JSON.
#[derive(Serialize)]
struct PageData<'a> {
    /// The flight or plan that is shown.
    #[serde(flatten)]
    data: &'a ReportData,
    /// [`vehicle_color`] of each vehicle, by index; used for a vehicle without a `color`.
    palette: Vec<[u8; 3]>,
}

/// The whole page as HTML text.
pub(super) fn html(data: &ReportData) -> anyhow::Result<String> {
    let palette = (0..data.vehicles.len()).map(vehicle_color).collect();
    let json = script_safe(&serde_json::to_string(&PageData { data, palette })?);
    Ok(fill_template(TEMPLATE, |name| match name {
        "title" => html_escape(&data.title),
        "style" => STYLE.to_owned(),
        "libraries" => LIBRARIES.to_owned(),
        "script" => SCRIPT.to_owned(),
        "data" => json.clone(),
        _ => unreachable!("the template names only the parts above"),
    }))
}

/// Replaces each `{{name}}` by `part(name)`; the inserted text is not searched for names.
fn fill_template(template: &str, part: impl Fn(&str) -> String) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, tail) = after.split_once("}}").expect("the template closes what it opens");
        out.push_str(before);
        out.push_str(&part(name));
        rest = tail;
    }
    out.push_str(rest);
    out
}

/// Escapes text for HTML content.
fn html_escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Escapes `<`, `>` and `&` in JSON, so that no data can end the `<script>` element around it.
/// These characters occur only inside JSON strings, where `\\u003c` means the same as `<`.
fn script_safe(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

#[cfg(test)]
mod tests;
