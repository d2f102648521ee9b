import assert from "node:assert/strict";
import test from "node:test";
import { columnField, rowsInSight, scrollTo } from "../../../postproc/report/assets/list.js";
import { sortKeys } from "../../../postproc/report/assets/tables.js";

test("a column is a field whose missing values are null", () => {
  const [name, value] = columnField({ label: "stiffness", unit: "N/mm", values: [1.5, NaN] });
  assert.equal(name, "stiffness [N/mm]");
  assert.equal(value(0), 1.5);
  assert.equal(value(1), null);
});

test("only rows in sight stand in the document, ten more at either end", () => {
  assert.deepEqual(rowsInSight(0, 240, 10000), [0, 30]);
  assert.deepEqual(rowsInSight(2400, 240, 10000), [90, 120]);
  assert.deepEqual(rowsInSight(24 * 9995, 240, 10000), [9985, 10000]);
  assert.deepEqual(rowsInSight(0, 240, 3), [0, 3]);
});

test("every row on the screen is among those that stand in the document", () => {
  for (let scrollTop = 0; scrollTop < 24 * 500; scrollTop += 7) {
    const [first, end] = rowsInSight(scrollTop, 560, 1000);
    assert.ok(first * 24 <= scrollTop && end * 24 >= scrollTop + 560);
  }
});

test("the list scrolls only to a row out of sight, which then stands in the middle", () => {
  assert.equal(scrollTo(5, 0, 480), 0);
  assert.equal(scrollTo(100, 0, 480), 100 * 24 - 240);
  assert.equal(scrollTo(2, 2400, 480), 0);
  assert.equal(scrollTo(-1, 777, 480), 777);
});

test("columns of numbers are sorted by value, others as text", () => {
  assert.deepEqual(sortKeys(["10 mm", "9", "-", ""]), [10, 9, null, null]);
  assert.deepEqual(sortKeys(["10", "nine"]), ["10", "nine"]);
});
