// Figures below the scene, as SVG: routes from above, bars and lines by case.

const FIGURE = { width: 560, height: 260, left: 44, right: 8, top: 8, bottom: 58 };
const MAP_SIDE = 270;
const SVG = "http://www.w3.org/2000/svg";

function shape(parent, tag, attributes, text) {
  const e = parent.appendChild(document.createElementNS(SVG, tag));
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  if (text !== undefined) e.textContent = text;
  return e;
}

const canvas = (parent, width, height) => shape(parent, "svg", { viewBox: `0 0 ${width} ${height}`, width, height });

// A round step that gives about so many ticks.
function tickStep(high, count) {
  const rough = (high || 1) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
}

function pointsOf(text) {
  const xyz = decode(text, Float32Array);
  return Array.from({ length: xyz.length / 3 }, (_, i) => [xyz[3 * i], xyz[3 * i + 1]]);
}

function drawMap(box, panel) {
  const area = pointsOf(panel.area);
  const routes = panel.routes.map((r) => ({ ...r, path: pointsOf(r.path), at: r.start }));
  const all = [...area, ...routes.flatMap((r) => [...r.path, r.at])];
  const low = [0, 1].map((k) => Math.min(...all.map((p) => p[k])));
  const high = [0, 1].map((k) => Math.max(...all.map((p) => p[k])));
  const margin = 14;
  const scale = (MAP_SIDE - 2 * margin) / Math.max(high[0] - low[0], high[1] - low[1], 1);
  const size = [0, 1].map((k) => (high[k] - low[k]) * scale + 2 * margin);
  const svg = canvas(box, MAP_SIDE, size[1] + 18);
  const x = (p) => (MAP_SIDE - size[0]) / 2 + margin + (p[0] - low[0]) * scale;
  const y = (p) => size[1] - margin - (p[1] - low[1]) * scale;
  const line = (points) => points.map((p) => `${x(p).toFixed(1)},${y(p).toFixed(1)}`).join(" ");
  shape(svg, "polygon", { points: line(area), class: "area" });
  for (const [i, r] of routes.entries()) {
    const color = cssColor(vehicleById.get(r.vehicle)?.color ?? report.palette[i] ?? [140, 150, 160]);
    shape(svg, "polyline", { points: line(r.path), class: "route", stroke: color });
    shape(svg, "circle", { cx: x(r.at), cy: y(r.at), r: 4.5, fill: r.path.length > 0 ? color : "none", stroke: color, "stroke-width": 1.5 });
    shape(svg, "text", { x: x(r.at), y: y(r.at) + 14, class: "tick", "text-anchor": "middle" }, r.vehicle);
  }
  const bar = tickStep(high[0] - low[0], 4);
  shape(svg, "path", { d: `M${MAP_SIDE - margin - bar * scale},${size[1] + 10}h${bar * scale}`, class: "axis" });
  shape(svg, "text", { x: MAP_SIDE - margin - bar * scale - 5, y: size[1] + 14, class: "tick", "text-anchor": "end" }, `${bar} m`);
}

// The largest value of all charts that share a scale.
function largest(panel) {
  const same = report.figures.flatMap((f) => f.panels).filter((p) => p.series && p.scale === panel.scale);
  return Math.max(...same.flatMap((p) => p.series.flatMap((s) => s.values)));
}

function drawChart(box, panel) {
  const { width, height, left, right, top, bottom } = FIGURE;
  const svg = canvas(box, width, height);
  const high = largest(panel) * 1.04;
  const y = (v) => height - bottom - (v / high) * (height - top - bottom);
  const step = tickStep(high, 5);
  for (let v = 0; v <= high; v += step) {
    shape(svg, "path", { d: `M${left},${y(v)}H${width - right}`, class: "grid" });
    shape(svg, "text", { x: left - 5, y: y(v) + 4, class: "tick", "text-anchor": "end" }, Number(v.toPrecision(6)));
  }
  shape(svg, "text", { x: 0, y: 0, class: "tick", "text-anchor": "middle", transform: `translate(11 ${(height - bottom + top) / 2}) rotate(-90)` }, panel.unit);
  const wide = (width - left - right) / panel.cases.length;
  const middle = (i) => left + wide * (i + 0.5);
  for (const [i, name] of panel.cases.entries()) {
    shape(svg, "text", { class: "tick", "text-anchor": "end", transform: `translate(${middle(i) + 4} ${height - bottom + 12}) rotate(-40)` }, name);
  }
  const count = panel.series.length;
  for (const [k, s] of panel.series.entries()) {
    const color = CURVES[k % CURVES.length];
    if (panel.kind === "bars") {
      const own = (0.8 * wide) / count;
      for (const [i, v] of s.values.entries()) {
        const bar = shape(svg, "rect", { x: middle(i) - 0.4 * wide + own * k, y: y(v), width: own * 0.92, height: y(0) - y(v), fill: color });
        shape(bar, "title", {}, `${s.name}, ${panel.cases[i]}: ${valueText(v)} ${panel.unit}`);
      }
    } else {
      shape(svg, "polyline", { points: s.values.map((v, i) => `${middle(i)},${y(v)}`).join(" "), class: "curve", stroke: color });
      for (const [i, v] of s.values.entries()) {
        const dot = shape(svg, "circle", { cx: middle(i), cy: y(v), r: 2.6, fill: color });
        shape(dot, "title", {}, `${s.name}, ${panel.cases[i]}: ${valueText(v)} ${panel.unit}`);
      }
    }
  }
  const legend = box.appendChild(element("p", null, { class: "legend" }));
  for (const [k, s] of panel.series.entries()) {
    const entry = legend.appendChild(element("span"));
    entry.append(element("i", null, { style: `background: ${CURVES[k % CURVES.length]}` }), s.name);
  }
}

function buildFigures() {
  const figures = report.figures ?? [];
  const host = byId("figures");
  host.hidden = figures.length === 0;
  document.body.classList.toggle("with-figures", figures.length > 0);
  document.body.dataset.figures = figures.length;
  for (const figure of figures) {
    const box = host.appendChild(element("figure"));
    const charts = figure.panels.every((p) => p.kind !== "map");
    const panels = box.appendChild(element("div", null, { class: charts ? "panels charts" : "panels" }));
    for (const panel of figure.panels) {
      const part = panels.appendChild(element("div", null, { class: "panel" }));
      part.append(element("h3", panel.title));
      if (panel.kind === "map") drawMap(part, panel);
      else drawChart(part, panel);
      if (panel.note) part.append(element("p", panel.note, { class: "note" }));
    }
    const caption = box.appendChild(element("figcaption"));
    caption.append(element("b", figure.name), ` ${figure.caption}`);
  }
}
