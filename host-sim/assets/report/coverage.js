// A coverage mission: who photographs what, from when on, and what pictures show.

const coverage = report.coverage && {
  ...report.coverage,
  divisions: report.coverage.divisions.map((d) => ({
    ...d,
    parts: d.parts.map((p) => ({ ...p, path: decode(p.path, Float32Array), lanes: decode(p.lanes, Float32Array) })),
  })),
  footprints: decode(report.coverage.footprints, Float32Array),
};
// Time, vehicle, four corners.
const FOOTPRINT_FLOATS = 10;

// Index of the division that counts at `t`; -1 where there is none.
function divisionAt(t) {
  let now = -1;
  while (coverage && now + 1 < coverage.divisions.length && coverage.divisions[now + 1].t_s <= t + 1e-6) now += 1;
  return now;
}

// The planned paths of a vehicle, one for each division it takes part in: [division, polyline].
function plannedPaths(v) {
  if (!coverage) return [[-1, v.planned]];
  return coverage.divisions.flatMap((d, i) => d.parts.filter((p) => p.vehicle === v.id).map((p) => [i, p.path]));
}

function flatMesh(xyz, color, opacity, order) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(xyz, 3));
  const material = new THREE.MeshBasicMaterial({ color, transparent: true, opacity, depthWrite: false, side: THREE.DoubleSide, fog: false });
  const mesh = new THREE.Mesh(geometry, material);
  mesh.renderOrder = order;
  mesh.frustumCulled = false;
  return mesh;
}

// Two triangles of four corners in turn, on the ground.
const quad = ([a, b, c, d], z) => [a, b, c, a, c, d].flatMap(([x, y]) => [x, y, z]);

// The strips of ground below the lanes of one part.
function buildStrips(part, color) {
  const half = coverage.lane_m / 2;
  const xyz = [];
  for (let i = 0; i + 5 < part.lanes.length; i += 6) {
    const [ax, ay, , bx, by] = part.lanes.subarray(i, i + 6);
    const length = Math.hypot(bx - ax, by - ay);
    const [u, v] = length > 0 ? [((bx - ax) / length) * half, ((by - ay) / length) * half] : [half, 0];
    // A lone waypoint is a square.
    const [p, q] = length > 0 ? [0, 0] : [u, v];
    xyz.push(...quad([[ax - p - v, ay - q + u], [ax - p + v, ay - q - u], [bx + p + v, by + q - u], [bx + p - v, by + q + u]], extent.min[2]));
  }
  return flatMesh(new Float32Array(xyz), color, 0.3, 0);
}

// What the pictures of one vehicle show, in the order in which they were taken.
function buildFootprints(id, color) {
  const xyz = [];
  const times = [];
  const all = coverage.footprints;
  for (let i = 0; i < all.length; i += FOOTPRINT_FLOATS) {
    if (all[i + 1] !== id) continue;
    times.push(all[i]);
    xyz.push(...quad([2, 4, 6, 8].map((k) => [all[i + k], all[i + k + 1]]), extent.min[2]));
  }
  return { id, times, mesh: flatMesh(new Float32Array(xyz), color, 0.1, 1) };
}

// Fills the layers of strips and footprints. Returns what changes with time and selection.
function buildCoverage(layers) {
  if (!coverage) return { show() {} };
  const colors = (id) => colorOf(vehicleById.get(id)?.color ?? [140, 150, 160]);
  const strips = coverage.divisions.flatMap((d, index) => d.parts.map((part) => ({ id: part.vehicle, index, mesh: buildStrips(part, colors(part.vehicle)) })));
  for (const s of strips) layers.strips.add(s.mesh);
  // 0 are those of flights before.
  const footprints = [0, ...vehicles.map((v) => v.id)].map((id) => buildFootprints(id, colors(id))).filter((f) => f.times.length > 0);
  for (const f of footprints) layers.footprints.add(f.mesh);
  Object.assign(document.body.dataset, { divisions: coverage.divisions.length, footprints: coverage.footprints.length / FOOTPRINT_FLOATS });
  return {
    show(t, isShown) {
      const now = divisionAt(t);
      for (const s of strips) s.mesh.visible = s.index === now && isShown(s.id);
      for (const f of footprints) {
        let count = 0;
        while (count < f.times.length && f.times[count] <= t) count += 1;
        f.mesh.geometry.setDrawRange(0, 6 * count);
        f.mesh.visible = count > 0 && isShown(f.id);
      }
    },
  };
}

// What of a part was others' before, as " (30 of UAV 2)".
function takenText(taken, id) {
  const of = taken.filter((x) => x.to === id).map((x) => `${x.waypoints} of UAV ${x.from}`);
  return of.length > 0 ? ` (${of.join(", ")})` : "";
}

// The list of divisions and their ticks over the slider. Returns `setTime(t)`.
function buildDivisions(onSeek) {
  const all = coverage?.divisions ?? [];
  byId("division-section").hidden = all.length === 0;
  const items = all.map((d, i) => {
    const li = byId("divisions").appendChild(element("li"));
    const lost = d.lost.map((id) => `UAV ${id}`).join(", ");
    li.append(element("time", `${d.t_s.toFixed(1)} s`), element("b", i === 0 ? "Plan" : lost ? `Without ${lost}` : "Divided again"));
    const box = li.appendChild(element("div"));
    for (const p of d.parts) {
      const line = box.appendChild(element("p"));
      const color = cssColor(vehicleById.get(p.vehicle)?.color ?? [140, 150, 160]);
      line.append(element("span", null, { class: "swatch", style: `background: ${color}` }), `UAV ${p.vehicle}: ${p.waypoints} ${p.waypoints === 1 ? "waypoint" : "waypoints"}${takenText(d.taken, p.vehicle)}`);
    }
    li.addEventListener("click", () => onSeek(d.t_s));
    if (i > 0 && endTime > 0) byId("ticks").appendChild(element("i", null, { class: "division", title: "Area divided again" })).style.left = `${(100 * d.t_s) / endTime}%`;
    return li;
  });
  return (t) => {
    const now = divisionAt(t);
    items.forEach((li, i) => li.classList.toggle("now", i === now));
  };
}
