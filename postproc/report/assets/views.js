// Where the camera looks from.

const SIDES = 24; // directions that are tried, all from as high
const RISE = 0.45;
const MOST = 60; // points that are looked at
const NEAR = 0.3; // of the arm's length: what it hides beside its axes

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function size(v) {
  return Math.hypot(...v);
}

function unit(v) {
  const long = size(v) || 1;
  return v.map((x) => x / long);
}

// Where to look and from how far along a direction, so that all points are in view; up is z.
// vertical, horizontal: tangents of half the angles of view.
export function viewOf(points, from, vertical, horizontal) {
  const back = unit(from);
  const right = unit([-back[1], back[0], 0]);
  const up = [
    back[1] * right[2] - back[2] * right[1],
    back[2] * right[0] - back[0] * right[2],
    back[0] * right[1] - back[1] * right[0],
  ];
  const seen = points.map((p) => [dot(p, right), dot(p, up), dot(p, back)]);
  let target = [0, 0, 0];
  let far = 1;
  // the middle in view depends on the distance: a few rounds settle it
  for (let round = 0; round < 8; round++) {
    const at = [dot(target, right), dot(target, up), dot(target, back)];
    const ends = [0, 1].map((axis) => {
      const tangent = axis ? vertical : horizontal;
      const edges = seen.map((p) => [p[axis] - at[axis], tangent * (p[2] - at[2])]);
      const [low, high] = [
        Math.min(...edges.map(([x, d]) => x - d)),
        Math.max(...edges.map(([x, d]) => x + d)),
      ];
      return { middle: (low + high) / 2, distance: (high - low) / 2 / tangent };
    });
    const moved = [at[0] + ends[0].middle, at[1] + ends[1].middle];
    target = right.map((r, k) => moved[0] * r + moved[1] * up[k] + at[2] * back[k]);
    far = Math.max(...ends.map((end) => end.distance));
  }
  return { target, distance: far };
}

// how far the line from a point along a unit direction passes other points, those behind it left out
function passes(point, way, others) {
  let nearest = Infinity;
  for (const other of others) {
    const off = other.map((v, k) => v - point[k]);
    const along = dot(off, way);
    if (along > 0) nearest = Math.min(nearest, Math.sqrt(Math.max(0, dot(off, off) - along ** 2)));
  }
  return nearest;
}

function length(points) {
  return points
    .slice(1)
    .reduce((sum, end, k) => sum + size(end.map((v, j) => v - points[k][j])), 0);
}

// points along a polyline, close enough that no line slips through it unseen
function filled(points) {
  const between = [0.2, 0.4, 0.6, 0.8, 1];
  return points.flatMap((end, k) => {
    const start = points[Math.max(k - 1, 0)];
    return between.map((t) => start.map((v, j) => v + t * (end[j] - v)));
  });
}

// The direction to look from, in which most points show their face and hide least behind the arm.
// points of the workpiece and axes out of it, null where they are not known: flat, 3 numbers each;
// inWorld of such a point; arms: for each of some poses, points along the arm from its root, in the world.
export function openSide(points, axes, inWorld, arms) {
  const step = 3 * Math.ceil(points.length / 3 / MOST);
  const some = [];
  for (let k = 0; k < points.length; k += step) {
    const point = [...points.subarray(k, k + 3)];
    const off = inWorld(point.map((v, j) => v + (axes ? axes[k + j] : 0)));
    const at = inWorld(point);
    some.push({ at, face: off.map((v, j) => v - at[j]) });
  }
  const stand = arms.map((arm) => ({ along: filled(arm), beside: NEAR * length(arm) || 1 }));
  const clear = (at, side) =>
    stand.reduce(
      (sum, { along, beside }) => sum + Math.min(1, passes(at, side, along) / beside),
      0,
    );
  const shown = (side) =>
    some.reduce(
      (sum, { at, face }) => sum + clear(at, side) * (0.2 + Math.max(0, dot(face, side))),
      0,
    );
  const sides = Array.from({ length: SIDES }, (_, k) => {
    const angle = (2 * Math.PI * k) / SIDES;
    return unit([Math.cos(angle), Math.sin(angle), RISE]);
  });
  const scores = sides.map(shown);
  return sides[scores.indexOf(Math.max(...scores))];
}

// corners of the box around points
export function corners(points) {
  if (!points.length) return [];
  const ends = [[...points.subarray(0, 3)], [...points.subarray(0, 3)]];
  points.forEach((v, k) => {
    ends[0][k % 3] = Math.min(ends[0][k % 3], v);
    ends[1][k % 3] = Math.max(ends[1][k % 3], v);
  });
  return Array.from({ length: 8 }, (_, k) => [0, 1, 2].map((j) => ends[(k >> j) & 1][j]));
}
