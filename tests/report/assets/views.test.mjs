import assert from "node:assert/strict";
import test from "node:test";
import { origin, robotAndPart, viewOf } from "../../../postproc/report/assets/views.js";

function dot(a, b) {
  return a.reduce((sum, v, k) => sum + v * b[k], 0);
}

test("the origin of a frame", () => {
  assert.deepEqual(origin([1, 0, 0, 7, 0, 1, 0, 8, 0, 0, 1, 9, 0, 0, 0, 1]), [7, 8, 9]);
});

test("robot and part are seen from the side and from above, a little from the robot's end", () => {
  const [root, part] = [
    [1, 1, 0],
    [3, 4, 1],
  ];
  const { centre, radius, from } = robotAndPart(root, part, 0.5);
  const reach = Math.sqrt(14);
  assert.deepEqual(centre.slice(0, 2), [2, 2.5]);
  assert.ok(radius > reach / 2);
  assert.ok(from[2] > 0);
  const level = from.slice(0, 2);
  const out = [2, 3].map((v) => v / Math.sqrt(13));
  assert.ok(Math.abs(dot(level, out) + 0.45) < 1e-12);
  assert.ok(Math.abs(dot(level, [out[1], -out[0]]) - 1) < 1e-12);
});

test("a part right above the root is seen too", () => {
  const { from, radius } = robotAndPart([0, 0, 0], [0, 0, 1], 0.3);
  assert.deepEqual(from.map(Math.abs), [0, 0, 0.45]);
  assert.ok(radius > 0.5);
});

test("all points are in view, and some at its edge", () => {
  const points = [
    [0, 0, 0],
    [3, 0, 0],
    [0, 2, 1],
    [1, 1, 4],
  ];
  const from = [1, -2, 0.7];
  const { target, distance } = viewOf(points, from, 0.35, 0.5);
  const size = Math.hypot(...from);
  const back = from.map((v) => v / size);
  const level = Math.hypot(back[0], back[1]);
  const right = [-back[1] / level, back[0] / level, 0];
  const up = [
    back[1] * right[2] - back[2] * right[1],
    back[2] * right[0] - back[0] * right[2],
    back[0] * right[1] - back[1] * right[0],
  ];
  const eye = target.map((v, k) => v + distance * back[k]);
  const along = (p, way) => p.reduce((sum, v, k) => sum + (v - eye[k]) * way[k], 0);
  const shares = points.map((p) =>
    Math.max(
      Math.abs(along(p, right)) / -along(p, back) / 0.5,
      Math.abs(along(p, up)) / -along(p, back) / 0.35,
    ),
  );
  assert.ok(Math.max(...shares) < 1.001);
  assert.ok(Math.max(...shares) > 0.98);
});
