import assert from "node:assert/strict";
import test from "node:test";
import { css, ramp, valueColours } from "../../../postproc/report/assets/colours.js";

const BLUE = "rgb(44,76,164)";
const GREEN = "rgb(38,150,140)";
const RED = "rgb(200,40,40)";

test("the ramp goes from blue over green to red and holds at its ends", () => {
  assert.equal(css(ramp(0)), BLUE);
  assert.equal(css(ramp(1 / 3)), GREEN);
  assert.equal(css(ramp(1)), RED);
  assert.deepEqual(ramp(-5), ramp(0));
  assert.deepEqual(ramp(5), ramp(1));
});

test("between two stops the ramp is their mean", () => {
  const [first, middle, last] = [0, 1 / 6, 1 / 3].map(ramp);
  middle.forEach((v, k) => assert.ok(Math.abs(v - (first[k] + last[k]) / 2) < 1e-12));
});

test("red is the worse end of a column", () => {
  const values = [1, 2, 3, NaN];
  const low = valueColours({ values, worse: "low" });
  const high = valueColours({ values, worse: "high" });
  assert.equal(css(low.colourOf(0)), RED);
  assert.equal(css(low.colourOf(2)), BLUE);
  assert.equal(css(high.colourOf(0)), BLUE);
  assert.equal(css(high.colourOf(2)), RED);
  assert.deepEqual([low.low, low.high], [1, 3]);
});

test("the legend runs from the colour of the lowest value to that of the highest", () => {
  const { gradient } = valueColours({ values: [1, 3], worse: "low" });
  assert.ok(gradient.startsWith(`linear-gradient(90deg,${RED},`));
  assert.ok(gradient.endsWith(`,${GREEN},${BLUE})`));
});

test("a missing value has no colour; equal values have one", () => {
  assert.equal(valueColours({ values: [NaN, 1], worse: "low" }).colourOf(0), null);
  assert.equal(css(valueColours({ values: [2, 2], worse: "high" }).colourOf(1)), BLUE);
});
