// A handle in the 3D view by which something is moved or turned; frames are matrices in the world.
import { Group, TransformControls } from "./three.bundle.js";

const SIZE = 0.8;

export class Handle {
  #grip = new Group();
  #controls;
  #on;

  // view: {scene, camera, canvas, controls, draw}; on: {move(matrix), end(matrix)}
  constructor({ scene, camera, canvas, controls, draw }, on) {
    this.#on = on;
    this.#controls = new TransformControls(camera, canvas);
    this.#controls.setSpace("local");
    this.#controls.setSize(SIZE);
    scene.add(this.#grip, this.#controls.getHelper());
    this.#controls.addEventListener("change", draw);
    this.#controls.addEventListener("dragging-changed", ({ value }) => {
      controls.enabled = !value;
      if (!value) this.#tell("end");
    });
    this.#controls.addEventListener("objectChange", () => this.#tell("move"));
  }

  // puts the handle at a frame; null takes it away
  at(matrix) {
    if (this.#controls.dragging) return;
    if (!matrix) {
      this.#controls.detach();
      return;
    }
    matrix.decompose(this.#grip.position, this.#grip.quaternion, this.#grip.scale);
    this.#grip.updateMatrixWorld(true);
    this.#controls.attach(this.#grip);
  }

  get turns() {
    return this.#controls.mode === "rotate";
  }

  set turns(turns) {
    this.#controls.setMode(turns ? "rotate" : "translate");
  }

  get axis() {
    return this.#controls.axis;
  }

  #tell(what) {
    this.#grip.updateMatrixWorld(true);
    this.#on[what](this.#grip.matrixWorld.clone());
  }
}
