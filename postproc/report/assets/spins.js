// Stiffness over the spin about the tool axis, per tag.
import { lineChart } from "./chart.js";
import { LINE_COLOURS } from "./colours.js";
import { unpack } from "./data.js";
import { byId } from "./dom.js";

const CHOSEN = "#c62828";
const COLLIDING = "#98a4ae";

export class SpinMap {
  #levels;
  #hits;
  #map;

  // map: {spins, low, step, level, hit}; a level of 0 is a gap, a hit is a collision
  constructor(map) {
    this.#map = map;
    this.#levels = unpack(map.level);
    this.#hits = unpack(map.hit);
  }

  // the stiffness of a tag at each spin [N/mm], NaN where it cannot be reached
  curve(tag) {
    const { spins, low, step } = this.#map;
    const levels = this.#levels.subarray(tag * spins.length, (tag + 1) * spins.length);
    return Array.from(levels, (level) => (level ? low + (level - 1) * step : NaN));
  }

  // lines of the chart of a tag: all spins grey under those that are free of collision
  lines(tag, name) {
    const x = this.#map.spins;
    const y = this.curve(tag);
    const free = y.map((v, k) => (this.#hits[tag * x.length + k] ? NaN : v));
    return [
      { name: "collides", x, y, colour: COLLIDING, dash: "3 3" },
      { name: `free, ${name}`, x, y: free, colour: LINE_COLOURS[0], dots: true },
    ];
  }
}

// spin [deg] and stiffness [N/mm] that were chosen are marked; missing: why there is no map
export function showSpins(map, missing, tag, name, spin, stiffness) {
  const host = byId("spin");
  if (!map) {
    host.textContent = missing;
    return;
  }
  const text = `chosen ${spin.toFixed(0)} deg`;
  lineChart(host, {
    series: map.lines(tag, name),
    xLabel: "spin about the tool axis [deg]",
    yLabel: "N/mm",
    marks: Number.isFinite(spin) ? [{ x: spin, y: stiffness, text, colour: CHOSEN }] : [],
    height: 230,
  });
}
