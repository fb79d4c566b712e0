// Plots over time that share the cursor; pressing in one moves the time of the whole page.

const INK = { axis: "#8d98a3", grid: "#2a3036", limit: "#ff6370", now: "#dfe4e9" };
const CURVES = ["#4da3ff", "#ff9540", "#57d380", "#b48cff", "#40d8d8", "#ffd64d"];

// Aligned columns for uPlot: one time axis, gaps as null.
function columns(plot) {
  const tables = plot.curves.map((c) => [Array.from(c.t_s), Array.from(c.values, (v) => (Number.isFinite(v) ? v : null))]);
  return tables.length === 1 ? tables[0] : uPlot.join(tables);
}

// Value range that shows the curves, and the limit where it is near enough to matter.
function valueRange(plot, data) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of data.slice(1)) for (const v of column) if (isNumber(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (low > high) [low, high] = [0, 1];
  if (plot.limit) { low = Math.min(low, plot.limit.value); high = Math.max(high, plot.limit.value); }
  if (low >= 0 && low < 0.5 * high) low = 0;
  const margin = 0.08 * (high - low || 1);
  return [low === 0 ? 0 : low - margin, high + margin];
}

// Returns `setTime(t)`.
function buildPlots(onSeek) {
  const host = byId("plots");
  host.hidden = plots.length === 0;
  const sync = uPlot.sync("time");
  let time = 0;
  const charts = plots.filter((p) => p.curves.length > 0).map((plot) => {
    const box = host.appendChild(element("div", null, { class: "plot" }));
    const head = box.appendChild(element("h3", plot.title));
    if (plot.limit) head.append(element("span", `${plot.limit.label} ${valueText(plot.limit.value)} ${plot.unit}`, { class: "limit" }));
    const now = head.appendChild(element("span", "", { class: "now" }));
    const data = columns(plot);
    const range = valueRange(plot, data);
    const line = (u, horizontal, at, color, dash) => {
      const { ctx: pen, bbox } = u;
      pen.save();
      pen.beginPath();
      pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      pen.clip();
      pen.beginPath();
      pen.strokeStyle = color;
      pen.lineWidth = devicePixelRatio * 1.25;
      pen.setLineDash(dash.map((d) => d * devicePixelRatio));
      if (horizontal) { pen.moveTo(bbox.left, at); pen.lineTo(bbox.left + bbox.width, at); }
      else { pen.moveTo(at, bbox.top); pen.lineTo(at, bbox.top + bbox.height); }
      pen.stroke();
      pen.restore();
    };
    const many = plot.curves.length > 1;
    const chart = new uPlot({
      width: Math.max(200, box.clientWidth - 14),
      height: 132,
      legend: { show: false },
      cursor: { sync: { key: sync.key }, drag: { x: false, y: false }, points: { show: !many || plot.curves.length <= 4 } },
      scales: { x: { time: false, range: [0, endTime || 1] }, y: { range } },
      axes: [
        { stroke: INK.axis, grid: { stroke: INK.grid, width: 1 }, ticks: { stroke: INK.grid, width: 1, size: 4 }, size: 26, font: "11px system-ui, sans-serif", values: (u, ticks) => ticks.map((t) => `${t}`) },
        { stroke: INK.axis, grid: { stroke: INK.grid, width: 1 }, ticks: { stroke: INK.grid, width: 1, size: 4 }, size: 44, font: "11px system-ui, sans-serif" },
      ],
      series: [{}, ...plot.curves.map((c, i) => {
        const vehicle = vehicleById.get(c.vehicle);
        return { label: c.name, stroke: vehicle ? cssColor(vehicle.color) : CURVES[i % CURVES.length], width: many ? 1.1 : 1.6, points: { show: false }, spanGaps: many };
      })],
      hooks: {
        draw: [(u) => {
          if (plot.limit) line(u, true, u.valToPos(plot.limit.value, "y", true), INK.limit, [5, 4]);
          line(u, false, u.valToPos(time, "x", true), INK.now, []);
        }],
      },
    }, data, box);
    const seek = (e) => {
      const left = e.clientX - chart.over.getBoundingClientRect().left;
      onSeek(chart.posToVal(left, "x"));
    };
    chart.over.addEventListener("pointerdown", (e) => { chart.over.setPointerCapture(e.pointerId); seek(e); });
    chart.over.addEventListener("pointermove", (e) => { if (e.buttons & 1) seek(e); });
    new ResizeObserver(() => {
      const width = Math.max(200, box.clientWidth - 14);
      if (width !== chart.width) chart.setSize({ width, height: 132 });
    }).observe(box);
    const readout = () => {
      const values = plot.curves.map((c) => valueAt(c, time)).filter(isNumber);
      if (values.length === 0) now.textContent = "–";
      else if (values.length === 1) now.textContent = `${values[0].toFixed(2)} ${plot.unit}`;
      else now.textContent = `${Math.min(...values).toFixed(2)} … ${Math.max(...values).toFixed(2)} ${plot.unit}`;
    };
    return { chart, readout };
  });
  return (t) => {
    time = t;
    for (const { chart, readout } of charts) { readout(); chart.redraw(false); }
  };
}

// The curve's value at or before `t`.
function valueAt(curve, t) {
  let low = -1;
  let high = curve.t_s.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (curve.t_s[middle] <= t) low = middle;
    else high = middle;
  }
  return low >= 0 ? curve.values[low] : NaN;
}
