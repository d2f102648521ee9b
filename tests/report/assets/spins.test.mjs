import assert from "node:assert/strict";
import test from "node:test";
import { tagAndSpin, wordsOf } from "../../../postproc/report/assets/spin_cells.js";
import { SpinMap } from "../../../postproc/report/assets/spins.js";

function packed(type, values) {
  return { type, data: Buffer.from(values.buffer).toString("base64") };
}

const LEVELS = {
  spins: [-90, 0, 90],
  low: 100,
  step: 0.5,
  level: packed("uint16", Uint16Array.from([1, 2, 3, 0, 101, 1])),
  hit: packed("uint8", new Uint8Array(6)),
};

test("levels are stiffness, level 0 is a gap", () => {
  const map = new SpinMap(LEVELS);
  assert.deepEqual(map.curve(0), [100, 100.5, 101]);
  assert.deepEqual(map.curve(1), [NaN, 150, 100]);
});

test("where nothing collides all spins are free", () => {
  const [all, free] = new SpinMap(LEVELS).lines(1, "stiffness");
  assert.deepEqual(free.y, all.y);
});

test("spins that collide are left out of the line of free ones", () => {
  const hit = packed("uint8", Uint8Array.from([0, 1, 0, 0, 0, 1]));
  const [all, free] = new SpinMap({ ...LEVELS, hit }).lines(1, "stiffness");
  assert.deepEqual(all.y, [NaN, 150, 100]);
  assert.deepEqual(free.y, [NaN, 150, NaN]);
  assert.equal(free.name, "free, stiffness");
});

const PICTURE = {
  box: [10, 20, 200, 90],
  spins: [-90, 0, 90],
  names: [
    ["H1", "H1"],
    ["H2", "H5"],
  ],
  lines: [4, 5],
  words: ["free", "collision"],
  classes: [0, 0, 1, 0, 1, 0],
  stiffness: [1500.4, 1, NaN, 2, NaN, 3],
  chosen: [-45.25, NaN],
};

test("the first spin stands at the bottom of the picture", () => {
  assert.deepEqual(tagAndSpin(PICTURE, 11, 109), [0, 0]);
  assert.deepEqual(tagAndSpin(PICTURE, 11, 21), [0, 2]);
  assert.deepEqual(tagAndSpin(PICTURE, 209, 65), [1, 1]);
});

test("beside the picture there is nothing", () => {
  const beside = [
    [9, 50],
    [211, 50],
    [50, 19],
    [50, 111],
  ];
  for (const [x, y] of beside) assert.equal(tagAndSpin(PICTURE, x, y), null);
});

test("words say tag, line, spin, class, stiffness and what was chosen", () => {
  const first = "tag H1 (CAM line 4), -90 deg: free, 1500 N/mm; chosen -45.3 deg";
  assert.equal(wordsOf(PICTURE, 0, 0), first);
  assert.equal(wordsOf(PICTURE, 1, 1), "tags H2 to H5 (CAM line 5), 0 deg: collision");
});
