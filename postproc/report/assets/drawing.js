// When the view is drawn: on demand, one frame under way at most, coarse until it rests.
const REST = 250; // ms without a turn after which all detail is back
const POLL = 8; // ms

export class Drawing {
  #render;
  #gl;
  #asked = false;
  #busy = false;
  #pairs = new Set();
  #resting = 0;

  // gl: a WebGL 2 context; render(): draws one frame in it
  constructor(gl, render) {
    this.#gl = gl;
    this.#render = render;
  }

  // draws before the next frame; what is asked for while one is under way is one more, not a queue
  ask() {
    this.#asked = true;
    if (this.#busy) return;
    this.#busy = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#render();
      const done = this.#gl.fenceSync(this.#gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      this.#gl.flush();
      this.#wait(done);
    });
  }

  // adds an object to a parent, drawn while the view rests, and those that are drawn while it turns
  // (null: the same); returns what takes them away
  show(parent, fine, coarse) {
    const pair = [fine, coarse ?? []];
    parent.add(fine, ...pair[1]);
    if (coarse) this.#pairs.add(pair);
    this.#coarse(false);
    return () => {
      this.#pairs.delete(pair);
      for (const object of pair.flat()) {
        object.removeFromParent();
        object.geometry.dispose();
      }
    };
  }

  // draws what orbit controls change, coarse while the pointer or the wheel turns
  follow(controls) {
    let held = false;
    controls.addEventListener("start", () => (held = true));
    controls.addEventListener("end", () => (held = false));
    controls.addEventListener("change", () => {
      if (held) this.#turn();
      this.ask();
    });
  }

  // coarse until the view has rested
  #turn() {
    this.#coarse(true);
    clearTimeout(this.#resting);
    this.#resting = setTimeout(() => (this.#busy ? this.#turn() : this.#rest()), REST);
  }

  #rest() {
    this.#coarse(false);
    this.ask();
  }

  #coarse(on) {
    for (const [fine, coarse] of this.#pairs) {
      fine.visible = !on;
      for (const object of coarse) object.visible = on;
    }
  }

  // a lost context has no fence, and its frames are done
  #wait(done) {
    if (done && this.#gl.getSyncParameter(done, this.#gl.SYNC_STATUS) === this.#gl.UNSIGNALED) {
      setTimeout(() => this.#wait(done), POLL);
      return;
    }
    this.#gl.deleteSync(done);
    this.#busy = false;
    if (this.#asked) this.ask();
  }
}
