import assert from "node:assert/strict";
import { test } from "node:test";
import { frameOf, matrixOf } from "../../../postproc/report/assets/frames.js";

test("a frame survives the way to a matrix and back", () => {
  for (const [xyz, abc] of [
    [
      [1700, -20.5, 700],
      [0, 0, 0],
    ],
    [
      [0, 0, 420],
      [90, -30, 179],
    ],
    [
      [1, 2, 3],
      [40, 90, 0],
    ],
    [
      [1, 2, 3],
      [-140, -90, 0],
    ],
  ]) {
    const found = frameOf(matrixOf(xyz, abc));
    assert.deepEqual(found.xyz_mm, xyz);
    const [a, b] = [matrixOf(xyz, abc), matrixOf(xyz, found.abc_deg)].map((m) => m.elements);
    a.forEach((v, k) => assert.ok(Math.abs(v - b[k]) < 1e-4));
  }
});

test("A, B, C are turns about z, y, x in this order", () => {
  const { elements } = matrixOf([0, 0, 0], [90, 0, 90]);
  const column = (k) => elements.slice(4 * k, 4 * k + 3).map((v) => Math.round(v));
  assert.deepEqual(
    [column(0), column(1), column(2)].flat().map((v) => v + 0),
    [0, 1, 0, 0, 0, 1, 1, 0, 0],
  );
});
