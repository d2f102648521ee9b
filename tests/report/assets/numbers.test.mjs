import assert from "node:assert/strict";
import test from "node:test";
import { extent, numberIn, sortedIndices, spell } from "../../../postproc/report/assets/numbers.js";

test("a value is spelt with four digits, small ones to four places", () => {
  assert.equal(spell(12.34567), "12.35");
  assert.equal(spell(-0.0123456), "-0.0123");
  assert.equal(spell(123456.7), "123500");
  assert.equal(spell(1.5), "1.5");
  assert.equal(spell(0.00001), "0");
});

test("whole numbers and texts stay as they are, nothing is empty", () => {
  assert.equal(spell(1234567), "1234567");
  assert.equal(spell("R04H12"), "R04H12");
  assert.equal(spell(0), "0");
  assert.equal(spell(null), "");
  assert.equal(spell(undefined), "");
});

test("a number is read off the begin of a cell", () => {
  assert.equal(numberIn("1,234.5 mm"), 1234.5);
  assert.equal(numberIn("−3.5"), -3.5);
  assert.equal(numberIn("+0.2"), 0.2);
  assert.equal(numberIn(".5"), 0.5);
  assert.equal(numberIn("A1"), null);
  assert.equal(numberIn("-"), null);
  assert.equal(numberIn(""), null);
});

test("the extent is that of finite values", () => {
  assert.deepEqual(extent([[3, NaN, -2], new Float32Array([7, Infinity, -Infinity])]), [-2, 7]);
  assert.deepEqual(extent([[NaN], []]), [Infinity, -Infinity]);
});

test("values are sorted with nulls last either way, equal ones as they came", () => {
  const values = [3, null, 1, 3, 2];
  assert.deepEqual(sortedIndices(values, true), [2, 4, 0, 3, 1]);
  assert.deepEqual(sortedIndices(values, false), [0, 3, 4, 2, 1]);
  assert.deepEqual(sortedIndices(["b", "a", "c"], true), [1, 0, 2]);
});
