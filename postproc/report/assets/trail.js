// The path of the tool as segments in the workpiece, arcs in small pieces.
import { Vector3 } from "./three.bundle.js";
import { unpack } from "./data.js";

const PIECE = 0.2; // rad

// Points of a circular arc from a through via to b; a, via, b where they lie on a line.
export function arc(a, via, b) {
  const u = via.clone().sub(a);
  const v = b.clone().sub(a);
  const normal = new Vector3().crossVectors(u, v);
  const square = normal.lengthSq();
  if (square < 1e-16) return [a, via, b];
  const centre = new Vector3()
    .crossVectors(normal, u)
    .multiplyScalar(v.lengthSq())
    .add(new Vector3().crossVectors(v, normal).multiplyScalar(u.lengthSq()))
    .divideScalar(2 * square)
    .add(a);
  const x = a.clone().sub(centre);
  const y = new Vector3().crossVectors(normal.normalize(), x);
  const end = b.clone().sub(centre);
  const angle = Math.atan2(end.dot(y), end.dot(x));
  const sweep = angle > 0 ? angle : angle + 2 * Math.PI;
  const pieces = Math.max(2, Math.ceil(sweep / PIECE));
  return Array.from({ length: pieces + 1 }, (_, i) => {
    const t = (sweep * i) / pieces;
    return centre.clone().addScaledVector(x, Math.cos(t)).addScaledVector(y, Math.sin(t));
  });
}

// ends of segments between points, each with the owner of its second point
function sampled(points, owners) {
  const ends = [];
  for (let k = 1; k < owners.length; k++) ends.push(...points.subarray(3 * k - 3, 3 * k + 3));
  return { ends, owner: Array.from(owners.subarray(1)) };
}

// ends: flat, 6 numbers a segment; owner: the move of each segment
export function trail(data, positions) {
  if (data.trail) return sampled(unpack(data.trail), unpack(data.owner));
  const aux = unpack(data.aux);
  const viaOf = new Map();
  unpack(data.circles).forEach((move, k) => viaOf.set(move, new Vector3().fromArray(aux, 3 * k)));
  const ends = [];
  const owner = [];
  for (let move = 1; move < positions.length / 3; move++) {
    const a = new Vector3().fromArray(positions, 3 * move - 3);
    const b = new Vector3().fromArray(positions, 3 * move);
    const via = viaOf.get(move);
    const points = via ? arc(a, via, b) : [a, b];
    for (let i = 1; i < points.length; i++) {
      ends.push(...points[i - 1].toArray(), ...points[i].toArray());
      owner.push(move);
    }
  }
  return { ends, owner };
}
