// Header, summary, vehicle table, event log, and the switches of the layers.

const UNITS = [["_mps", "m/s"], ["_m", "m"], ["_s", "s"], ["_bytes", "B"]];

// `min_clearance_m` as ["Min clearance", "m"].
function nameAndUnit(key) {
  const [suffix, unit] = UNITS.find(([s]) => key.endsWith(s)) ?? ["", ""];
  const words = key.slice(0, key.length - suffix.length).replaceAll("_", " ").replace(/\bmin\b/, "smallest").replace(/\bmax\b/, "largest");
  return [words[0].toUpperCase() + words.slice(1), unit];
}

function valueText(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (!isNumber(value)) return typeof value === "object" ? JSON.stringify(value) : String(value);
  if (Number.isInteger(value)) return value.toLocaleString("en-GB").replaceAll(",", "\u202f");
  return Math.abs(value) >= 100 ? value.toFixed(1) : Math.abs(value) >= 0.1 ? value.toFixed(2) : value.toPrecision(3);
}

// How a safety figure stands against its limit: "ok", "bad" or "" where there is none.
function verdict(key, safety) {
  const value = safety[key];
  if (["wall_contacts", "violations", "deadlocks"].includes(key)) return value === 0 ? "ok" : "bad";
  if (key === "min_separation_m" && isNumber(value) && isNumber(safety.safety_distance_m)) return value >= safety.safety_distance_m ? "ok" : "bad";
  if (key === "min_clearance_m" && isNumber(value)) return value > 0 ? "ok" : "bad";
  return "";
}

// Seconds below a tenth read better as milliseconds.
function quantity(value, unit) {
  if (unit === "s" && isNumber(value) && value !== 0 && Math.abs(value) < 0.1) return [`${Number((value * 1000).toPrecision(2))}`, "ms"];
  return [valueText(value), isNumber(value) ? unit : ""];
}

function row(list, name, value, { unit = "", style = "", note = "" } = {}) {
  const [text, shownUnit] = quantity(value, unit);
  const dd = element("dd", text, { class: style });
  if (shownUnit) dd.append(element("small", ` ${shownUnit}`));
  if (note) dd.append(element("small", ` ${note}`));
  list.append(element("dt", name), dd);
}

const SAFETY_ORDER = ["wall_contacts", "violations", "deadlocks", "min_separation_m", "min_clearance_m"];

// Figures whose key names them badly.
const NAMES = { max_cost_s: "Largest cost", max_cost_m: "Longest route", mean_cost_s: "Mean cost", sd_cost_s: "Spread of costs", lower_bound_s: "Bound of the cost", gap: "Largest cost above the bound", ground_least_m: "Least height above ground", ground_most_m: "Greatest height above ground", steepest: "Steepest leg" };
const SHARES = ["gap", "steepest"];

// What comes first of a coverage mission, and by which name.
const COVERAGE_NAMES = { covered_share: "Area photographed", photos: "Pictures", waypoints: "Waypoints", left: "Waypoints without a picture", twice: "Waypoints flown twice", lanes: "Lanes", lane_m: "Between lanes", waypoint_m: "Between waypoints", angle_deg: "Lanes from east" };

// Downwards, so that 100 % is all; and in colour what a flight left out.
function coverageRow(list, key, value) {
  const style = !flown || !["covered_share", "left"].includes(key) ? "" : value === (key === "left" ? 0 : 1) ? "ok" : "bad";
  const share = key === "covered_share" && isNumber(value);
  const unit = share ? "%" : key === "angle_deg" ? "°" : nameAndUnit(key)[1];
  row(list, COVERAGE_NAMES[key], share ? Math.floor(value * 1e4) / 100 : value, { unit, style });
}

// The figures of one section of the result, the safety figures in order and with their limits.
function rows(list, section, figures) {
  const keys = Object.keys(figures).filter((key) => key !== "safety_distance_m" || !("min_separation_m" in figures)).filter((key) => !Array.isArray(figures[key]));
  if (section === "safety") keys.sort((a, b) => SAFETY_ORDER.indexOf(a) - SAFETY_ORDER.indexOf(b));
  const first = section === "coverage" ? Object.keys(COVERAGE_NAMES).filter((key) => key in figures) : [];
  for (const key of first) coverageRow(list, key, figures[key]);
  for (const key of keys.filter((key) => !first.includes(key))) {
    const [words, unit] = nameAndUnit(key);
    if (SHARES.includes(key) && isNumber(figures[key])) { row(list, NAMES[key], 100 * figures[key], { unit: "%" }); continue; }
    const name = NAMES[key] ?? words;
    const style = section === "safety" && flown ? verdict(key, figures) : "";
    const note = key === "min_separation_m" && isNumber(figures.safety_distance_m) ? `(limit ${valueText(figures.safety_distance_m)} m)` : "";
    row(list, name, figures[key], { unit: key === "bytes" ? "B" : unit, style, note });
  }
}

