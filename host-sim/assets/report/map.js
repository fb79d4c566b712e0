// The obstacle map: surface and creases, as x-ray or solid, cut off above and below chosen heights.

const cutAbove = new THREE.Plane(new THREE.Vector3(0, 0, -1), 1e6);
const cutBelow = new THREE.Plane(new THREE.Vector3(0, 0, 1), 1e6);
const cuts = [cutAbove, cutBelow];

function surfaceGeometry(map) {
  const faces = decode(map.faces, Uint16Array);
  const count = faces.length / 6;
  const positions = new Float32Array(count * 12);
  const normals = new Int8Array(count * 12);
  const indices = new Uint32Array(count * 6);
  for (let f = 0; f < count; f++) {
    const [code, layer, u, v, w, h] = faces.subarray(6 * f, 6 * f + 6);
    const axis = code >> 1;
    const up = code & 1;
    const [ua, va] = [(axis + 1) % 3, (axis + 2) % 3];
    for (let c = 0; c < 4; c++) {
      const at = 12 * f + 3 * c;
      positions[at + axis] = map.min[axis] + layer * map.drawn_m;
      positions[at + ua] = map.min[ua] + (u + (c === 1 || c === 2 ? w : 0)) * map.drawn_m;
      positions[at + va] = map.min[va] + (v + (c >= 2 ? h : 0)) * map.drawn_m;
      normals[at + axis] = up ? 127 : -127;
    }
    const order = up ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2];
    for (let k = 0; k < 6; k++) indices[6 * f + k] = 4 * f + order[k];
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3, true));
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  return geometry;
}

// Creases longer than a fifth of the building's width, its structure; and the others, frames of doors and windows.
function creaseGeometries(map) {
  const lines = decode(map.creases, Uint16Array);
  const structural = 0.2 * Math.min(map.max[0] - map.min[0], map.max[1] - map.min[1]);
  const positions = { long: [], short: [] };
  for (let l = 0; l < lines.length / 5; l++) {
    const [axis, u, v, start, length] = lines.subarray(5 * l, 5 * l + 5);
    const target = length * map.drawn_m >= structural ? positions.long : positions.short;
    for (let end = 0; end < 2; end++) {
      const point = [0, 0, 0];
      point[axis] = map.min[axis] + (start + end * length) * map.drawn_m;
      point[(axis + 1) % 3] = map.min[(axis + 1) % 3] + u * map.drawn_m;
      point[(axis + 2) % 3] = map.min[(axis + 2) % 3] + v * map.drawn_m;
      target.push(...point);
    }
  }
  return [positions.long, positions.short].map((xyz) => {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(xyz), 3));
    return geometry;
  });
}

// A plan of the walls where the upper cut goes through them. `at(height)` draws it, from the floors and ceilings below:
// each face that looks down begins a filled run of its column, each that looks up ends one.
function buildSection(map) {
  const faces = decode(map.faces, Uint16Array);
  const [nx, ny] = [0, 1].map((a) => Math.ceil((map.max[a] - map.min[a]) / map.drawn_m - 1e-3));
  const canvas = element("canvas", null, { width: nx, height: ny });
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.generateMipmaps = false;
  texture.minFilter = texture.magFilter = THREE.NearestFilter;
  const plane = new THREE.Mesh(
    new THREE.PlaneGeometry(nx * map.drawn_m, ny * map.drawn_m),
    new THREE.MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false, side: THREE.DoubleSide, fog: false }),
  );
  plane.renderOrder = 1;
  plane.position.set(map.min[0] + (nx * map.drawn_m) / 2, map.min[1] + (ny * map.drawn_m) / 2, 0);
  const at = (height) => {
    plane.position.z = height;
    plane.visible = height < map.max[2] - 1e-3 && height > map.min[2] + 1e-3;
    if (!plane.visible) return;
    const top = Math.ceil((height - map.min[2]) / map.drawn_m - 1e-3);
    const depth = new Int16Array(nx * ny);
    for (let f = 0; f < faces.length; f += 6) {
      if (faces[f] < 4 || faces[f + 1] >= top) continue;
      const sign = faces[f] === 4 ? 1 : -1;
      for (let y = faces[f + 3]; y < faces[f + 3] + faces[f + 5]; y++) {
        for (let x = faces[f + 2]; x < faces[f + 2] + faces[f + 4]; x++) depth[y * nx + x] += sign;
      }
    }
    const pen = canvas.getContext("2d");
    const image = pen.createImageData(nx, ny);
    // Row 0 of an image is its top: north.
    depth.forEach((filled, i) => {
      if (filled > 0) image.data.set([86, 132, 178, 165], 4 * ((ny - 1 - Math.floor(i / nx)) * nx + (i % nx)));
    });
    pen.putImageData(image, 0, 0);
    texture.needsUpdate = true;
  };
  return { plane, at };
}

// Returns the group and `show(style)`, style one of "x-ray", "solid", "off".
function buildMap(map) {
  const group = new THREE.Group();
  const surface = surfaceGeometry(map);
  const clip = { clippingPlanes: cuts };
  const glass = new THREE.MeshLambertMaterial({ color: 0x9db2c6, transparent: true, opacity: 0.06, depthWrite: false, ...clip });
  const wall = new THREE.MeshLambertMaterial({ color: 0x8e99a4, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1, ...clip });
  // Where the cut opens a wall one looks at its inside: one flat colour reads as the section.
  const inside = new THREE.MeshBasicMaterial({ color: 0x3f6f9f, side: THREE.BackSide, ...clip });
  const front = new THREE.Mesh(surface, glass);
  const back = new THREE.Mesh(surface, inside);
  const creases = new THREE.Group();
  for (const [i, geometry] of creaseGeometries(map).entries()) {
    const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ transparent: true, depthWrite: false, ...clip }));
    lines.renderOrder = 1;
    // A scan has a hundred times as many small ones: together they shall weigh no more.
    const count = geometry.attributes.position.count / 2;
    lines.userData.opacity = i === 0 ? 0.34 : Math.max(0.015, 0.08 * Math.min(1, 6000 / count));
    creases.add(lines);
  }
  for (const object of [front, back, ...creases.children]) object.frustumCulled = false;
  const section = buildSection(map);
  group.add(front, back, creases, section.plane);
  const show = (style) => {
    group.visible = style !== "off";
    front.material = style === "solid" ? wall : glass;
    back.visible = style === "solid";
    for (const { material, userData } of creases.children) {
      material.color.set(style === "solid" ? 0x20262c : 0xa9bccf);
      material.opacity = style === "solid" ? 0.55 : userData.opacity;
    }
  };
  return { group, show, cutAt: section.at, faces: surface.index.count / 6, creases };
}
