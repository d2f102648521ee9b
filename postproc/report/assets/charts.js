// Small SVG line charts and the decoding of packed arrays; shared by all pages.
"use strict";
const PP = (() => {
  const types = { float32: Float32Array, int32: Int32Array, uint8: Uint8Array };
  function unpack(p) {
    const raw = atob(p.data), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    const values = new types[p.type](bytes.buffer);
    values.shape = p.shape;
    return values;
  }
  const data = JSON.parse(document.getElementById("data").textContent);
  const colours = ["#0b6bcb", "#c62828", "#2e7d32", "#b26a00", "#6a1b9a", "#00838f"];
  function ramp(t) {  // blue, green, yellow, red: low to high
    const stops = [[44, 76, 164], [38, 150, 140], [235, 200, 60], [200, 40, 40]];
    const x = Math.max(0, Math.min(1, t)) * 3, i = Math.min(2, Math.floor(x)), f = x - i;
    return stops[i].map((a, k) => (a + f * (stops[i + 1][k] - a)) / 255);
  }
  const css = c => `rgb(${c.map(v => Math.round(v * 255)).join(",")})`;
  function node(name, attributes, parent, text) {
    const e = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const k in attributes) e.setAttribute(k, attributes[k]);
    if (text !== undefined) e.textContent = text;
    if (parent) parent.appendChild(e);
    return e;
  }
  function ticks(low, high, n) {
    const raw = (high - low) / n || 1, p = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map(k => k * p).find(k => k >= raw), out = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) out.push(+v.toPrecision(12));
    return out;
  }
  // series: [{name, x, y, colour, dash}], marks: [{x, colour}], bands: [{y, colour}]
  function lineChart(host, { series, xLabel, yLabel, marks = [], levels = [], height = 220, onPick }) {
    host.textContent = "";
    const w = Math.max(300, host.clientWidth || 600), h = height, m = { l: 58, r: 12, t: 10, b: 34 };
    const finite = a => Array.prototype.filter.call(a, Number.isFinite);
    const xs = series.flatMap(s => finite(s.x)), ys = series.flatMap(s => finite(s.y)).concat(levels.map(l => l.y));
    if (!xs.length || !ys.length) { host.textContent = "nothing to show"; return null; }
    const extent = a => a.reduce((e, v) => [Math.min(e[0], v), Math.max(e[1], v)], [Infinity, -Infinity]);
    let [x0, x1] = extent(xs), [y0, y1] = extent(ys);
    if (x0 === x1) { x0 -= 1; x1 += 1; } if (y0 === y1) { y0 -= 1; y1 += 1; }
    const pad = 0.04 * (y1 - y0); y0 -= pad; y1 += pad;
    const X = v => m.l + (v - x0) / (x1 - x0) * (w - m.l - m.r), Y = v => h - m.b - (v - y0) / (y1 - y0) * (h - m.t - m.b);
    const svg = node("svg", { viewBox: `0 0 ${w} ${h}`, width: "100%", height: h }, host);
    for (const v of ticks(y0, y1, 5)) {
      node("line", { x1: m.l, x2: w - m.r, y1: Y(v), y2: Y(v), stroke: "#e3e8ec" }, svg);
      node("text", { x: m.l - 6, y: Y(v) + 4, "text-anchor": "end" }, svg, v.toLocaleString("en"));
    }
    for (const v of ticks(x0, x1, 8)) node("text", { x: X(v), y: h - m.b + 14, "text-anchor": "middle" }, svg, v.toLocaleString("en"));
    node("text", { x: w - m.r, y: h - 4, "text-anchor": "end" }, svg, xLabel || "");
    node("text", { x: 4, y: m.t + 4, transform: `rotate(-90 10 ${m.t + 4})`, "text-anchor": "end" }, svg, yLabel || "");
    for (const l of levels) node("line", { x1: m.l, x2: w - m.r, y1: Y(l.y), y2: Y(l.y), stroke: l.colour || "#c62828", "stroke-dasharray": "4 3" }, svg);
    series.forEach((s, k) => {
      let d = "", pen = false;
      for (let i = 0; i < s.x.length; i++) {
        if (!Number.isFinite(s.y[i])) { pen = false; continue; }
        d += `${pen ? "L" : "M"}${X(s.x[i]).toFixed(1)} ${Y(s.y[i]).toFixed(1)}`; pen = true;
      }
      node("path", { d, fill: "none", stroke: s.colour || colours[k % 6], "stroke-width": 1.4, "stroke-dasharray": s.dash || "" }, svg);
      node("text", { x: m.l + 8 + 70 * k, y: m.t + 6, style: `fill:${s.colour || colours[k % 6]}` }, svg, s.name || "");
    });
    const cursor = node("line", { y1: m.t, y2: h - m.b, stroke: "#1b2733", "stroke-width": 1, visibility: "hidden" }, svg);
    for (const k of marks) node("line", { x1: X(k.x), x2: X(k.x), y1: m.t, y2: h - m.b, stroke: k.colour || "#1b2733", "stroke-dasharray": "2 2" }, svg);
    if (onPick) svg.addEventListener("click", e => {
      const box = svg.getBoundingClientRect();
      onPick(x0 + ((e.clientX - box.left) / box.width * w - m.l) / (w - m.l - m.r) * (x1 - x0));
    });
    return { move(x) { const p = X(x); cursor.setAttribute("x1", p); cursor.setAttribute("x2", p); cursor.setAttribute("visibility", "visible"); } };
  }
  return { data, unpack, ramp, css, lineChart, colours, node };
})();
