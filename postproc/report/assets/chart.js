// Charts as SVG that answer: lines or bars, levels, marks, a cursor; zoom, values, export.
import { LINE_COLOURS } from "./colours.js";
import { element, svgElement } from "./dom.js";
import { extent, spell } from "./numbers.js";

const MARGIN = { left: 58, right: 12, top: 22, bottom: 34 };
const INK = "currentColor";
const LEVEL = "#c62828";
const END = { "text-anchor": "end" };
const CLICK = 4; // px that the pointer may move between press and release
const [NEARER, FARTHER] = [0.7, 1.3];
const STEP = 0.2; // share of the range by which an arrow shifts it

// round values between low and high, about n of them
export function ticks(low, high, n) {
  const raw = (high - low) / n || 1;
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= raw);
  const found = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) {
    found.push(+v.toPrecision(12));
  }
  return found;
}

// Indices of a long line that are drawn: the lowest and the highest value of each bucket, so no peak
// is lost. A bucket without a value keeps a gap; null: the line is short, all are drawn.
export function decimate(y, buckets) {
  if (y.length <= 2 * buckets) return null;
  const size = y.length / buckets;
  const kept = [];
  for (let b = 0; b < buckets; b++) {
    const end = Math.min(y.length, Math.floor((b + 1) * size));
    kept.push(...extremes(y, Math.floor(b * size), end));
  }
  return kept;
}

function extremes(y, start, end) {
  let low = -1;
  let high = -1;
  for (let i = start; i < end; i++) {
    if (!Number.isFinite(y[i])) continue;
    if (low < 0 || y[i] < y[low]) low = i;
    if (high < 0 || y[i] > y[high]) high = i;
  }
  if (low < 0) return [end - 1];
  if (low === high) return [low];
  return [Math.min(low, high), Math.max(low, high)];
}

// the path of a line; values that are missing break it
export function linePath({ x, y }, { toX, toY }, buckets) {
  const kept = decimate(y, buckets) ?? Array.from(y, (_, i) => i);
  let path = "";
  let drawing = false;
  for (const i of kept) {
    const here = Number.isFinite(y[i]);
    if (here) path += `${drawing ? "L" : "M"}${toX(x[i]).toFixed(1)} ${toY(y[i]).toFixed(1)}`;
    drawing = here;
  }
  return path;
}

function widened(low, high) {
  return low === high ? [low - 1, high + 1] : [low, high];
}

// The axes of a chart: ranges of values, and ways between values and pixels; null without values.
// log: the y axis is logarithmic, its range that of the powers of ten.
export function chartAxes(series, levels, width, height, log = false) {
  const scaled = log ? (v) => (v > 0 ? Math.log10(v) : NaN) : (v) => v;
  const ys = series.flatMap(({ y, low = [], high = [] }) => [y, low, high]);
  const xRange = extent(series.map((s) => s.x));
  const yRange = extent([...ys, levels.map((l) => l.y)].map((v) => Array.from(v ?? [], scaled)));
  if (xRange[0] > xRange[1] || yRange[0] > yRange[1]) return null;
  const [x0, x1] = widened(...xRange);
  const [bottom, top] = widened(...yRange);
  const pad = 0.04 * (top - bottom);
  const [y0, y1] = [bottom - pad, top + pad];
  const across = width - MARGIN.left - MARGIN.right;
  const up = height - MARGIN.top - MARGIN.bottom;
  return {
    ...{ width, height, across, log, x: [x0, x1], y: [y0, y1] },
    toX: (v) => MARGIN.left + ((v - x0) / (x1 - x0)) * across,
    toY: (v) => height - MARGIN.bottom - ((scaled(v) - y0) / (y1 - y0)) * up,
    fromX: (pixel) => x0 + ((pixel - MARGIN.left) / across) * (x1 - x0),
  };
}

function addLevel(svg, { width, toY }, y, style) {
  const ends = { x1: MARGIN.left, x2: width - MARGIN.right, y1: toY(y), y2: toY(y) };
  svgElement("line", { ...ends, ...style }, svg);
}

function addText(svg, x, y, style, text) {
  svgElement("text", { x, y, ...style }, svg, text);
}

// round values of the y axis; of a logarithmic one over a decade 1, 2, 5 and their tens
function levelsOf({ y, log }) {
  if (!log) return ticks(...y, 5);
  const [low, high] = y.map((v) => 10 ** v);
  if (high < 10 * low) return ticks(low, high, 4);
  const powers = Array.from({ length: Math.ceil(y[1]) - Math.floor(y[0]) + 1 }, (_, k) => k);
  const all = powers.flatMap((k) => [1, 2, 5].map((m) => m * 10 ** (Math.floor(y[0]) + k)));
  return all.filter((v) => v >= low && v <= high);
}

