// Slider, clock and play button: the time of the program that is shown.
import { byId } from "./dom.js";

export class Player {
  clock = 0;
  playing = false;
  #total;
  #last = 0;
  #onSeek;

  // total: time of the whole program [s]; onSeek: called with the time that is asked for
  constructor(total, onSeek) {
    this.#total = total;
    this.#onSeek = onSeek;
    const slider = byId("slider");
    slider.addEventListener("input", () => onSeek((total * slider.value) / 1000));
    byId("play").addEventListener("click", () => this.#toggle());
  }

  // shows a time, held within the program; returns it
  show(t) {
    this.clock = Math.max(0, Math.min(this.#total, t));
    byId("slider").value = this.#total ? (1000 * this.clock) / this.#total : 0;
    byId("clock").textContent = `${this.clock.toFixed(1)} s of ${this.#total.toFixed(1)} s`;
    return this.clock;
  }

  disable() {
    for (const id of ["slider", "play"]) byId(id).disabled = true;
  }

  #toggle() {
    this.#set(!this.playing);
    this.#last = performance.now();
    if (this.clock >= this.#total) this.clock = 0;
    if (this.playing) requestAnimationFrame((now) => this.#step(now));
  }

  #set(playing) {
    this.playing = playing;
    byId("play").textContent = playing ? "pause" : "play";
  }

  #step(now) {
    if (!this.playing) return;
    const passed = Math.max(0, now - this.#last) / 1000;
    this.#last = now;
    this.#onSeek(this.clock + passed * +byId("speed").value);
    if (this.clock >= this.#total) this.#set(false);
    else requestAnimationFrame((next) => this.#step(next));
  }
}
