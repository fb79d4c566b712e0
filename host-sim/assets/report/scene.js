// Everything in the scene but the map: grid with scale, roadmap, paths, tracks, vehicles, goals, obstacles.

const colorOf = ([r, g, b]) => new THREE.Color().setRGB(r / 255, g / 255, b / 255, THREE.SRGBColorSpace);

// Box around all there is, metres.
const extent = (() => {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  const add = (p) => p && p.forEach((c, a) => { min[a] = Math.min(min[a], c); max[a] = Math.max(max[a], c); });
  const addAll = (array, stride, skip) => {
    for (let i = skip; i < array.length; i += stride) add([array[i], array[i + 1], array[i + 2]]);
  };
  if (report.map) { add(report.map.min); add(report.map.max); }
  if (roadmap) addAll(roadmap.nodes, 3, 0);
  for (const o of outlines) addAll(o.points, 3, 0);
  for (const v of vehicles) { add(v.start); add(v.goal); addAll(v.planned, 3, 0); addAll(v.track, 4, 1); }
  if (min[0] > max[0]) { add([-5, -5, 0]); add([5, 5, 5]); }
  const center = min.map((c, a) => (c + max[a]) / 2);
  const radius = Math.max(1, Math.hypot(...min.map((c, a) => max[a] - c)) / 2);
  return { min, max, center, radius };
})();

// The largest of 1, 2, 5 · 10ⁿ that divides `span` into at least `parts`.
function niceStep(span, parts) {
  const raw = span / parts;
  const decade = 10 ** Math.floor(Math.log10(raw));
  return decade * [5, 2, 1].find((m) => m * decade <= raw);
}

// A label of the scale along `axis`, hidden where one looks along that axis.
function scaleLabel(axis, text, x, y, z) {
  const label = new THREE.CSS2DObject(element("div", text, { class: "scale" }));
  label.position.set(x, y, z);
  label.userData.axis = axis;
  return label;
}

function buildGrid() {
  const group = new THREE.Group();
  const span = Math.max(extent.max[0] - extent.min[0], extent.max[1] - extent.min[1], 1);
  const major = niceStep(span, 4);
  const minor = major / 5;
  const z = extent.min[2];
  // Lines in whole minor steps, one step wider than the box; every fifth, counted from 0, is a major one.
  const [i0, j0] = [0, 1].map((a) => Math.floor(extent.min[a] / minor + 1e-3) - 1);
  const [i1, j1] = [0, 1].map((a) => Math.ceil(extent.max[a] / minor - 1e-3) + 1);
  const [x0, y0, x1, y1] = [i0, j0, i1, j1].map((i) => i * minor);
  const lines = { minor: [], major: [] };
  for (let i = i0; i <= i1; i++) lines[i % 5 ? "minor" : "major"].push(i * minor, y0, z, i * minor, y1, z);
  for (let j = j0; j <= j1; j++) lines[j % 5 ? "minor" : "major"].push(x0, j * minor, z, x1, j * minor, z);
  for (const [kind, opacity] of [["minor", 0.3], ["major", 0.75]]) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(lines[kind]), 3));
    const mesh = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x4a545e, transparent: true, opacity, depthWrite: false, fog: false }));
    mesh.renderOrder = -1;
    group.add(mesh);
  }
  const digits = major < 1 ? 1 : 0;
  const off = span * 0.02;
  const first = (from) => Math.ceil(from / major - 1e-6) * major;
  for (let x = first(x0); x <= x1 + 1e-6; x += major) group.add(scaleLabel("x", x.toFixed(digits), x, y0 - off, z));
  for (let y = first(y0); y <= y1 + 1e-6; y += major) group.add(scaleLabel("y", y.toFixed(digits), x1 + off, y, z));
  group.add(scaleLabel("x", "E [m]", (x0 + x1) / 2, y0 - 4 * off, z), scaleLabel("y", "N [m]", x1 + 4 * off, (y0 + y1) / 2, z));
  const height = extent.max[2] - z;
  if (height > 0) {
    const step = niceStep(height, 4);
    const [px, py] = [extent.min[0] - off, extent.min[1] - off];
    const pole = [px, py, z, px, py, extent.max[2]];
    for (let u = Math.ceil(z / step) * step; u <= extent.max[2] + 1e-6; u += step) {
      pole.push(px - off / 2, py, u, px, py, u);
      if (u > z + step / 2) group.add(scaleLabel("z", u.toFixed(step < 1 ? 1 : 0), px - 1.5 * off, py, u));
    }
    group.add(scaleLabel("z", "U [m]", px, py, extent.max[2] + 1.5 * off));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(pole), 3));
    group.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x5b6671, fog: false })));
  }
  return group;
}

