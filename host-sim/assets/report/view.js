// Camera, drawing on demand, and what follows from the camera: label sizes, rings that face it, the triad.

const VIEWS = {
  iso: { from: [0.85, -1.1, 0.72], fov: 36 },
  top: { from: [0, -0.0005, 1], fov: 7 },
  front: { from: [0, -1, 0.0005], fov: 7 },
  side: { from: [1, 0, 0.0005], fov: 7 },
};

// Returns what the rest of the page asks of the scene.
function buildView(host, onPick) {
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.localClippingEnabled = true;
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.domElement.className = "gl";
  const labels = new THREE.CSS2DRenderer();
  labels.domElement.style.cssText = "position:absolute;inset:0;pointer-events:none;z-index:1";
  host.prepend(renderer.domElement, labels.domElement);

  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0x15181c);
  // Far edges of the map fade, so that near and far walls can be distinguished.
  scene.fog = new THREE.Fog(0x15181c, 1, 2);
  const sun = new THREE.DirectionalLight(0xffffff, 1.7);
  sun.position.set(0.5, -0.8, 1.2);
  scene.add(new THREE.HemisphereLight(0xdfe9f5, 0x39424c, 1.5), sun);

  const layers = { grid: new THREE.Group(), outlines: new THREE.Group(), strips: new THREE.Group(), footprints: new THREE.Group(), roadmap: new THREE.Group(), planned: new THREE.Group(), track: new THREE.Group(), vehicles: new THREE.Group(), terminals: new THREE.Group(), obstacles: new THREE.Group() };
  for (const layer of Object.values(layers)) scene.add(layer);
  layers.grid.add(buildGrid());
  if (roadmap) layers.roadmap.add(buildRoadmap());
  for (const o of outlines) layers.outlines.add(buildOutline(o));
  const map = report.map && buildMap(report.map);
  if (map) scene.add(map.group);
  const safetyDistance = report.result?.safety?.safety_distance_m ?? 0;
  const parts = vehicles.map((v) => buildVehicle(v, safetyDistance));
  for (const p of parts) {
    layers.vehicles.add(p.body);
    layers.terminals.add(p.terminals);
    for (const { line } of p.planned) layers.planned.add(line);
    if (p.track) layers.track.add(p.track);
  }
  const area = buildCoverage(layers);
  const obstacles = report.obstacles.map(buildObstacle);
  for (const o of obstacles) layers.obstacles.add(o.mesh);
  const sprites = [];
  const scales = [];
  scene.traverse((o) => {
    if (o.isSprite) sprites.push(o);
    if (o.userData.axis) scales.push(o);
  });

  const camera = new THREE.PerspectiveCamera(36, 1, 0.1, 1000);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  controls.zoomToCursor = true;
  controls.listenToKeyEvents?.(host);

  let asked = false;
  let time = 0;
  let rings = false;
  let selected = null;
  let followed = null;
  let fitted = null;

  function invalidate() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(draw);
  }

  function draw() {
    asked = false;
    const distance = camera.position.distanceTo(controls.target);
    const reach = distance + 3 * extent.radius;
    camera.near = Math.max(distance / 400, distance - 4 * extent.radius, 0.02);
    camera.far = reach;
    scene.fog.near = Math.max(0, distance - 0.9 * extent.radius);
    scene.fog.far = distance + 1.8 * extent.radius;
    camera.updateProjectionMatrix();
    const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / host.clientHeight;
    for (const sprite of sprites) sprite.scale.setScalar(sprite.userData.pixels * perPixel);
    const sight = camera.getWorldDirection(new THREE.Vector3());
    for (const label of scales) label.visible = Math.abs(sight[label.userData.axis]) < 0.97;
    for (const p of parts) {
      if (p.ring) p.ring.quaternion.copy(camera.quaternion);
      // From far away a dot stands for the vehicle; near by one sees it in its true size.
      const size = (2 * p.vehicle.radius_m) / (perPixel * p.body.position.distanceTo(camera.position));
      const lost = isLost(p);
      p.dot.visible = size < 26 && !lost;
      p.quadrotor.visible = size >= 8 && !lost;
      if (p.wreck) p.wreck.visible = lost;
      if (p.ring) p.ring.visible = rings && !lost;
    }
    renderer.render(scene, camera);
    labels.render(scene, camera);
    drawTriad(camera);
    const { triangles, lines } = renderer.info.render;
    Object.assign(document.body.dataset, { triangles, lines, ready: "1" });
  }

  function setView(name) {
    const { from, fov } = VIEWS[name];
    fitted = name;
    camera.fov = fov;
    camera.updateProjectionMatrix();
    controls.target.set(...extent.center);
    // From too near, back off until every corner of the box is well inside the picture.
    let distance = extent.radius / Math.tan((fov * Math.PI) / 360);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((c) => [0, 1, 2].map((a) => ((c >> a) & 1 ? extent.max : extent.min)[a]));
    const fits = () => corners.every((c) => {
      const p = new THREE.Vector3(...c).project(camera);
      return Math.abs(p.x) < 0.86 && Math.abs(p.y) < 0.86;
    });
    for (let step = 0; step < 60; step++) {
      camera.position.set(...from).normalize().multiplyScalar(distance).add(controls.target);
      camera.lookAt(controls.target);
      camera.updateMatrixWorld();
      if (fits()) break;
      distance *= 1.04;
    }
    controls.update();
    invalidate();
  }

  function setTime(t) {
    time = t;
    const division = divisionAt(t);
    area.show(t, (id) => selected === null || id === selected);
    for (const p of parts) {
      for (const planned of p.planned) planned.line.visible = planned.division === division && isShown(p);
      const { position } = stateAt(p.vehicle, t);
      p.body.position.set(...position);
      p.labelText.textContent = isLost(p) ? `${p.vehicle.id} lost` : p.vehicle.id;
      if (p.track) {
        const index = trackIndex(p.vehicle.track, t);
        p.track.visible = index > 0 && isShown(p);
        p.track.geometry.instanceCount = Math.max(0, index);
      }
    }
    document.body.dataset.lost = parts.filter(isLost).length;
    for (const o of obstacles) o.mesh.visible = o.from <= t && t < o.until;
    if (followed) {
      const move = followed.body.position.clone().sub(controls.target);
      controls.target.add(move);
      camera.position.add(move);
    }
    invalidate();
  }

  // From its loss on a vehicle is drawn as a wreck: it flies no more.
  const isLost = (p) => isNumber(p.vehicle.lost_s) && time >= p.vehicle.lost_s;
  const isShown = (p) => selected === null || p.vehicle.id === selected;

  // Shows the paths of one vehicle alone; null shows all.
  function select(id) {
    selected = id;
    for (const p of parts) {
      p.labelText.classList.toggle("dim", !isShown(p));
      for (const sprite of [p.dot, p.wreck]) if (sprite) sprite.material.opacity = isShown(p) ? 1 : 0.4;
      p.terminals.visible = isShown(p);
    }
    setTime(time);
  }

  function follow(id) {
    followed = parts.find((p) => p.vehicle.id === id) ?? null;
    if (followed) {
      fitted = null;
      const offset = camera.position.clone().sub(controls.target);
      controls.target.copy(followed.body.position);
      const near = Math.min(offset.length(), 14 / Math.tan((camera.fov * Math.PI) / 360));
      camera.position.copy(controls.target).add(offset.setLength(near));
      controls.update();
    }
    setTime(time);
  }

  function setRings(shown) {
    rings = shown;
    invalidate();
  }

  function setLabels(shown) {
    for (const p of parts) p.label.visible = shown;
    invalidate();
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = host;
    if (width === 0 || height === 0) return;
    renderer.setSize(width, height);
    labels.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    // Resizing clears the canvas: draw at once, and fit again unless the user has moved the camera.
    if (fitted) setView(fitted);
    draw();
  }

  // The vehicle within 14 pixels of a click.
  let pressed = null;
  renderer.domElement.addEventListener("pointerdown", (e) => { pressed = [e.clientX, e.clientY]; });
  renderer.domElement.addEventListener("pointerup", (e) => {
    if (!pressed || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 4) return;
    const box = renderer.domElement.getBoundingClientRect();
    let best = { id: null, distance: 14 };
    for (const p of parts) {
      const at = p.body.position.clone().project(camera);
      const x = box.left + ((at.x + 1) / 2) * box.width;
      const y = box.top + ((1 - at.y) / 2) * box.height;
      const distance = Math.hypot(e.clientX - x, e.clientY - y);
      if (distance < best.distance) best = { id: p.vehicle.id, distance };
    }
    onPick(best.id);
  });

  controls.addEventListener("change", invalidate);
  controls.addEventListener("start", () => { fitted = null; });
  byId("layers").open = host.clientWidth >= 760;
  resize();
  new ResizeObserver(resize).observe(host);
  setRings(false);
  Object.assign(document.body.dataset, {
    faces: map ? map.faces : 0,
    roadmapEdges: roadmap ? roadmap.edges.length / 2 : 0,
    paths: layers.planned.children.length,
    tracks: layers.track.children.length,
    vehicles: parts.length,
  });
  return { layers, map, safetyDistance, invalidate, setView, setTime, select, follow, setRings, setLabels };
}

// East, north, up as the camera sees them, in the corner.
function drawTriad(camera) {
  const canvas = byId("triad");
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const inverse = camera.quaternion.clone().invert();
  const axes = [["E", [1, 0, 0], "#ff6370"], ["N", [0, 1, 0], "#57d380"], ["U", [0, 0, 1], "#4da3ff"]]
    .map(([name, direction, color]) => ({ name, color, to: new THREE.Vector3(...direction).applyQuaternion(inverse) }))
    .sort((a, b) => a.to.z - b.to.z);
  pen.font = "600 22px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.lineWidth = 5;
  pen.lineCap = "round";
  for (const { name, color, to } of axes) {
    pen.strokeStyle = pen.fillStyle = color;
    pen.beginPath();
    pen.moveTo(84, 84);
    pen.lineTo(84 + 52 * to.x, 84 - 52 * to.y);
    pen.stroke();
    if (Math.hypot(to.x, to.y) > 0.15) pen.fillText(name, 84 + 70 * to.x, 84 - 70 * to.y);
  }
}
