// Colours: of lines in charts, and of values from blue (good) to red (bad).
import { extent } from "./numbers.js";

export const LINE_COLOURS = ["#0b6bcb", "#c62828", "#2e7d32", "#b26a00", "#6a1b9a", "#00838f"];

const STOPS = [
  [44, 76, 164],
  [38, 150, 140],
  [235, 200, 60],
  [200, 40, 40],
];

// blue, green, yellow, red for 0 to 1, as red, green, blue of 0 to 1
export function ramp(t) {
  const x = Math.max(0, Math.min(1, t)) * 3;
  const i = Math.min(2, Math.floor(x));
  return STOPS[i].map((from, k) => (from + (x - i) * (STOPS[i + 1][k] - from)) / 255);
}

export function css(colour) {
  return `rgb(${colour.map((v) => Math.round(v * 255)).join(",")})`;
}

// The colours of a column's values; red is its worse end. A value that is missing has none.
export function valueColours({ values, worse }) {
  const [low, high] = extent([values]);
  const lowIsBad = worse === "low";
  const span = high - low || 1;
  const colourOf = (i) => {
    if (!Number.isFinite(values[i])) return null;
    return ramp((lowIsBad ? high - values[i] : values[i] - low) / span);
  };
  const stops = [0, 1 / 3, 2 / 3, 1].map((t) => css(ramp(lowIsBad ? 1 - t : t)));
  return { low, high, colourOf, gradient: `linear-gradient(90deg,${stops.join(",")})` };
}

// a colour between two, for 0 to 1
export function mix(from, to, t) {
  const x = Math.max(0, Math.min(1, t));
  return from.map((v, k) => v + x * (to[k] - v));
}
