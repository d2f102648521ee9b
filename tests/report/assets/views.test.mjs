import assert from "node:assert/strict";
import test from "node:test";
import { openSide, viewOf } from "../../../postproc/report/assets/views.js";

test("a part is looked at from where its face shows and the arm hides nothing", () => {
  const arm = [
    [0, 0, 0],
    [0, 0, 2],
    [2, 0, 2],
    [2, 0, 1],
  ];
  const points = Float64Array.from([-0.4, -0.2, 0, 0.2, 0.4].flatMap((y) => [2.6, y, 0.6]));
  const seen = (face) =>
    openSide(points, face && points.map((_, k) => face[k % 3]), (p) => p, [arm]);
  // a wall whose face the robot works at: from its side, past the arm
  const wall = seen([-1, 0, 0]);
  assert.ok(wall[0] < 0 && Math.abs(wall[1]) > 0.2, `${wall}`);
  // a face that looks along y is seen from there
  const side = seen([0, -1, 0]);
  assert.ok(side[1] < -0.6, `${side}`);
  // a face that nobody states: past the arm all the same
  const unknown = seen(null);
  assert.ok(unknown[0] > -0.5 && unknown[2] > 0, `${unknown}`);
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
