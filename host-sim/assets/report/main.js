// The page's state: time, playing, selection; keyboard, and what the address asks for.
//
// `?t=SECONDS` or `#t=SECONDS` sets the time, `view=iso|top|front|side` the camera, `select=ID` and
// `follow=ID` a vehicle, `map=x-ray|solid|off` and `cut=METRES` how the map is drawn. After the first frame
// `document.body.dataset` holds `ready` and counts of what was drawn.

const ICONS = { play: "M3 1v12l10-6z", pause: "M3 1h3v12H3zM8 1h3v12H8z" };
const state = { time: 0, playing: false, selected: null, frame: 0 };

function reportWithoutScene(host) {
  for (const e of host.querySelectorAll(".float, #triad")) e.hidden = true;
  byId("notice").hidden = false;
  byId("notice").textContent = "This browser offers no WebGL: the scene is missing, tables and plots are whole.";
  document.body.dataset.ready = "no-webgl";
  return null;
}

// First: what stands below the scene brings the page's scroll bar.
buildFigures();
buildHeader();
buildSummary();
const markRow = buildVehicleTable((id) => select(state.selected === id ? null : id));
const showDivision = buildDivisions((t) => seek(t));
const showEvents = buildEvents((t) => seek(t));
const showPlots = buildPlots((t) => seek(t));
byId("scenario").hidden = report.scenario_toml === "";
document.querySelector("#scenario pre").textContent = report.scenario_toml;
byId("transport").hidden = endTime === 0;
// Last, when the panels around it have their sizes.
const hasWebGl = Boolean(document.createElement("canvas").getContext("webgl2"));
const view = hasWebGl ? buildView(byId("view"), (id) => select(id)) : reportWithoutScene(byId("view"));

function setTime(t) {
  state.time = Math.min(endTime, Math.max(0, t));
  byId("time").value = state.time;
  byId("clock").textContent = `${state.time.toFixed(1)} / ${endTime.toFixed(1)} s`;
  document.body.dataset.t = state.time.toFixed(2);
  view?.setTime(state.time);
  showDivision(state.time);
  showEvents(state.time);
  showPlots(state.time);
  showSelected();
}

function seek(t) {
  setPlaying(false);
  setTime(t);
}

function select(id) {
  state.selected = id;
  markRow(id);
  view?.select(id);
  showSelected();
}

function showSelected() {
  const vehicle = vehicleById.get(state.selected);
  byId("hud").hidden = !vehicle || !view;
  if (!vehicle) return;
  const { position: [e, n, u], speed } = stateAt(vehicle, state.time);
  const lost = isNumber(vehicle.lost_s) && state.time >= vehicle.lost_s ? "   lost" : "";
  const motion = speed === null ? "" : `   ${speed.toFixed(2)} m/s${lost}`;
  byId("hud").textContent = `UAV ${vehicle.id}   E ${e.toFixed(2)}   N ${n.toFixed(2)}   U ${u.toFixed(2)} m${motion}`;
}

function setPlaying(playing) {
  state.playing = playing;
  const button = byId("play");
  button.innerHTML = `<svg width="14" height="14" viewBox="0 0 14 14"><path d="${playing ? ICONS.pause : ICONS.play}"/></svg>`;
  button.setAttribute("aria-label", playing ? "Pause" : "Play");
  if (!playing) return;
  if (state.time >= endTime) setTime(0);
  let last = performance.now();
  const frame = ++state.frame;
  const advance = (now) => {
    if (!state.playing || frame !== state.frame) return;
    const next = state.time + ((now - last) / 1000) * Number(byId("speed").value);
    last = now;
    setTime(next);
    if (next >= endTime) setPlaying(false);
    else requestAnimationFrame(advance);
  };
  requestAnimationFrame(advance);
}

byId("time").max = endTime;
byId("time").addEventListener("input", (e) => seek(Number(e.target.value)));
byId("play").addEventListener("click", () => setPlaying(!state.playing));
for (const v of vehicles) byId("follow").append(element("option", `UAV ${v.id}`, { value: v.id }));
byId("follow").addEventListener("change", (e) => view?.follow(e.target.value === "" ? null : Number(e.target.value)));
document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || endTime === 0) return;
  const typing = e.target.matches("select, input[type=checkbox], summary, button");
  if (e.key === " " && !typing) { e.preventDefault(); setPlaying(!state.playing); }
  if (e.key === "Escape") select(null);
  if (e.target.matches("input, select")) return;
  if (e.key === "ArrowLeft" || e.key === "ArrowRight") { e.preventDefault(); seek(state.time + (e.key === "ArrowLeft" ? -1 : 1) * (e.shiftKey ? 10 : 1)); }
  if (e.key === "Home") seek(0);
  if (e.key === "End") seek(endTime);
});

const asked = new URLSearchParams(location.search);
for (const [key, value] of new URLSearchParams(location.hash.slice(1))) asked.set(key, value);
if (view) {
  buildLayers(view, asked);
  for (const name of Object.keys(VIEWS)) {
    const button = byId("views").appendChild(element("button", name[0].toUpperCase() + name.slice(1), { title: `View ${name}` }));
    button.addEventListener("click", () => { byId("follow").value = ""; view.follow(null); view.setView(name); });
  }
  view.setView(asked.get("view") in VIEWS ? asked.get("view") : "iso");
}
setPlaying(false);
setTime(Number(asked.get("t")) || 0);
if (asked.has("select")) select(Number(asked.get("select")));
if (asked.has("follow")) {
  byId("follow").value = asked.get("follow");
  view?.follow(Number(asked.get("follow")));
}
