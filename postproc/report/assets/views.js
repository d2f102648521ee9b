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
