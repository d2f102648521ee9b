import assert from "node:assert/strict";
import test from "node:test";
import { Vector3 } from "../../../postproc/report/assets/three.bundle.js";
import { arc, trail } from "../../../postproc/report/assets/trail.js";

const CENTRE = new Vector3(1, 2, 3);

// a point of a circle of radius 2 about CENTRE, in a plane that holds (0, 1, 0)
function onCircle(degrees) {
  const t = (degrees * Math.PI) / 180;
  const x = new Vector3(0.6, 0, 0.8).multiplyScalar(2 * Math.cos(t));
  return x.add(new Vector3(0, 2 * Math.sin(t), 0)).add(CENTRE);
}

for (const [from, via, to] of [
  [10, 40, 120],
  [10, 200, 350],
  [120, 40, 10],
  [0, 300, 200],
]) {
  test(`an arc from ${from} over ${via} to ${to} deg`, () => {
    const points = arc(onCircle(from), onCircle(via), onCircle(to));
    for (const point of points) assert.ok(Math.abs(point.distanceTo(CENTRE) - 2) < 1e-12);
    assert.ok(points[0].distanceTo(onCircle(from)) < 1e-12);
    assert.ok(points.at(-1).distanceTo(onCircle(to)) < 1e-12);
    const steps = points.slice(1).map((point, i) => point.distanceTo(points[i]));
    assert.ok(Math.max(...steps) <= 0.4);
    assert.ok(Math.min(...points.map((point) => point.distanceTo(onCircle(via)))) <= 0.2);
  });
}

test("three points on a line are no arc", () => {
  const points = [0, 1, 2].map((x) => new Vector3(x, 0, 0));
  assert.deepEqual(arc(...points), points);
});

function packed(type, values) {
  return { type, data: Buffer.from(values.buffer).toString("base64") };
}

test("segments know their move, arcs are cut into pieces", () => {
  const positions = Float32Array.from([0, 0, 0, 1, 0, 0, 1, 2, 0]);
  const data = {
    aux: packed("float32", Float32Array.from([2, 1, 0])),
    circles: packed("int32", Int32Array.from([2])),
  };
  const { ends, owner } = trail(data, positions);
  assert.deepEqual(ends.slice(0, 6), [0, 0, 0, 1, 0, 0]);
  assert.equal(ends.length, 6 * owner.length);
  assert.equal(owner[0], 1);
  assert.deepEqual(new Set(owner.slice(1)), new Set([2]));
  // half a circle of radius 1: 3.14 rad in pieces of at most 0.2
  assert.equal(owner.length, 1 + 16);
});

test("a path that was sampled before is taken as it is", () => {
  const data = {
    trail: packed("float32", Float32Array.from([0, 0, 0, 1, 0, 0, 1, 2, 0])),
    owner: packed("int32", Int32Array.from([0, 4, 5])),
  };
  const { ends, owner } = trail(data, new Float32Array(0));
  assert.deepEqual(ends, [0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 2, 0]);
  assert.deepEqual(owner, [4, 5]);
});