function buildRoadmap() {
  const positions = new Float32Array(roadmap.edges.length * 3);
  roadmap.edges.forEach((node, i) => positions.set(roadmap.nodes.subarray(3 * node, 3 * node + 3), 3 * i));
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  // Faint enough that where thousands of edges overlap one still sees the paths.
  const opacity = Math.min(0.25, Math.max(0.035, 900 / Math.max(1, roadmap.edges.length / 2)));
  const lines = new THREE.LineSegments(
    geometry,
    new THREE.LineBasicMaterial({ color: 0x63c5b0, transparent: true, opacity, depthWrite: false, clippingPlanes: cuts }),
  );
  lines.renderOrder = 1;
  lines.frustumCulled = false;
  return lines;
}

// The border of an area, closed.
function buildOutline(outline) {
  const color = { area: 0xd8e2ec, hole: 0x8a97a5, "no-fly": 0xff6370 }[outline.kind];
  return fatLine([...outline.points, ...outline.points.subarray(0, 3)], color, 2, 0.9);
}

// A polyline some pixels wide; `xyz` holds at least two points.
function fatLine(xyz, color, width, opacity) {
  const geometry = new THREE.LineGeometry();
  geometry.setPositions(xyz);
  const line = new THREE.Line2(geometry, new THREE.LineMaterial({ color, linewidth: width, transparent: true, opacity, depthWrite: false, fog: false }));
  line.frustumCulled = false;
  return line;
}

// A marker of constant size on the screen, drawn by `paint` on a 64 × 64 canvas.
function marker(pixels, paint) {
  const canvas = element("canvas", null, { width: 64, height: 64 });
  paint(canvas.getContext("2d"));
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, sizeAttenuation: false, depthWrite: false, fog: false }));
  sprite.userData.pixels = pixels;
  return sprite;
}

function paintMarker(color, outline) {
  return (pen) => {
    pen.lineJoin = "round";
    outline(pen);
    pen.lineWidth = 20; pen.strokeStyle = "rgba(12, 15, 18, 0.9)"; pen.stroke();
    pen.lineWidth = 10; pen.strokeStyle = color; pen.stroke();
  };
}
const square = (pen) => { pen.beginPath(); pen.rect(16, 16, 32, 32); };
const diamond = (pen) => { pen.beginPath(); pen.moveTo(32, 10); pen.lineTo(54, 32); pen.lineTo(32, 54); pen.lineTo(10, 32); pen.closePath(); };
function disc(color) {
  return (pen) => {
    pen.beginPath(); pen.arc(32, 32, 26, 0, 2 * Math.PI);
    pen.fillStyle = color; pen.fill();
    pen.lineWidth = 8; pen.strokeStyle = "rgba(10, 12, 15, 0.95)"; pen.stroke();
  };
}