function buildHeader() {
  byId("title").textContent = report.title;
  byId("command").textContent = report.command;
  byId("program").textContent = report.generated_by;
  const { complete } = report.result ?? {};
  const state = byId("state");
  state.hidden = typeof complete !== "boolean";
  state.textContent = complete ? "Complete" : "Not complete";
  state.className = `pill ${complete ? "ok" : "bad"}`;
}

function buildSummary() {
  const host = byId("summary");
  const result = report.result ?? {};
  const ends = Array.isArray(result.vehicles) ? result.vehicles : [];
  if (!flown && ends.length > 0 && report.command !== "cover") {
    const assigned = ends.filter((v) => isNumber(v.goal)).length;
    if (assigned > 0 || ends.every((v) => v.end === "no goal")) row(host.appendChild(element("dl")), "Given a goal", `${assigned} of ${ends.length}`);
  }
  if (flown && ends.length > 0) {
    const top = host.appendChild(element("dl"));
    for (const [key, name] of [["reached", coverage ? "Back at their pad" : "Reached their goal"], ["landed", "Landed"]]) {
      if (!ends.some((v) => typeof v[key] === "boolean")) continue;
      const count = ends.filter((v) => v[key]).length;
      row(top, name, `${count} of ${ends.length}`, { style: count === ends.length ? "ok" : "bad" });
    }
  }
  const reasons = result.left?.reasons ?? [];
  if (reasons.length > 0) {
    const box = host.appendChild(element("div"));
    box.append(element("h3", "Left"));
    for (const reason of reasons) box.append(element("p", reason, { class: "bad" }));
  }
  const sections = { ...result, computing_time: report.timing };
  for (const section of ["safety", "totals", "coverage", "formation", "roadmap", "computing_time"]) {
    const figures = sections[section];
    if (section === "roadmap" && coverage) continue;
    if (!figures || typeof figures !== "object") continue;
    const folded = ["roadmap", "computing_time"].includes(section);
    const name = section[0].toUpperCase() + section.slice(1).replace("_", " ");
    const box = host.appendChild(element(folded ? "details" : "div"));
    box.append(element(folded ? "summary" : "h3", name));
    rows(box.appendChild(element("dl")), section, figures);
    if (Array.isArray(figures.routes)) box.append(costBars(figures));
  }
}

// Each route's cost as a bar, with a line at the lower bound.
function costBars({ routes, max_cost_s, lower_bound_s }) {
  const host = element("div", null, { class: "bars" });
  host.append(element("p", `Planned cost of each flight; white: no division costs less than ${fixed(lower_bound_s, 1)} s`));
  for (const route of [...routes].sort((a, b) => a.vehicle - b.vehicle)) {
    const bar = host.appendChild(element("div", `UAV ${route.vehicle}: ${fixed(route.cost_s, 1)} s`, { class: "bar" }));
    const color = cssColor(vehicleById.get(route.vehicle)?.color ?? [99, 197, 176]);
    bar.style.background = `linear-gradient(90deg, ${color} ${(100 * route.cost_s) / max_cost_s}%, transparent 0)`;
    bar.append(element("i", null, { style: `left: ${(100 * lower_bound_s) / max_cost_s}%`, title: "no division ends before" }));
  }
  return host;
}

// The table; `onSelect(id)` when a row is clicked. Returns `mark(id)`.
function buildVehicleTable(onSelect) {
  const results = new Map((report.result?.vehicles ?? []).map((v) => [v.id, v]));
  const head = element("tr");
  const columns = [["UAV"], ["goal"], ["landed"], ["path", "planned length, m"], ["flown", "flown length, m"], ["time", "flight time, s"], ["end", "how the mission ended"]];
  for (const [name, title] of columns) head.append(element("th", name, title ? { title } : {}));
  document.querySelector("#vehicles thead").append(head);
  const body = document.querySelector("#vehicles tbody");
  const rows = new Map();
  for (const v of vehicles) {
    const result = results.get(v.id) ?? {};
    const tr = element("tr", null, { tabindex: 0 });
    const id = element("td");
    id.append(element("span", null, { class: "swatch", style: `background: ${cssColor(v.color)}` }), v.id);
    const landed = flown && typeof result.landed === "boolean" ? element("td", result.landed ? "yes" : "no", { class: result.landed ? "ok" : "bad" }) : element("td", "–");
    const end = element("td", result.end ?? "–", { title: result.end ?? "" });
    tr.append(id, element("td", result.goal ?? v.goal_index ?? "–"), landed, element("td", fixed(result.path_m, 1)), element("td", fixed(flown ? result.flown_m : null, 1)), element("td", fixed(flown ? result.flight_time_s : null, 1)), end);
    tr.addEventListener("click", () => onSelect(v.id));
    tr.addEventListener("keydown", (e) => { if (e.key === "Enter") onSelect(v.id); });
    rows.set(v.id, tr);
    body.append(tr);
  }
  return (id) => rows.forEach((tr, key) => tr.classList.toggle("selected", key === id));
}

