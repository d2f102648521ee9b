// The tools as lines from the flange to their points, and how far the one shown is from its tag.
import {
  CylinderGeometry,
  Group,
  Mesh,
  MeshLambertMaterial,
  SphereGeometry,
  Vector3,
} from "./three.bundle.js";
import { element } from "./dom.js";
import { spell } from "./numbers.js";

const PINK = 0xe91e63;
const TOOL = 0x0d1a26;
const RADIUS = 0.006; // m
const TIP = 0.008; // m
const LEAST = 0.001; // m that is worth being told
const UP = new Vector3(0, 1, 0);

function rod(colour, settings = {}) {
  const material = new MeshLambertMaterial({ color: colour, ...settings });
  return new Mesh(new CylinderGeometry(RADIUS, RADIUS, 1, 8), material);
}

// puts a rod between two points
function span(mesh, from, to) {
  const way = to.clone().sub(from);
  mesh.position.copy(from).addScaledVector(way, 0.5);
  mesh.scale.set(1, Math.max(way.length(), 1e-9), 1);
  mesh.quaternion.setFromUnitVectors(UP, way.normalize());
}

export class Tips {
  #groups;
  #points;
  #gap = rod(PINK, { depthTest: false, transparent: true });
  #label = element("span", { className: "gap", hidden: true });

  // tips: of the tools in the frame of the flange's link; tool: the one in work
  constructor({ tips = [], tool = 0 }, scene, host) {
    this.#points = tips.map((tip) => new Vector3(...tip));
    this.#groups = this.#points.map((tip) => {
      const ball = new Mesh(new SphereGeometry(TIP, 16, 12), rod(PINK).material);
      const line = rod(TOOL);
      ball.position.copy(tip);
      span(line, new Vector3(), tip);
      const group = new Group();
      group.matrixAutoUpdate = false;
      group.add(line, ball);
      scene.add(group);
      return group;
    });
    this.#gap.visible = false;
    scene.add(this.#gap);
    host.append(this.#label);
    this.work(tool);
  }

  work(tool) {
    this.#groups.forEach((group, k) => (group.visible = k === tool));
  }

  // moves the tools with the frame of the flange's link
  carry(frame) {
    for (const { matrix } of this.#groups) matrix.copy(frame);
  }

  // the point of the tool in work in the world, null where there is none
  get point() {
    const k = this.#groups.findIndex(({ visible }) => visible);
    return k < 0 ? null : this.#points[k].clone().applyMatrix4(this.#groups[k].matrix).toArray();
  }

  // draws what is missing from the tool's point to one of the world; null: nothing
  miss(to) {
    const from = to && this.point;
    const far = from ? Math.hypot(...to.map((v, k) => v - from[k])) : 0;
    this.#gap.visible = far > LEAST;
    this.#label.hidden = !this.#gap.visible;
    if (!this.#gap.visible) return;
    span(this.#gap, new Vector3(...from), new Vector3(...to));
    this.#label.textContent = `${spell(Math.round(far * 1000))} mm missing`;
  }

  // puts the words beside the line; pixel: a point of the world in the element
  label(pixel) {
    if (this.#label.hidden) return;
    const [x, y] = pixel(this.#gap.position.toArray());
    const most = this.#label.parentElement.clientWidth - this.#label.offsetWidth;
    this.#label.style.transform = `translate(${Math.min(x + 10, most)}px,${y}px)`;
  }
}