function addGrid(svg, axes, xLabel, yLabel, names) {
  const { width, height, toX, toY } = axes;
  for (const v of levelsOf(axes)) {
    addLevel(svg, axes, v, { stroke: "currentColor", "stroke-opacity": 0.12 });
    addText(svg, MARGIN.left - 6, toY(v) + 4, END, v.toLocaleString("en"));
  }
  const below = height - MARGIN.bottom + 14;
  const at = names
    ? names.map((name, k) => [k + 0.5, name])
    : ticks(...axes.x, 8).map((v) => [v, v.toLocaleString("en")]);
  for (const [v, text] of at) addText(svg, toX(v), below, { "text-anchor": "middle" }, text);
  addText(svg, width - MARGIN.right, height - 4, END, xLabel);
  addText(svg, 4, 12, {}, yLabel);
}

function addLine(svg, axes, line, colour) {
  const style = { fill: "none", stroke: colour, "stroke-width": 1.4 };
  const d = linePath(line, axes, axes.across);
  svgElement("path", { d, ...style, "stroke-dasharray": line.dash ?? "" }, svg);
  addWhiskers(svg, axes, line, colour);
  if (!line.dots) return;
  for (let i = 0; i < line.x.length; i++) {
    if (!Number.isFinite(line.y[i])) continue;
    const at = { cx: axes.toX(line.x[i]).toFixed(1), cy: axes.toY(line.y[i]).toFixed(1) };
    svgElement("circle", { ...at, r: 2.2, fill: colour }, svg);
  }
}

// from low to high of each value, where a line has them
function addWhiskers(svg, { toX, toY }, { x, low, high }, stroke) {
  if (!low) return;
  const ends = Array.from(x, (v, i) => [toX(v), toY(low[i]), toY(high[i])]);
  const known = ends.filter((end) => end.every(Number.isFinite));
  const d = known.map(([at, from, to]) => `M${at} ${from}L${at} ${to}`).join("");
  svgElement("path", { d, fill: "none", stroke, "stroke-opacity": 0.45 }, svg);
}

// the k-th of n bars of every group
function addBars(svg, { toX, toY }, { name, y }, fill, k, n, names) {
  y.forEach((value, i) => {
    if (!Number.isFinite(value)) return;
    const [left, right] = [k, k + 1].map((j) => toX(i + 0.1 + (0.8 * j) / n));
    const [top, low] = [toY(Math.max(value, 0)), toY(Math.min(value, 0))];
    const box = { x: left, y: top, width: right - left - 1, height: low - top, fill };
    const bar = svgElement("rect", box, svg);
    svgElement("title", {}, bar, `${name} ${names[i]}: ${spell(value)}`);
  });
}

// lines or bars, and their names side by side above the chart
function addLines(svg, axes, series, start, names) {
  let at = start;
  series.forEach((line, k) => {
    const colour = line.colour ?? LINE_COLOURS[k % LINE_COLOURS.length];
    const name = line.name ?? "";
    if (names) addBars(svg, axes, line, colour, k, series.length, names);
    else addLine(svg, axes, line, colour);
    addText(svg, at, 12, { style: `fill:${colour}` }, name);
    at += 18 + 6.5 * name.length;
  });
}

function addMark(svg, { width, height, toX, toY }, { x, y, text, colour = INK }) {
  const at = toX(x);
  const ends = { x1: at, x2: at, y1: MARGIN.top, y2: height - MARGIN.bottom };
  const dashes = { "stroke-dasharray": "2 2", class: "mark" };
  svgElement("line", { ...ends, stroke: colour, ...dashes }, svg);
  if (text) {
    const left = at > width - 110;
    const style = { "text-anchor": left ? "end" : "start", style: `fill:${colour}` };
    addText(svg, at + (left ? -4 : 4), MARGIN.top + 10, style, text);
  }
  if (Number.isFinite(y)) svgElement("circle", { cx: at, cy: toY(y), r: 4, fill: colour }, svg);
}

function addCursor(svg, { height, toX }) {
  const ends = { y1: MARGIN.top, y2: height - MARGIN.bottom };
  const style = { stroke: INK, "stroke-width": 1, visibility: "hidden" };
  const line = svgElement("line", { ...ends, ...style }, svg);
  return (x) => {
    if (x === null) return line.setAttribute("visibility", "hidden");
    const at = toX(x).toFixed(1);
    line.setAttribute("x1", at);
    line.setAttribute("x2", at);
    line.setAttribute("visibility", "visible");
  };
}