// A quadrotor that fills a sphere of radius `r`.
function quadrotor(r, color) {
  const group = new THREE.Group();
  const paint = new THREE.MeshLambertMaterial({ color, emissive: color, emissiveIntensity: 0.25 });
  const dark = new THREE.MeshLambertMaterial({ color: 0x2b3036 });
  const body = new THREE.Mesh(new THREE.SphereGeometry(r * 0.26, 20, 14), paint);
  body.scale.z = 0.6;
  group.add(body);
  for (let k = 0; k < 4; k++) {
    const angle = Math.PI / 4 + (k * Math.PI) / 2;
    const arm = new THREE.Mesh(new THREE.CylinderGeometry(r * 0.045, r * 0.045, r * 0.6, 8), dark);
    arm.position.set(Math.cos(angle) * r * 0.3, Math.sin(angle) * r * 0.3, 0);
    arm.rotation.z = angle - Math.PI / 2;
    const rotor = new THREE.Mesh(new THREE.TorusGeometry(r * 0.33, r * 0.035, 8, 28), paint);
    rotor.position.set(Math.cos(angle) * r * 0.62, Math.sin(angle) * r * 0.62, r * 0.08);
    group.add(arm, rotor);
  }
  return group;
}

function circle(radius, color) {
  const points = new Float32Array(3 * 72);
  for (let i = 0; i < 72; i++) points.set([radius * Math.cos((i * Math.PI) / 36), radius * Math.sin((i * Math.PI) / 36), 0], 3 * i);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
  return new THREE.LineLoop(geometry, new THREE.LineBasicMaterial({ color, transparent: true, opacity: 0.8, depthWrite: false }));
}

// The grey of a vehicle that lost its power, and a cross in it.
const LOST = [122, 130, 140];
function cross(pen) {
  disc(cssColor(LOST))(pen);
  pen.beginPath(); pen.moveTo(20, 20); pen.lineTo(44, 44); pen.moveTo(44, 20); pen.lineTo(20, 44);
  pen.lineWidth = 8; pen.strokeStyle = "#ff6370"; pen.stroke();
}

// One vehicle's objects, each kind for its own layer.
function buildVehicle(v, safetyDistance) {
  const color = colorOf(v.color);
  const css = cssColor(v.color);
  const parts = { vehicle: v, body: new THREE.Group(), terminals: new THREE.Group() };
  parts.quadrotor = quadrotor(v.radius_m, color);
  parts.dot = marker(15, disc(css));
  parts.dot.renderOrder = 6;
  // Seen through walls: where the vehicles are matters more than what stands before them.
  parts.dot.material.depthTest = false;
  if (isNumber(v.lost_s)) {
    parts.wreck = marker(15, cross);
    parts.wreck.renderOrder = 6;
    parts.wreck.material.depthTest = false;
    parts.body.add(parts.wreck);
  }
  parts.labelText = element("div", v.id, { class: "label", style: `border-color: ${css}` });
  parts.label = new THREE.CSS2DObject(parts.labelText);
  parts.body.add(parts.quadrotor, parts.dot, parts.label);
  if (safetyDistance > 0) {
    // Half the distance each: two rings that touch are two vehicles at the limit.
    parts.ring = circle(safetyDistance / 2, color);
    parts.ring.renderOrder = 5;
    parts.body.add(parts.ring);
  }
  const start = marker(12, paintMarker(css, square));
  start.position.set(...v.start);
  parts.terminals.add(start);
  if (v.goal) {
    const goal = marker(18, paintMarker(css, diamond));
    goal.position.set(...v.goal);
    parts.terminals.add(goal);
  }
  for (const sprite of parts.terminals.children) sprite.renderOrder = 4;
  parts.planned = plannedPaths(v).filter(([, path]) => path.length >= 6).map(([division, path]) => {
    const line = fatLine(path, color, 1.6, 0.85);
    line.renderOrder = 2;
    return { division, line };
  });
  if (v.track.length >= 8) {
    const xyz = new Float32Array((v.track.length / 4) * 3);
    for (let i = 0; i < v.track.length / 4; i++) xyz.set(v.track.subarray(4 * i + 1, 4 * i + 4), 3 * i);
    parts.track = fatLine(xyz, color, 3.2, 1);
    parts.track.renderOrder = 3;
  }
  return parts;
}

function buildObstacle(o) {
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(o.radius_m, 32, 20), new THREE.MeshLambertMaterial({ color: 0xff6370, transparent: true, opacity: 0.45, depthWrite: false }));
  mesh.position.set(...o.position);
  mesh.renderOrder = 3;
  return { mesh, from: o.from_s, until: o.until_s ?? Infinity };
}
