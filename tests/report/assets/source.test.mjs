import assert from "node:assert/strict";
import test from "node:test";
import { camLines, linesNear, linesOfMoves } from "../../../postproc/report/assets/source.js";

const CAM = camLines("7\tFEDRAT/600\n8\tGOTO/1,2,3\n9\tGOTO/4\t5\n12\tFINI");
const PROGRAM = Array.from({ length: 200 }, (_, i) => `line ${i + 1}`);

test("lines of the CAM file keep their numbers and their tabs", () => {
  assert.deepEqual([...CAM.keys()], [7, 8, 9, 12]);
  assert.equal(CAM.get(9), "GOTO/4\t5");
});

test("two lines before and after a line of the CAM file are shown", () => {
  assert.deepEqual(
    linesNear(CAM, 8).map(({ number, here }) => [number, here]),
    [
      [7, false],
      [8, true],
      [9, false],
    ],
  );
  assert.deepEqual(linesNear(CAM, 0), []);
});

test("the lines of several moves are shown with what stands between", () => {
  const moves = new Map([
    [20, 5],
    [23, 6],
  ]);
  assert.deepEqual(linesOfMoves(PROGRAM, moves), [
    { number: 20, text: "line 20", here: true, move: 5 },
    { number: 21, text: "line 21", here: false, move: undefined },
    { number: 22, text: "line 22", here: false, move: undefined },
    { number: 23, text: "line 23", here: true, move: 6 },
  ]);
});

test("a single line is shown among its neighbours, within the program", () => {
  const numbers = (line) => linesOfMoves(PROGRAM, new Map([[line, 1]])).map((l) => l.number);
  assert.deepEqual(numbers(50), [47, 48, 49, 50, 51, 52, 53]);
  assert.deepEqual(numbers(2), [1, 2, 3, 4, 5]);
  assert.deepEqual(numbers(199), [196, 197, 198, 199, 200]);
});

test("no more than sixty lines are shown", () => {
  const moves = new Map([
    [10, 1],
    [190, 2],
  ]);
  const shown = linesOfMoves(PROGRAM, moves);
  assert.equal(shown.length, 60);
  assert.equal(shown.at(-1).number, 69);
});
