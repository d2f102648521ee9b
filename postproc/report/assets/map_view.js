// The map of spin by tag, to be edited: a column per tag, the line of the plan, pins as squares.
import { mix } from "./colours.js";

const LEFT = 40; // px
const BELOW = 18;
const PULL = 3; // px that the pointer moves before it drags
const INK = "#1b2733";
const PIN = "#0b6bcb";
const SOFTEST = [226 / 255, 240 / 255, 250 / 255];
const STIFFEST = [11 / 255, 78 / 255, 140 / 255];

function rgb(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

export class MapView {
  #canvas;
  #colours;
  #on;
  #map = null; // {spins, classes, stiffness, chosen, pins, names}
  #first = 0;
  #count = 1;
  #shown = -1;
  #trial = null; // {tag, spin}
  #range = [0, 1];

  // colours: one per class; on: {select(tag), drag(tag, spin), drop(tag, spin), cancel(tag), unpin(tag)}
  constructor(canvas, colours, on) {
    this.#canvas = canvas;
    this.#colours = colours.map(rgb);
    this.#on = on;
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  load(map) {
    const fresh = this.#map?.chosen.length !== map.chosen.length;
    this.#map = map;
    if (fresh) this.whole();
    const known = Array.from(map.stiffness).filter(Number.isFinite);
    this.#range = known.length
      ? known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity])
      : [0, 1];
    this.draw();
  }

  get tags() {
    return this.#map?.chosen.length ?? 0;
  }

  get range() {
    return this.#range;
  }

  // shows all tags
  whole() {
    this.#first = 0;
    this.#count = Math.max(1, this.tags);
    this.draw();
  }

  // shows some tags, a few more at either end
  zoomTo(first, last) {
    const more = Math.ceil(0.1 * (last - first + 1));
    this.#window(first - more, last - first + 1 + 2 * more);
  }

  mark(tag) {
    this.#shown = tag;
    if (tag < this.#first || tag >= this.#first + this.#count) {
      this.#window(Math.round(tag - this.#count / 2), this.#count);
    }
    this.draw();
  }

  // shows a spin that is tried; null: none
  try(trial) {
    this.#trial = trial;
    this.draw();
  }

  // middle of a tag's column and of a spin [px of the window]; for whoever wants to point there
  place(tag, spin) {
    const box = this.#canvas.getBoundingClientRect();
    return [box.left + this.#x(tag + 0.5), box.top + this.#y(spin)];
  }

  draw() {
    const canvas = this.#canvas;
    const width = Math.max(200, canvas.clientWidth);
    const height = canvas.clientHeight || 300;
    canvas.width = width;
    canvas.height = height;
    const pen = canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    if (!this.#map || !this.tags) return;
    this.#cells(pen);
    this.#lines(pen);
    this.#scales(pen, height);
  }

  // ---- places -------------------------------------------------------------------------------

  #window(first, count) {
    this.#count = Math.max(Math.min(8, this.tags), Math.min(this.tags, Math.round(count)));
    this.#first = Math.max(0, Math.min(this.tags - this.#count, Math.round(first)));
    this.draw();
  }

  get #wide() {
    return this.#canvas.width - LEFT;
  }

  get #high() {
    return this.#canvas.height - BELOW;
  }

  get #step() {
    const { spins } = this.#map;
    return spins.length > 1 ? spins[1] - spins[0] : 10;
  }

  #x(tag) {
    return LEFT + ((tag - this.#first) / this.#count) * this.#wide;
  }

  #y(spin) {
    const { spins } = this.#map;
    const share = (spin - spins[0] + this.#step / 2) / (this.#step * spins.length);
    return this.#high * (1 - share);
  }

  #tagAt(x) {
    const tag = this.#first + Math.floor(((x - LEFT) / this.#wide) * this.#count);
    return Math.max(0, Math.min(this.tags - 1, tag));
  }

  #spinAt(y, fine) {
    const { spins } = this.#map;
    const spin = spins[0] - this.#step / 2 + (1 - y / this.#high) * this.#step * spins.length;
    const last = spins.at(-1);
    return Math.max(spins[0], Math.min(last, fine ? Math.round(spin * 10) / 10 : Math.round(spin)));
  }

  // ---- drawing ------------------------------------------------------------------------------

  // one pixel a column and spin; a column of several tags shows the hardest of them
  #cells(pen) {
    const { spins, classes, stiffness } = this.#map;
    const rows = spins.length;
    const columns = Math.min(this.#count, Math.max(1, Math.floor(this.#wide)));
    const image = new ImageData(columns, rows);
    const [low, high] = this.#range;
    for (let c = 0; c < columns; c++) {
      const from = this.#first + Math.floor((c * this.#count) / columns);
      const to = this.#first + Math.floor(((c + 1) * this.#count) / columns);
      for (let s = 0; s < rows; s++) {
        let worst = 0;
        let least = Infinity;
        for (let tag = from; tag < Math.max(to, from + 1); tag++) {
          const cell = tag * rows + s;
          worst = Math.max(worst, classes[cell]);
          if (stiffness[cell] < least) least = stiffness[cell];
        }
        const share = (least - low) / (high - low || 1);
        const colour =
          worst === 0 && Number.isFinite(least)
            ? mix(SOFTEST, STIFFEST, share).map((v) => 255 * v)
            : this.#colours[worst];
        image.data.set([...colour, 255], 4 * ((rows - 1 - s) * columns + c));
      }
    }
    const small = new OffscreenCanvas(columns, rows);
    small.getContext("2d").putImageData(image, 0, 0);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(small, LEFT, 0, this.#wide, this.#high);
  }

  #lines(pen) {
    const { chosen, pins } = this.#map;
    for (const [style, width] of [
      ["#fff", 4],
      [INK, 1.6],
    ]) {
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.beginPath();
      let before = NaN;
      for (let tag = this.#first; tag < this.#first + this.#count; tag++) {
        const y = this.#y(chosen[tag]);
        if (Number.isFinite(y)) {
          if (Math.abs(y - before) < this.#high / 2) pen.lineTo(this.#x(tag), y);
          else pen.moveTo(this.#x(tag), y);
          pen.lineTo(this.#x(tag + 1), y);
        }
        before = y;
      }
      pen.stroke();
    }
    if (this.#shown >= 0) {
      pen.fillStyle = "rgba(27,39,51,0.18)";
      pen.fillRect(this.#x(this.#shown) - 1, 0, this.#wide / this.#count + 2, this.#high);
    }
    pins.forEach((spin, tag) => this.#square(pen, tag, spin, PIN));
    if (this.#trial) this.#square(pen, this.#trial.tag, this.#trial.spin, "#e91e63");
  }

  #square(pen, tag, spin, colour) {
    if (tag < this.#first || tag >= this.#first + this.#count) return;
    const size = Math.max(8, Math.min(14, this.#wide / this.#count));
    pen.fillStyle = colour;
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.rect(this.#x(tag + 0.5) - size / 2, this.#y(spin) - size / 2, size, size);
    pen.fill();
    pen.stroke();
  }

  #scales(pen, height) {
    const { spins, names } = this.#map;
    pen.fillStyle = getComputedStyle(this.#canvas).color;
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    const every = [5, 10, 15, 30, 45, 90].find((s) => (spins.at(-1) - spins[0]) / s <= 9) ?? 90;
    for (let v = Math.ceil(spins[0] / every) * every; v <= spins.at(-1); v += every) {
      pen.fillText(`${v}`, LEFT - 6, Math.max(6, this.#y(v)));
    }
    pen.textAlign = "left";
    const shown = Math.max(1, Math.ceil((this.#count * 70) / this.#wide));
    for (let tag = this.#first; tag < this.#first + this.#count; tag += shown) {
      pen.fillText(names[tag].slice(0, 10), this.#x(tag), height - BELOW / 2);
    }
  }

  // ---- pointer and keys ---------------------------------------------------------------------

  #listen() {
    const canvas = this.#canvas;
    let start = null;
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.tags || event.button) return;
      canvas.focus({ preventScroll: true });
      canvas.setPointerCapture(event.pointerId);
      start = { y: event.offsetY, tag: this.#tagAt(event.offsetX), moved: false };
      this.#on.select(start.tag);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!start) return;
      if (!start.moved && Math.abs(event.offsetY - start.y) < PULL) return;
      start.moved = true;
      this.#to(start.tag, this.#spinAt(event.offsetY, event.shiftKey));
    });
    canvas.addEventListener("pointerup", () => {
      const moved = start?.moved;
      start = null;
      if (moved && this.#trial) this.#on.drop(this.#trial.tag, this.#trial.spin);
    });
    canvas.addEventListener("pointercancel", () => {
      start = null;
      this.#cancel();
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (!this.tags) return;
        const count = this.#count * (event.deltaY > 0 ? 1.25 : 0.8);
        if (event.deltaY > 0 && this.#count >= this.tags) return;
        event.preventDefault();
        const share = (event.offsetX - LEFT) / this.#wide;
        this.#window(this.#first + share * (this.#count - count), count);
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #to(tag, spin) {
    this.try({ tag, spin });
    this.#on.drag(tag, spin);
  }

  #cancel() {
    const tag = this.#trial?.tag;
    this.try(null);
    if (tag !== undefined) this.#on.cancel(tag);
  }

  #key(event) {
    const tag = this.#shown;
    if (!this.tags || tag < 0 || event.ctrlKey || event.metaKey) return;
    const turn = (by) => {
      const from = this.#trial?.tag === tag ? this.#trial.spin : this.#map.chosen[tag];
      const { spins } = this.#map;
      const to = Math.round((Number.isFinite(from) ? from : 0) + by);
      this.#to(tag, Math.max(spins[0], Math.min(spins.at(-1), to)));
    };
    const actions = {
      ArrowLeft: () => this.#on.select(Math.max(0, tag - 1)),
      ArrowRight: () => this.#on.select(Math.min(this.tags - 1, tag + 1)),
      ArrowUp: () => turn(event.shiftKey ? 10 : 1),
      ArrowDown: () => turn(event.shiftKey ? -10 : -1),
      Enter: () => this.#trial && this.#on.drop(this.#trial.tag, this.#trial.spin),
      Escape: () => this.#cancel(),
      Delete: () => this.#on.unpin(tag),
      0: () => this.whole(),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }
}
