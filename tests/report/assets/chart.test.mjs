import assert from "node:assert/strict";
import test from "node:test";
import {
  chartAxes,
  csvOf,
  decimate,
  linePath,
  nearestIndex,
  ticks,
  within,
} from "../../../postproc/report/assets/chart.js";

const SAME = { toX: (v) => v, toY: (v) => v };

test("ticks are round and lie within the range", () => {
  assert.deepEqual(ticks(0, 10, 5), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual(ticks(-0.3, 0.31, 5), [-0.2, 0, 0.2]);
  assert.deepEqual(ticks(0.1, 0.35, 5), [0.1, 0.15, 0.2, 0.25, 0.3, 0.35]);
  assert.deepEqual(ticks(980, 2100, 5), [1000, 1500, 2000]);
});

test("a short line is drawn as it is", () => {
  assert.equal(decimate([1, 2, 3, 4], 2), null);
});

test("decimation keeps every peak, in order", () => {
  const y = Float64Array.from({ length: 100000 }, (_, i) => Math.sin(i / 900));
  y[31415] = 9;
  y[27182] = -8;
  const kept = decimate(y, 500);
  assert.ok(kept.length <= 1000);
  assert.ok(kept.includes(31415) && kept.includes(27182));
  assert.ok(kept.every((v, i) => i === 0 || v > kept[i - 1]));
});

test("decimation keeps the lowest and the highest value of each bucket", () => {
  assert.deepEqual(decimate([0, 0.2, 0.1, 0.3, 0.1, 0.2], 2), [0, 1, 3, 4]);
});

test("decimation keeps a gap", () => {
  const y = [1, 2, 3, NaN, NaN, NaN, 5, 5, 5];
  assert.deepEqual(decimate(y, 3), [0, 2, 5, 6]);
});

test("a path is broken where a value is missing", () => {
  const line = { x: [0, 1, 2, 3, 4], y: [5, 6, NaN, 7, 8] };
  assert.equal(linePath(line, SAME, 100), "M0.0 5.0L1.0 6.0M3.0 7.0L4.0 8.0");
});

test("axes hold all values and levels with a margin", () => {
  const series = [
    { x: [0, 10], y: [1, 2] },
    { x: [5, 20], y: [NaN, 3] },
  ];
  const { x, y } = chartAxes(series, [{ y: -7 }], 600, 220);
  assert.deepEqual(x, [0, 20]);
  assert.ok(Math.abs(y[0] + 7.4) < 1e-12 && Math.abs(y[1] - 3.4) < 1e-12);
});

test("axes map ends to the margins, and pixels back to values", () => {
  const axes = chartAxes([{ x: [2, 4], y: [0, 1] }], [], 600, 220);
  assert.equal(axes.toX(2), 58);
  assert.equal(axes.toX(4), 588);
  assert.equal(axes.toY(axes.y[0]), 186);
  assert.equal(axes.toY(axes.y[1]), 22);
  assert.ok(Math.abs(axes.fromX(axes.toX(3.3)) - 3.3) < 1e-12);
});

test("one value alone has axes, none has not", () => {
  assert.deepEqual(chartAxes([{ x: [5], y: [1] }], [], 600, 220).x, [4, 6]);
  assert.equal(chartAxes([{ x: [], y: [] }], [], 600, 220), null);
  assert.equal(chartAxes([{ x: [1], y: [NaN] }], [], 600, 220), null);
});

test("a range keeps the values on its either side, and CSV holds what was given", () => {
  const line = { name: "a", x: [0, 1, 2, 3, 4], y: [5, 6, NaN, 8, 9] };
  const [kept] = within([line], [1.5, 2.5]);
  assert.deepEqual(kept.x, [1, 2, 3]);
  assert.equal(nearestIndex(line.x, 2.6), 3);
  assert.equal(csvOf([line], "t"), 'line,"t",value\n"a",0,5\n"a",1,6\n"a",2,\n"a",3,8\n"a",4,9\n');
});
