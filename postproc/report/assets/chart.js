// Line charts as SVG: axes, lines, levels, marks, a cursor.
import { LINE_COLOURS } from "./colours.js";
import { element, svgElement } from "./dom.js";
import { extent, spell } from "./numbers.js";

const MARGIN = { left: 58, right: 12, top: 22, bottom: 34 };
const INK = "currentColor";
const LEVEL = "#c62828";

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
export function chartAxes(series, levels, width, height) {
  const xRange = extent(series.map((s) => s.x));
  const yRange = extent([...series.map((s) => s.y), levels.map((l) => l.y)]);
  if (xRange[0] > xRange[1] || yRange[0] > yRange[1]) return null;
  const [x0, x1] = widened(...xRange);
  const [bottom, top] = widened(...yRange);
  const pad = 0.04 * (top - bottom);
  const [y0, y1] = [bottom - pad, top + pad];
  const across = width - MARGIN.left - MARGIN.right;
  const up = height - MARGIN.top - MARGIN.bottom;
  return {
    ...{ width, height, across, x: [x0, x1], y: [y0, y1] },
    toX: (v) => MARGIN.left + ((v - x0) / (x1 - x0)) * across,
    toY: (v) => height - MARGIN.bottom - ((v - y0) / (y1 - y0)) * up,
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

function addGrid(svg, axes, xLabel, yLabel) {
  const { width, height, toX, toY } = axes;
  const end = { "text-anchor": "end" };
  for (const v of ticks(...axes.y, 5)) {
    addLevel(svg, axes, v, { stroke: "currentColor", "stroke-opacity": 0.12 });
    addText(svg, MARGIN.left - 6, toY(v) + 4, end, v.toLocaleString("en"));
  }
  const below = height - MARGIN.bottom + 14;
  for (const v of ticks(...axes.x, 8)) {
    addText(svg, toX(v), below, { "text-anchor": "middle" }, v.toLocaleString("en"));
  }
  addText(svg, width - MARGIN.right, height - 4, end, xLabel);
  addText(svg, 4, 12, {}, yLabel);
}

function addLine(svg, axes, line, colour) {
  const style = { fill: "none", stroke: colour, "stroke-width": 1.4 };
  const d = linePath(line, axes, axes.across);
  svgElement("path", { d, ...style, "stroke-dasharray": line.dash ?? "" }, svg);
  if (!line.dots) return;
  for (let i = 0; i < line.x.length; i++) {
    if (!Number.isFinite(line.y[i])) continue;
    const at = { cx: axes.toX(line.x[i]).toFixed(1), cy: axes.toY(line.y[i]).toFixed(1) };
    svgElement("circle", { ...at, r: 2.2, fill: colour }, svg);
  }
}

// lines, and their names side by side above the chart
function addLines(svg, axes, series, start) {
  let at = start;
  series.forEach((line, k) => {
    const colour = line.colour ?? LINE_COLOURS[k % LINE_COLOURS.length];
    const name = line.name ?? "";
    addLine(svg, axes, line, colour);
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
    return { ...line, x: kept.map((i) => line.x[i]), y: kept.map((i) => line.y[i]) };
  });
}

// the values of lines as CSV, one row per value
export function csvOf(series, xLabel) {
  const rows = series.flatMap(({ name, x, y }) =>
    Array.from(x, (v, i) => `"${name ?? ""}",${v},${Number.isFinite(y[i]) ? y[i] : ""}`),
  );
  return ["line," + JSON.stringify(xLabel) + ",value", ...rows].join("\n") + "\n";
}

function addExport(host, { series, xLabel }) {
  const save = element("a", { textContent: "CSV", className: "export", href: "#" });
  save.download = `${host.id || "chart"}.csv`;
  save.addEventListener("click", () => {
    save.href = URL.createObjectURL(new Blob([csvOf(series, xLabel)], { type: "text/csv" }));
  });
  host.append(save);
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

// the wheel zooms about the pointer, a double click shows all
function addZoom(svg, axes, whole, redraw) {
  svg.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      const x = valueAt(svg, axes, event);
      const by = (event.deltaY || event.deltaX) > 0 ? 1.3 : 0.7;
      const [low, high] = axes.x.map((end) => x + by * (end - x));
      redraw([Math.max(whole[0], low), Math.min(whole[1], high)]);
    },
    { passive: false },
  );
  svg.addEventListener("dblclick", () => redraw(null));
}

// Draws lines into an element and returns {move(x)} for its cursor; null without values.
// series: [{name, x, y, colour, dash, dots}], marks: [{x, y, colour, text}], levels: [{y}]
export function lineChart(host, chart) {
  let cursor = null;
  let at = null;
  const redraw = (range) => {
    cursor = drawChart(host, chart, range, redraw);
    if (at !== null) cursor?.(at);
  };
  redraw(null);
  const move = (x) => {
    at = x;
    cursor?.(x);
  };
  return cursor ? { move } : null;
}

// what does not change under the pointer: grid, levels, lines, marks
function addContent(svg, axes, series, { xLabel, yLabel, marks = [], levels = [] }) {
  addGrid(svg, axes, xLabel, yLabel);
  for (const { y } of levels) addLevel(svg, axes, y, { stroke: LEVEL, "stroke-dasharray": "4 3" });
  addLines(svg, axes, series, MARGIN.left + 34 + 6 * yLabel.length);
  for (const mark of marks) {
    if (mark.x >= axes.x[0] && mark.x <= axes.x[1]) addMark(svg, axes, mark);
  }
}

function drawChart(host, chart, range, redraw) {
  const { levels = [], height = 220, onPick } = chart;
  const series = range ? within(chart.series, range) : chart.series;
  host.textContent = "";
  const axes = chartAxes(series, levels, Math.max(300, host.clientWidth || 600), height);
  if (!axes) {
    host.textContent = "nothing to show";
    return null;
  }
  const size = { viewBox: `0 0 ${axes.width} ${height}`, width: "100%" };
  const svg = svgElement("svg", { ...size, class: "chart" }, host);
  svgElement("title", {}, svg, "point to read, Ctrl and wheel to zoom, double click for all");
  addContent(svg, axes, series, chart);
  const cursor = addCursor(svg, axes);
  addHover(svg, axes, series);
  addZoom(svg, axes, extent(chart.series.map((s) => s.x)), redraw);
  addExport(host, chart);
  if (onPick) svg.addEventListener("click", (event) => onPick(valueAt(svg, axes, event)));
  return cursor;
}
