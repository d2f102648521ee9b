import assert from "node:assert/strict";
import test from "node:test";
import { Arm } from "../../../postproc/report/assets/arm.js";

const ROOT = [5, 6, 7];

function translation([x, y, z]) {
  return [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];
}

// two links of 1 m and 0.5 m in a plane, both axes along z; the root stands apart from the world
const PLANAR = {
  link_frames: [translation([0, 0, 0]), translation([0, 0, 0]), translation([1.5, 0, 0.2])],
  joint_axes: [
    [0, 0, 1],
    [0, 0, 1],
  ],
  joint_points: [
    [0, 0, 0],
    [1, 0, 0],
  ],
  T_world_robroot: translation(ROOT),
};

function near(found, expected) {
  expected.forEach((v, k) => assert.ok(Math.abs(found[k] - v) < 1e-12, `${found} ${expected}`));
}

for (const [a, b] of [
  [0, 0],
  [0.3, -0.7],
  [Math.PI / 2, Math.PI / 2],
]) {
  test(`a planar arm at ${a}, ${b} rad`, () => {
    const arm = new Arm(PLANAR);
    arm.place([a, b]);
    const x = Math.cos(a) + 0.5 * Math.cos(a + b);
    const y = Math.sin(a) + 0.5 * Math.sin(a + b);
    near(arm.tip, [5 + x, 6 + y, 7.2]);
    // the first column of a frame is its x axis
    near(arm.frames[2].elements.slice(0, 3), [Math.cos(a + b), Math.sin(a + b), 0]);
    near(arm.frames[1].elements.slice(0, 3), [Math.cos(a), Math.sin(a), 0]);
  });
}

test("an arm that is placed anew forgets where it stood", () => {
  const arm = new Arm(PLANAR);
  arm.place([1, 2]);
  arm.stand(translation([0, 0, 0]));
  arm.place([0, 0]);
  near(arm.tip, [1.5, 0, 0.2]);
});
