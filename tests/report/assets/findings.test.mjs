import assert from "node:assert/strict";
import test from "node:test";
import { groupsOf } from "../../../postproc/report/assets/findings.js";

test("findings are grouped by severity and code, errors first", () => {
  const rows = [
    ["a", "", "note", null, "PLN302"],
    ["b", "", "error", 3, "PLN101"],
    ["c", "", "warning", 1, "PLN303"],
    ["d", "", "error", 4, "PLN101"],
  ];
  const found = groupsOf(rows).map(({ severity, rows: own }) => [severity, own.length]);
  assert.deepEqual(found, [
    ["error", 2],
    ["warning", 1],
    ["note", 1],
  ]);
});