// The event log and its ticks over the slider. Returns `setTime(t)`.
function buildEvents(onSeek) {
  const list = byId("events");
  byId("event-section").hidden = events.length === 0;
  const items = events.map((e) => {
    const li = element("li");
    const who = element("span", e.vehicle ?? "all");
    const vehicle = vehicleById.get(e.vehicle);
    who.style.color = vehicle ? cssColor(vehicle.color) : "var(--muted)";
    li.append(element("time", e.t_s.toFixed(1)), who, element("span", e.text, { class: e.level }));
    li.addEventListener("click", () => onSeek(e.t_s));
    list.append(li);
    if (endTime > 0 && e.level !== "info") {
      const tick = byId("ticks").appendChild(element("i", null, { class: e.level }));
      tick.style.left = `${(100 * e.t_s) / endTime}%`;
    }
    return li;
  });
  let shown = -2;
  return (t) => {
    let now = -1;
    while (now + 1 < events.length && events[now + 1].t_s <= t + 1e-6) now += 1;
    if (now === shown) return;
    shown = now;
    items.forEach((li, i) => { li.classList.toggle("later", i > now); li.classList.toggle("now", i === now); });
    const item = items[Math.max(0, now)];
    if (item) list.scrollTop = item.offsetTop - list.clientHeight / 2;
  };
}

function buildLayers(view, asked) {
  const host = byId("layer-list");
  const check = (name, on, change, title = "") => {
    const label = element("label", null, { title });
    const box = element("input", null, { type: "checkbox" });
    box.checked = on;
    box.addEventListener("change", () => { change(box.checked); view.invalidate(); });
    label.append(box, name);
    host.append(label);
    change(on);
  };
  const layer = (name, key, on) => { if (view.layers[key].children.length > 0) check(name, on, (shown) => { view.layers[key].visible = shown; }); };
  if (view.map) {
    const style = element("select", null, { "aria-label": "Map style" });
    for (const name of ["x-ray", "solid", "off"]) style.append(element("option", name));
    style.addEventListener("change", () => { view.map.show(style.value); view.invalidate(); });
    if (["x-ray", "solid", "off"].includes(asked.get("map"))) style.value = asked.get("map");
    view.map.show(style.value);
    const line = element("div", null, { class: "row" });
    line.append(element("span", "Map"), style);
    host.append(line);
    const { min, max, drawn_m: cell } = report.map;
    const low = min[2];
    const high = max[2];
    const slider = (name, plane, sign, start) => {
      const label = element("div", null, { class: "row" });
      const value = element("output");
      const input = element("input", null, { type: "range", min: low, max: high, step: cell, value: start, "aria-label": name });
      const change = () => {
        const height = Number(input.value);
        plane.constant = sign * height + 1e-3;
        if (plane === cutAbove) view.map.cutAt(height);
        value.textContent = `${height.toFixed(2)} m`;
        view.invalidate();
      };
      input.addEventListener("input", change);
      label.append(element("span", name), value);
      host.append(label, input);
      change();
    };
    slider("Cut above", cutAbove, 1, Number(asked.get("cut")) || high);
    slider("Cut below", cutBelow, -1, low);
    host.append(element("hr"));
    if (report.map.creases.length > 0) check("Edges", true, (shown) => { view.map.creases.visible = shown; });
  }
  layer("Roadmap", "roadmap", true);
  layer("Area", "outlines", true);
  layer("Strips by UAV", "strips", true);
  layer("Footprints", "footprints", true);
  layer("Planned paths", "planned", true);
  layer(flown ? "Flown tracks" : "Planned tracks", "track", true);
  layer("Starts □ and goals ◇", "terminals", true);
  layer("Vehicles", "vehicles", true);
  check("Labels", true, view.setLabels);
  if (view.safetyDistance > 0) check("Safety distance", false, view.setRings, "Rings of half the safety distance: two that touch are at the limit");
  layer("Obstacles", "obstacles", true);
  layer("Grid", "grid", true);
  const notices = [];
  if (report.command === "cover") notices.push("Planned only: vehicles move as planned, at cruise speed");
  else if (vehicles.length > 0 && !flown) notices.push("Planned only: nothing was flown");
  if (report.map && report.map.drawn_m > report.map.resolution_m) notices.push(`Map drawn at ${report.map.drawn_m} m, planned at ${report.map.resolution_m} m`);
  byId("notice").hidden = notices.length === 0;
  byId("notice").textContent = notices.join(". ");
}
