export {
  AmbientLight, BackSide, BufferAttribute, BufferGeometry, CanvasTexture, Color, CylinderGeometry, DirectionalLight,
  FrontSide, Group, HemisphereLight, LineBasicMaterial, LineLoop, LineSegments, MathUtils, Matrix4, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, OrthographicCamera, PerspectiveCamera, Plane, Points, PointsMaterial, Quaternion,
  Raycaster, RingGeometry, Scene, SphereGeometry, SRGBColorSpace, Sprite, SpriteMaterial, TorusGeometry, Vector2, Vector3,
  WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { Line2 } from "three/addons/lines/Line2.js";
export { LineGeometry } from "three/addons/lines/LineGeometry.js";
export { LineMaterial } from "three/addons/lines/LineMaterial.js";
export { CSS2DObject, CSS2DRenderer } from "three/addons/renderers/CSS2DRenderer.js";
