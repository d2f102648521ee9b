// Where the camera looks from.

// the origin of a frame (rows of 4 x 4)
export function origin(rows) {
  return [rows[3], rows[7], rows[11]];
}

export function middle(a, b) {
  return a.map((v, k) => (v + b[k]) / 2);
}

export function distance(a, b) {
  return Math.hypot(...a.map((v, k) => v - b[k]));
}

export function raised([x, y, z], height) {
  return [x, y, z + height];
}

// robot and part, of a radius about a centre, from the side that faces neither
export function robotAndPart(root, centre, radius) {
  const reach = distance(root, centre);
  const out = [centre[0] - root[0], centre[1] - root[1]];
  const length = Math.hypot(...out) || 1;
  const [x, y] = out.map((v) => v / length);
  return {
    centre: raised(middle(root, centre), 0.28 * reach),
    radius: 0.66 * reach + 0.6 * radius,
    from: [y - 0.45 * x, -x - 0.45 * y, 0.45],
  };
}

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function unit(v) {
  const size = Math.hypot(...v) || 1;
  return v.map((x) => x / size);
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
