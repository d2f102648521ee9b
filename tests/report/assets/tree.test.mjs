import assert from "node:assert/strict";
import test from "node:test";
import { runsOf } from "../../../postproc/report/assets/tree.js";

test("a run ends where the operation or the tool changes", () => {
  const found = runsOf([0, 0, 1, 1, 1, 0], [0, 0, 0, 1, 1, 1]);
  assert.deepEqual(
    found.map(({ first, last }) => [first, last]),
    [
      [0, 1],
      [2, 2],
      [3, 4],
      [5, 5],
    ],
  );
});
