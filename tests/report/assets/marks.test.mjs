import assert from "node:assert/strict";
import test from "node:test";
import {
  lineSegments,
  MANY,
  pointMarks,
  standCone,
} from "../../../postproc/report/assets/marks.js";
import { Solids } from "../../../postproc/report/assets/solids.js";
import {
  Group,
  Matrix4,
  Raycaster,
  Vector3,
} from "../../../postproc/report/assets/three.bundle.js";

const SIZE = 0.01;

for (const axis of [
  [0, 0, 1],
  [0, 1, 0],
  [0, -2, 0],
  [1, -2, 0.5],
]) {
  test(`a cone stands with its tip at the point, along ${axis}`, () => {
    const place = standCone(new Matrix4(), [1, 2, 3], axis, SIZE);
    // a cone of three.js has its tip at half its height along y
    const tip = new Vector3(0, 1.5 * SIZE, 0).applyMatrix4(place);
    assert.ok(tip.distanceTo(new Vector3(1, 2, 3)) < 1e-12);
    const foot = new Vector3(0, -1.5 * SIZE, 0).applyMatrix4(place).sub(tip);
    assert.ok(foot.distanceTo(new Vector3(...axis).setLength(3 * SIZE)) < 1e-12);
    assert.ok(Math.abs(place.determinant() - 1) < 1e-12);
  });
}

test("a ray meets the mark that it is aimed at, of few and of many", () => {
  for (const n of [3, MANY + 1]) {
    const points = Float32Array.from({ length: 3 * n }, (_, k) => (k % 3 ? 0 : k / 3));
    const { mesh, indexOf } = pointMarks(points, null, SIZE);
    const picked = [0, 1, 2, 0.5].map((x) => {
      const ray = new Raycaster(new Vector3(x, -5, SIZE / 2), new Vector3(0, 1, 0));
      ray.params.Line.threshold = SIZE;
      const [hit] = ray.intersectObject(mesh);
      return hit && indexOf(hit);
    });
    assert.deepEqual(picked, [0, 1, 2, undefined]);
  }
});

test("marks are painted one by one", () => {
  const { mesh, paint } = pointMarks(new Float32Array(6), null, SIZE);
  paint((i) => [i, 0, 1]);
  assert.deepEqual(Array.from(mesh.instanceColor.array), [0, 0, 1, 1, 0, 1]);
});

test("both ends of a segment have its colour", () => {
  const { lines, paint } = lineSegments([0, 0, 0, 1, 0, 0, 1, 0, 0, 2, 0, 0]);
  paint((i) => [i, 1, 0]);
  const colours = Array.from(lines.geometry.attributes.color.array);
  assert.deepEqual(colours, [0, 1, 0, 0, 1, 0, 1, 1, 0, 1, 1, 0]);
});

function box(name, kind, link) {
  const vertices = Buffer.from(Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0]).buffer);
  const faces = Buffer.from(Uint16Array.from([0, 1, 2]).buffer);
  return {
    ...{ name, kind, link },
    vertices: { type: "float32", data: vertices.toString("base64") },
    faces: { type: "uint16", data: faces.toString("base64") },
  };
}

test("links move with their frames; what collides is red and turns back", () => {
  const [world, workpiece] = [new Group(), new Group()];
  const bodies = [box("link 1", "link", 1), box("part", "workpiece", -1)];
  const solids = new Solids(bodies, world, workpiece);
  assert.deepEqual([world.children.length, workpiece.children.length], [1, 1]);
  const [link] = world.children;
  solids.carry([new Matrix4(), new Matrix4().makeTranslation(0, 0, 9)]);
  assert.equal(link.matrix.elements[14], 9);
  assert.equal(workpiece.children[0].matrix.elements[14], 0);
  const usual = link.material.color.getHex();
  solids.highlight(["link 1"]);
  assert.equal(link.material.color.getHex(), 0xd32f2f);
  assert.notEqual(workpiece.children[0].material.color.getHex(), 0xd32f2f);
  solids.highlight([]);
  assert.equal(link.material.color.getHex(), usual);
});
