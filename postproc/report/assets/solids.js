// The solids of a cell as meshes: links and tools carried by the arm, workpiece, obstacles.
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Mesh,
  MeshLambertMaterial,
} from "./three.bundle.js";
import { unpack } from "./data.js";

const COLOURS = {
  link: 0xe8792b,
  tool: 0x6c7a89,
  cutting: 0x37474f,
  workpiece: 0x9fb8cf,
  obstacle: 0xb0a18f,
  rail: 0x8a949e,
};
const OTHER = 0x999999;
const COLLIDING = 0xd32f2f;

function meshOf(body) {
  const indexed = new BufferGeometry();
  indexed.setAttribute("position", new BufferAttribute(unpack(body.vertices), 3));
  indexed.setIndex(new BufferAttribute(new Uint32Array(unpack(body.faces)), 1));
  const flat = indexed.toNonIndexed();
  flat.computeVertexNormals();
  const clear = body.kind === "workpiece";
  const material = new MeshLambertMaterial({
    color: COLOURS[body.kind] ?? OTHER,
    side: DoubleSide,
    transparent: clear,
    opacity: clear ? 0.85 : 1,
  });
  const mesh = new Mesh(flat, material);
  mesh.matrixAutoUpdate = false;
  return mesh;
}

export class Solids {
  #parts;

  // puts the workpiece into one group, all others into another
  constructor(bodies, world, workpiece) {
    this.#parts = bodies.map((body) => ({ ...body, mesh: meshOf(body) }));
    for (const { kind, mesh } of this.#parts) (kind === "workpiece" ? workpiece : world).add(mesh);
  }

  // shows what is there while a tool works in a base (their places in the cell)
  work(tool, base) {
    for (const { mesh, tool: own, bases } of this.#parts) {
      mesh.visible = (own < 0 || own === tool) && (!bases.length || bases.includes(base));
    }
  }

  // names of the solids that are shown
  get shown() {
    return this.#parts.filter(({ mesh }) => mesh.visible).map(({ name }) => name);
  }

  // corners in the world of the boxes around the solids that are shown
  *corners() {
    for (const { mesh } of this.#parts) {
      if (!mesh.visible) continue;
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      for (let k = 0; k < 8; k++) {
        const corner = min
          .clone()
          .set(...["x", "y", "z"].map((a, j) => ((k >> j) & 1 ? max : min)[a]));
        yield corner.applyMatrix4(mesh.matrix).applyMatrix4(mesh.parent.matrix).toArray();
      }
    }
  }

  // moves what the links carry to the frames of the links
  carry(frames) {
    for (const { mesh, link, off } of this.#parts) {
      if (link < 0) continue;
      mesh.matrix.copy(frames[link]);
      if (off) mesh.matrix.multiply(off);
    }
  }

  // takes a tool (in the frame of its link) or a fixture (in the world) off its place; null: back
  shift(kind, index, off) {
    const fixtures = this.#parts.filter((part) => part.kind === "obstacle");
    const tools = this.#parts.filter((part) => part.tool === index);
    for (const part of kind === "tool" ? tools : fixtures.slice(index, index + 1)) {
      part.off = off;
      if (part.link >= 0) continue;
      if (off) part.mesh.matrix.copy(off);
      else part.mesh.matrix.identity();
    }
  }

  // shows solids of some names in red, the others in the colour of their kind
  highlight(names) {
    for (const { name, kind, mesh } of this.#parts) {
      mesh.material.color.set(names.includes(name) ? COLLIDING : (COLOURS[kind] ?? OTHER));
    }
  }
}
