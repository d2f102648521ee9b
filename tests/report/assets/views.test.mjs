import assert from "node:assert/strict";
import test from "node:test";
import { origin, robotAndPart } from "../../../postproc/report/assets/views.js";

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