// where the pointer is in the values of the x axis
function valueAt(svg, { width, fromX }, { clientX }) {
  const box = svg.getBoundingClientRect();
  return fromX(((clientX - box.left) / box.width) * width);
}

// the index of the value nearest to x in rising values
export function nearestIndex(values, x) {
  let best = 0;
  for (let i = 1; i < values.length; i++) {
    if (Math.abs(values[i] - x) < Math.abs(values[best] - x)) best = i;
  }
  return best;
}

// lines within a range of x, one value more at either end
export function within(series, [low, high]) {
  return series.map((line) => {
    const kept = Array.from(line.x, (_, i) => i).filter(
      (i) => (line.x[i + 1] ?? line.x[i]) >= low && (line.x[i - 1] ?? line.x[i]) <= high,
    );
    const of = (values) => values && kept.map((i) => values[i]);
    return { ...line, x: of(line.x), y: of(line.y), low: of(line.low), high: of(line.high) };
  });
}

// the values of lines, or of bars with names, as CSV, one row per value
export function csvOf(series, xLabel, names) {
  const rows = series.flatMap(({ name, x, y }) =>
    Array.from(names ?? x, (v, i) => `"${name ?? ""}",${v},${Number.isFinite(y[i]) ? y[i] : ""}`),
  );
  return ["line," + JSON.stringify(xLabel) + ",value", ...rows].join("\n") + "\n";
}

// links that save the values, and the picture
function addExport(host, svg, { series, xLabel, names }) {
  const kinds = {
    CSV: ["text/csv", () => csvOf(series, xLabel, names)],
    SVG: ["image/svg+xml", () => new XMLSerializer().serializeToString(svg)],
  };
  for (const [name, [type, content]] of Object.entries(kinds)) {
    const save = element("a", { textContent: name, className: "export", href: "#" });
    save.download = `${host.id || "chart"}.${name.toLowerCase()}`;
    save.addEventListener("click", () => {
      save.href = URL.createObjectURL(new Blob([content()], { type }));
    });
    host.append(save, " ");
  }
}

// says the values under the pointer
function addHover(svg, axes, series) {
  const tip = svgElement("text", { y: MARGIN.top + 12, class: "tip" }, svg, "");
  const line = addCursor(svg, axes);
  const hide = () => {
    tip.textContent = "";
    line(null);
  };
  svg.addEventListener("pointerleave", hide);
  svg.addEventListener("pointermove", (event) => {
    const x = valueAt(svg, axes, event);
    if (x < axes.x[0] || x > axes.x[1]) return hide();
    const seen = series
      .filter(({ name }) => name)
      .map(({ name, x: at, y }) => [name, y[nearestIndex(at, x)]])
      .filter(([, value]) => Number.isFinite(value));
    tip.textContent = [spell(x), ...seen.map(([name, v]) => `${name ?? ""} ${spell(v)}`)].join(
      "  ",
    );
    const left = axes.toX(x) > axes.width / 2;
    tip.setAttribute("x", axes.toX(x) + (left ? -6 : 6));
    tip.setAttribute("text-anchor", left ? "end" : "start");
    line(x);
  });
}

