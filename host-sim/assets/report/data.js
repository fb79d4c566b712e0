// What the page is given, as typed arrays, and small helpers. The other end of `decode` is `pack.rs`.

const report = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);

function decode(text, Type) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  // Typed arrays are in the machine's order, which is little-endian wherever a browser with WebGL runs.
  return new Type(bytes.buffer);
}

function element(tag, text, attributes = {}) {
  const e = document.createElement(tag);
  if (text !== undefined && text !== null) e.textContent = text;
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  return e;
}

const cssColor = ([r, g, b]) => `rgb(${r}, ${g}, ${b})`;
const isNumber = (v) => typeof v === "number" && Number.isFinite(v);
const fixed = (v, digits) => (isNumber(v) ? v.toFixed(digits) : "–");

const roadmap = report.roadmap && {
  nodes: decode(report.roadmap.nodes, Float32Array),
  edges: decode(report.roadmap.edges, Uint16Array),
};

const vehicles = report.vehicles.map((v, i) => ({
  ...v,
  color: v.color ?? report.palette[i],
  planned: decode(v.planned, Float32Array),
  track: decode(v.track, Float32Array),
}));
const outlines = (report.outlines ?? []).map((o) => ({ ...o, points: decode(o.points, Float32Array) }));

// A plan alone has no tracks, and none of the figures that only a flight can give.
const flown = report.command !== "cover" && vehicles.some((v) => v.track.length > 0);
const vehicleById = new Map(vehicles.map((v) => [v.id, v]));

const plots = report.plots.map((p) => ({
  ...p,
  curves: p.curves.map((c) => ({ ...c, t_s: decode(c.t_s, Float32Array), values: decode(c.values, Float32Array) })),
}));

const events = [...report.events].sort((a, b) => a.t_s - b.t_s);

const endTime = (() => {
  let end = 0;
  for (const v of vehicles) if (v.track.length > 0) end = Math.max(end, v.track[v.track.length - 4]);
  for (const e of events) end = Math.max(end, e.t_s);
  for (const c of plots.flatMap((p) => p.curves)) if (c.t_s.length > 0) end = Math.max(end, c.t_s[c.t_s.length - 1]);
  return end;
})();

// Index of the last track point at or before `t`, or -1.
function trackIndex(track, t) {
  let low = -1;
  let high = track.length / 4;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (track[4 * middle] <= t) low = middle;
    else high = middle;
  }
  return low;
}

// Position and speed of a vehicle at `t`, linear between track points; the start where nothing was flown.
function stateAt(vehicle, t) {
  const { track } = vehicle;
  if (track.length === 0) return { position: vehicle.start, speed: null };
  const last = track.length / 4 - 1;
  const i = Math.max(0, trackIndex(track, t));
  const at = (k) => [track[4 * k + 1], track[4 * k + 2], track[4 * k + 3]];
  const a = at(i);
  if (i === last) return { position: a, speed: 0 };
  const b = at(i + 1);
  const dt = track[4 * i + 4] - track[4 * i];
  const share = Math.min(1, Math.max(0, (t - track[4 * i]) / dt));
  const step = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
  return { position: a.map((c, k) => c + (b[k] - c) * share), speed: dt > 0 ? step / dt : 0 };
}
