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

function creaseGeometry(map) {
  const lines = decode(map.creases, Uint16Array);
  const count = lines.length / 5;
  const positions = new Float32Array(count * 6);
  for (let l = 0; l < count; l++) {
    const [axis, u, v, start, length] = lines.subarray(5 * l, 5 * l + 5);
    const [ua, va] = [(axis + 1) % 3, (axis + 2) % 3];
    for (let end = 0; end < 2; end++) {
      const at = 6 * l + 3 * end;
      positions[at + axis] = map.min[axis] + (start + end * length) * map.drawn_m;
      positions[at + ua] = map.min[ua] + u * map.drawn_m;
      positions[at + va] = map.min[va] + v * map.drawn_m;
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  return geometry;
}

// Returns the group and `show(style)`, style one of "x-ray", "solid", "off".
function buildMap(map) {
  const group = new THREE.Group();
  const surface = surfaceGeometry(map);
  const clip = { clippingPlanes: cuts };
  const glass = new THREE.MeshLambertMaterial({ color: 0x9db2c6, transparent: true, opacity: 0.075, depthWrite: false, ...clip });
  const wall = new THREE.MeshLambertMaterial({ color: 0x8e99a4, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1, ...clip });
  // Where the cut opens a wall one looks at its inside: one flat colour reads as the section.
  const section = new THREE.MeshBasicMaterial({ color: 0x3f6f9f, side: THREE.BackSide, ...clip });
  const front = new THREE.Mesh(surface, glass);
  const back = new THREE.Mesh(surface, section);
  const creases = new THREE.LineSegments(
    creaseGeometry(map),
    new THREE.LineBasicMaterial({ color: 0xa9bccf, transparent: true, opacity: 0.22, depthWrite: false, ...clip }),
  );
  creases.renderOrder = 1;
  for (const object of [front, back, creases]) object.frustumCulled = false;
  group.add(front, back, creases);
  const show = (style) => {
    group.visible = style !== "off";
    front.material = style === "solid" ? wall : glass;
    back.visible = style === "solid";
    creases.material.color.set(style === "solid" ? 0x2a3138 : 0xa9bccf);
    creases.material.opacity = style === "solid" ? 0.6 : 0.22;
  };
  return { group, show, faces: surface.index.count / 6, creases };
}