// A range is shown by a drag across it, by + and - and the arrows, by the wheel with Ctrl or where
// the chart has the focus; a double click and 0 show all.
function addZoom(svg, axes, whole, redraw, onPick) {
  const shown = ([low, high]) => {
    const ends = [Math.max(whole[0], low), Math.min(whole[1], high)];
    if (ends[0] < ends[1]) redraw(ends, document.activeElement === svg);
  };
  const about = (x, by) => shown(axes.x.map((end) => x + by * (end - x)));
  const middle = (axes.x[0] + axes.x[1]) / 2;
  const shift = (by) => shown(axes.x.map((end) => end + by * (axes.x[1] - axes.x[0])));
  const keys = {
    "+": () => about(middle, NEARER),
    "-": () => about(middle, FARTHER),
    ArrowLeft: () => shift(-STEP),
    ArrowRight: () => shift(STEP),
    0: () => redraw(null, true),
  };
  svg.tabIndex = 0;
  svg.addEventListener("keydown", (event) => {
    const action = keys[event.key === "=" ? "+" : event.key];
    if (!action || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    action();
  });
  const wheel = (event) => {
    if (!event.ctrlKey && !event.shiftKey && document.activeElement !== svg) return;
    event.preventDefault();
    const away = (event.deltaY || event.deltaX) > 0;
    about(valueAt(svg, axes, event), away ? FARTHER : NEARER);
  };
  svg.addEventListener("wheel", wheel, { passive: false });
  svg.addEventListener("dblclick", () => redraw(null));
  addDrag(svg, axes, shown, onPick);
}

// a drag chooses a range, a press without one a value
function addDrag(svg, axes, shown, onPick) {
  let from = null;
  const box = svgElement("rect", { y: MARGIN.top, fill: INK, "fill-opacity": 0.1 }, svg);
  svg.addEventListener("pointerdown", (event) => {
    from = valueAt(svg, axes, event);
  });
  svg.addEventListener("pointermove", (event) => {
    if (from === null) return;
    const ends = [axes.toX(from), axes.toX(valueAt(svg, axes, event))];
    box.setAttribute("x", Math.min(...ends));
    box.setAttribute("width", Math.abs(ends[1] - ends[0]));
    box.setAttribute("height", axes.height - MARGIN.top - MARGIN.bottom);
  });
  svg.addEventListener("pointerleave", () => {
    from = null;
    box.setAttribute("width", 0);
  });
  svg.addEventListener("pointerup", (event) => {
    const ends = [from ?? 0, valueAt(svg, axes, event)].sort((a, b) => a - b);
    const dragged = Math.abs(axes.toX(ends[1]) - axes.toX(ends[0])) > CLICK;
    if (from !== null && dragged) shown(ends);
    else if (from !== null) onPick?.(ends[1]);
    from = null;
  });
}

// Draws a chart into an element and returns {move(x)} for its cursor; null without values.
// series: [{name, x, y, low, high, colour, dash, dots}], marks: [{x, y, colour, text}],
// levels: [{y, text}]; log: a logarithmic y axis; names: of groups of bars, which have no x
export function lineChart(host, { names, ...given }) {
  const series = given.series.map((line) => (names ? { ...line, x: [0, names.length] } : line));
  const chart = { ...given, names, series };
  let cursor = null;
  let at = null;
  const redraw = (range, focus = false) => {
    cursor = drawChart(host, chart, range, redraw);
    if (at !== null) cursor?.(at);
    if (focus) host.querySelector("svg")?.focus();
  };
  redraw(null);
  const move = (x) => {
    at = x;
    cursor?.(x);
  };
  return cursor ? { move } : null;
}

// draws the charts that the page's text holds as data
export function drawCharts() {
  for (const host of document.querySelectorAll("[data-chart]")) {
    lineChart(host, JSON.parse(host.dataset.chart));
  }
}

// what does not change under the pointer: grid, levels, lines, marks
function addContent(svg, axes, series, { xLabel, yLabel, names, marks = [], levels = [] }) {
  addGrid(svg, axes, xLabel, yLabel, names);
  for (const { y, text } of levels) {
    addLevel(svg, axes, y, { stroke: LEVEL, "stroke-dasharray": "4 3" });
    if (text) addText(svg, axes.width - MARGIN.right, axes.toY(y) - 4, END, text);
  }
  addLines(svg, axes, series, MARGIN.left + 34 + 6 * yLabel.length, names);
  for (const mark of marks) {
    if (mark.x >= axes.x[0] && mark.x <= axes.x[1]) addMark(svg, axes, mark);
  }
}

function drawChart(host, chart, range, redraw) {
  const { names, log, height = 220, onPick } = chart;
  const levels = names ? [...(chart.levels ?? []), { y: 0 }] : (chart.levels ?? []);
  const series = range ? within(chart.series, range) : chart.series;
  host.textContent = "";
  const axes = chartAxes(series, levels, Math.max(300, host.clientWidth || 600), height, log);
  if (!axes) {
    host.textContent = "nothing to show";
    return null;
  }
  const size = { viewBox: `0 0 ${axes.width} ${height}`, width: "100%" };
  const svg = svgElement("svg", { ...size, class: "chart" }, host);
  addContent(svg, axes, series, chart);
  addExport(host, svg, chart);
  if (names) return null;
  const words = "point to read; drag, Ctrl and wheel, or + and - zoom; double click or 0 for all";
  svgElement("title", {}, svg, words);
  const cursor = addCursor(svg, axes);
  addHover(svg, axes, series);
  addZoom(svg, axes, extent(chart.series.map((s) => s.x)), redraw, onPick);
  return cursor;
}
