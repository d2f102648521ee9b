import assert from "node:assert/strict";
import test from "node:test";
import { gzipSync } from "node:zlib";
import { unpack, unpackColumns, unpackText } from "../../../postproc/report/assets/data.js";

// two little-endian numbers each
const PACKED = [
  ["float32", "0000c03f00000ac0", Float32Array, [1.5, -2.15625]],
  ["int32", "feffffff00010000", Int32Array, [-2, 256]],
  ["uint16", "0100ffff", Uint16Array, [1, 65535]],
  ["uint8", "07ff", Uint8Array, [7, 255]],
];

for (const [type, bytes, kind, values] of PACKED) {
  test(`packed ${type} are read`, () => {
    const data = Buffer.from(bytes, "hex").toString("base64");
    const found = unpack({ type, data });
    assert.ok(found instanceof kind);
    assert.deepEqual(Array.from(found), values);
  });
}

test("columns are unpacked with what they say of themselves", () => {
  const values = { type: "uint8", data: Buffer.from([3, 4]).toString("base64") };
  const [column] = unpackColumns([{ key: "feed", values }]);
  assert.equal(column.key, "feed");
  assert.deepEqual(Array.from(column.values), [3, 4]);
});

test("a packed text is read", async () => {
  const text = "1\tGOTO/0,0,0\n2\tλ = 5 µm";
  const data = gzipSync(text).toString("base64");
  assert.equal(await unpackText({ type: "gzip", data }), text);
});
