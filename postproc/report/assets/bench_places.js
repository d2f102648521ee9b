// Where part, tools and fixtures stand: by numbers, or by the handle in the 3D view.
import { matrix } from "./arm.js";
import { latest } from "./bench_calls.js";
import { unpack } from "./data.js";
import { byId, element } from "./dom.js";
import { frameOf, matrixOf } from "./frames.js";
import { Handle } from "./handle.js";

export class Places {
  #inputs = Array.from(document.querySelectorAll("input.place"));
  #on;
  #handle = null;
  #ask;
  preview = false; // what is shown stands elsewhere than in the plan

  // on: {things(), program(), paint(classes), paintAgain()}
  constructor(complain, on) {
    this.#on = on;
    this.#ask = latest("reach", (found) => this.#show(found), complain);
    for (const input of this.#inputs) input.addEventListener("input", () => this.#move());
    byId("thing").addEventListener("change", () => this.back());
    byId("back").addEventListener("click", () => this.back());
    byId("turn").addEventListener("click", () => {
      this.#handle.turns = !this.#handle.turns;
      byId("turn").textContent = this.#handle.turns ? "shift" : "turn";
    });
  }

  // a plan was loaded
  load() {
    const things = this.#on.things();
    const chosen = byId("thing").value;
    byId("thing").replaceChildren(
      ...things.map(({ name }, k) => element("option", { value: k, textContent: name })),
    );
    if (chosen && +chosen < things.length) byId("thing").value = chosen;
    const dragged = (there) => this.#dragged(there);
    this.#handle ??= this.#scene.handle(Handle, { move: dragged, end: dragged });
    this.preview = false;
    this.back();
  }

  // the frame asked for, of what is chosen
  frame() {
    const values = this.#inputs.map(({ value }) => (value.trim() ? +value : NaN));
    const { kind, index } = this.#thing;
    return { kind, index, xyz_mm: values.slice(0, 3), abc_deg: values.slice(3) };
  }

  back() {
    const thing = this.#thing;
    const program = this.#on.program();
    if (!thing || !program) return;
    this.#fill(thing);
    for (const { kind, index } of this.#on.things()) this.#scene.shift(kind, index, null);
    const { robot } = program.data;
    this.#scene.stand(robot.T_world_robroot, robot.T_world_base);
    this.#handle.at(this.#carrier.multiply(matrixOf(thing.xyz_mm, thing.abc_deg)));
    byId("reach").textContent = "";
    if (!this.preview) return;
    this.preview = false;
    this.#on.paintAgain();
  }

  // the handle's middle and a point on its x arrow [px of the window]; for whoever wants to drag it
  grip() {
    const { xyz_mm, abc_deg } = this.frame();
    const { elements } = this.#carrier.multiply(matrixOf(xyz_mm, abc_deg));
    const [origin, x] = [12, 0].map((k) => elements.slice(k, k + 3));
    const far = Math.hypot(...this.#scene.eye.map((v, k) => v - origin[k]));
    const arrow = origin.map((v, k) => v + 0.08 * far * x[k]);
    return [origin, arrow].map((point) => this.#scene.pixel(point));
  }

  // which arrow of the handle is under the pointer
  get held() {
    return this.#handle.axis;
  }

  get #scene() {
    return this.#on.program().scene;
  }

  get #thing() {
    return this.#on.things()[+byId("thing").value];
  }

  // the frame in the world from which the file counts that of what is chosen
  get #carrier() {
    const own = matrix(this.#thing.carrier);
    const link = this.#thing.kind === "tool" ? this.#scene.linkFrame(-1) : null;
    return link ? link.multiply(own) : own;
  }

  #fill({ xyz_mm, abc_deg }) {
    [...xyz_mm, ...abc_deg].forEach((value, k) => (this.#inputs[k].value = +value.toFixed(6)));
  }

  #dragged(there) {
    this.#fill(frameOf(this.#carrier.invert().multiply(there)));
    this.#move();
  }

  #move() {
    const asked = this.frame();
    if (![...asked.xyz_mm, ...asked.abc_deg].every(Number.isFinite)) return;
    this.#stand(matrixOf(asked.xyz_mm, asked.abc_deg));
    this.#ask(asked);
  }

  // shows what is chosen at a frame of the file
  #stand(T) {
    const { kind, index, xyz_mm, abc_deg, carrier } = this.#thing;
    const there = this.#carrier.multiply(T);
    this.#handle.at(there);
    if (kind === "part") {
      const rows = there.transpose().elements;
      const { robot } = this.#on.program().data;
      if (index === 0) this.#scene.stand(robot.T_world_robroot, rows);
      return;
    }
    const own = matrix(carrier);
    const former = own.clone().multiply(matrixOf(xyz_mm, abc_deg)).invert();
    this.#scene.shift(kind, index, own.multiply(T).multiply(former));
  }

  #show(found) {
    this.preview = true;
    const classes = unpack(found.classes);
    this.#on.paint(classes);
    byId("reach").textContent = found.words;
    byId("reach").className = classes.some((c) => c > 0) ? "bad" : "good";
  }
}
