// Marks in space: segments of lines, and cones or balls at points, each with its own colour.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  Float32BufferAttribute,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  MeshLambertMaterial,
  SphereGeometry,
  Vector3,
} from "./three.bundle.js";

export const MANY = 3000; // above it marks are single lines, and edges are not smoothed

// ends: flat array of segments, 6 numbers each; returns the lines and paint(i => colour)
export function lineSegments(ends) {
  const geometry = new BufferGeometry();
  const tint = new Float32Array(ends.length).fill(0.4);
  geometry.setAttribute("position", new Float32BufferAttribute(ends, 3));
  geometry.setAttribute("color", new BufferAttribute(tint, 3));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
  lines.frustumCulled = false;
  const colour = new Color();
  const paint = (colourOf) => {
    for (let i = 0; i < tint.length / 6; i++) {
      const { r, g, b } = colour.setRGB(...colourOf(i), "srgb");
      tint.set([r, g, b, r, g, b], 6 * i);
    }
    geometry.attributes.color.needsUpdate = true;
  };
  return { lines, paint };
}

// sets a matrix so that a cone's tip stands at a point and the cone lies along an axis from there
export function standCone(target, point, axis, size) {
  const towards = new Vector3(...axis).negate().normalize();
  const side = new Vector3(0, 1, 0).cross(towards);
  if (side.length() < 1e-6) side.set(1, 0, 0);
  else side.normalize();
  target.makeBasis(side, towards, new Vector3().crossVectors(side, towards));
  return target.setPosition(new Vector3(...point).addScaledVector(towards, -1.5 * size));
}

// lines of a length from points along their axes, upright where axes is null
function needles(points, axes, length) {
  const ends = new Float32Array(2 * points.length);
  for (let k = 0; k < points.length; k++) {
    const at = 6 * Math.floor(k / 3) + (k % 3);
    ends[at] = points[k];
    ends[at + 3] = points[k] + length * (axes ? axes[k] : k % 3 === 2);
  }
  const { lines, paint } = lineSegments(ends);
  return { mesh: lines, indexOf: ({ index }) => index >> 1, paint };
}

// Cones whose tips stand at points, balls where axes is null, needles of many. Returns the mesh,
// indexOf(what a ray meets), paint(i => colour).
export function pointMarks(points, axes, size) {
  const n = points.length / 3;
  if (n > MANY) return needles(points, axes, 3 * size);
  const shape = axes ? new ConeGeometry(size, 3 * size, 8, 1) : new SphereGeometry(size, 10, 8);
  const material = new MeshLambertMaterial({ color: 0xffffff });
  const mesh = new InstancedMesh(shape, material, Math.max(1, n));
  mesh.count = n;
  mesh.frustumCulled = false;
  const place = new Matrix4();
  const colour = new Color(0x888888);
  for (let i = 0; i < n; i++) {
    const point = points.subarray(3 * i, 3 * i + 3);
    if (axes) standCone(place, point, axes.subarray(3 * i, 3 * i + 3), size);
    else place.makeTranslation(...point);
    mesh.setMatrixAt(i, place);
    mesh.setColorAt(i, colour);
  }
  const paint = (colourOf) => {
    for (let i = 0; i < n; i++) mesh.setColorAt(i, colour.setRGB(...colourOf(i), "srgb"));
    if (n) mesh.instanceColor.needsUpdate = true;
  };
  return { mesh, indexOf: ({ instanceId }) => instanceId, paint };
}
