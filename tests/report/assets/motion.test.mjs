import assert from "node:assert/strict";
import test from "node:test";
import {
  anglesAt,
  jointCurves,
  moveAt,
  movesOfTags,
  nearestMove,
} from "../../../postproc/report/assets/motion.js";

const TIME = Float32Array.from([0, 2, 2, 6]);
const ROWS = [
  [0, 0, 0, 0, 0, 0],
  [1, 2, 3, 4, 5, 6],
  [1, 2, 3, 4, 5, 6],
  [3, 2, 1, 0, -1, -2],
];
const Q = Float32Array.from(ROWS.flat());

test("the move at a time is the first that ends there or later", () => {
  const cases = { 0: 0, 0.1: 1, 2: 1, 2.1: 3, 6: 3, 99: 3 };
  for (const [t, move] of Object.entries(cases)) assert.equal(moveAt(TIME, +t), move);
  assert.equal(moveAt([], 0), -1);
});

test("angles lie between start and end of the move", () => {
  assert.deepEqual(anglesAt(Q, TIME, 0, 0), ROWS[0]);
  assert.deepEqual(anglesAt(Q, TIME, 1, 1), [0.5, 1, 1.5, 2, 2.5, 3]);
  assert.deepEqual(anglesAt(Q, TIME, 2, 2), ROWS[2]);
  assert.deepEqual(anglesAt(Q, TIME, 3, 5), [2.5, 2, 1.5, 1, 0.5, 0]);
});

test("a tag has its first and its last move", () => {
  const { first, last } = movesOfTags(Int32Array.from([-1, 0, 0, -1, 2]), 3);
  assert.deepEqual(Array.from(first), [1, -1, 4]);
  assert.deepEqual(Array.from(last), [2, -1, 4]);
});

test("a tag without a motion is shown from the nearest that has one", () => {
  const points = [
    [0, 0, 0],
    [1, 0, 0],
    [1.1, 0, 0],
    [0, 0.5, 0],
  ].flat();
  assert.equal(nearestMove(points, [7, -1, 9, 5], 1), 9);
  assert.equal(nearestMove(points, [-1, 8, -1, 5], 0), 5);
  assert.equal(nearestMove(points, [-1, -1, -1, -1], 0), -1);
});

test("joint speeds are means of the moves, in percent of the limit", () => {
  const { angle, speed } = jointCurves(Q, TIME, 0, 90);
  const radian = 57.29577951308232;
  assert.ok(Math.abs(angle[3] - 3 * radian) < 1e-9);
  assert.deepEqual([speed[0], speed[2]], [0, 0]);
  assert.ok(Math.abs(speed[1] - ((radian / 2) * 100) / 90) < 1e-9);
  assert.ok(Math.abs(speed[3] - ((2 * radian) / 4 / 90) * 100) < 1e-9);
});
