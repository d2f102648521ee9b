// Shared by all pages: packed data, colours, line charts, sortable tables.
"use strict";
const PP = (() => {
  const types = { float32: Float32Array, int32: Int32Array, uint16: Uint16Array, uint8: Uint8Array };
  function bytesOf(text) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return bytes;
  }
  function unpack(p) {
    const values = new types[p.type](bytesOf(p.data).buffer);
    values.shape = p.shape;
    return values;
  }
  async function text(p) {  // {"type": "gzip", "data"}: text that was packed for size
    const stream = new Blob([bytesOf(p.data)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  }
  const holder = document.getElementById("data");
  const data = holder ? JSON.parse(holder.textContent) : {};
  const colours = ["#0b6bcb", "#c62828", "#2e7d32", "#b26a00", "#6a1b9a", "#00838f"];
  const stops = [[44, 76, 164], [38, 150, 140], [235, 200, 60], [200, 40, 40]];
  function ramp(t) {  // blue, green, yellow, red
    const x = Math.max(0, Math.min(1, t)) * 3, i = Math.min(2, Math.floor(x)), f = x - i;
    return stops[i].map((a, k) => (a + f * (stops[i + 1][k] - a)) / 255);
  }
  const css = c => `rgb(${c.map(v => Math.round(v * 255)).join(",")})`;
  function extent(arrays) {
    let low = Infinity, high = -Infinity;
    for (const a of arrays) for (let i = 0; i < a.length; i++) { const v = a[i]; if (v < low && v > -Infinity) low = v; if (v > high && v < Infinity) high = v; }
    return [low, high];
  }
  function node(name, attributes, parent, content) {
    const e = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const k in attributes) e.setAttribute(k, attributes[k]);
    if (content !== undefined) e.textContent = content;
    if (parent) parent.appendChild(e);
    return e;
  }
  function ticks(low, high, n) {
    const raw = (high - low) / n || 1, p = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map(k => k * p).find(k => k >= raw), out = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) out.push(+v.toPrecision(12));
    return out;
  }
  // Long lines are drawn as the lowest and the highest value of each bucket, so no peak is lost.
  function decimate(x, y, most) {
    const n = x.length;
    if (n <= 2 * most) return null;
    const keep = [], size = n / most;
    for (let b = 0; b < most; b++) {
      const from = Math.floor(b * size), to = Math.min(n, Math.floor((b + 1) * size));
      let low = -1, high = -1, gap = -1;
      for (let i = from; i < to; i++) {
        if (!Number.isFinite(y[i])) { gap = i; continue; }
        if (low < 0 || y[i] < y[low]) low = i;
        if (high < 0 || y[i] > y[high]) high = i;
      }
      if (low < 0) keep.push(gap); else if (low === high) keep.push(low); else keep.push(Math.min(low, high), Math.max(low, high));
    }
    return keep;
  }
  function path(s, X, Y, most) {
    const keep = decimate(s.x, s.y, most), n = keep ? keep.length : s.x.length;
    let d = "", pen = false;
    for (let k = 0; k < n; k++) {
      const i = keep ? keep[k] : k;
      if (!Number.isFinite(s.y[i])) { pen = false; continue; }
      d += `${pen ? "L" : "M"}${X(s.x[i]).toFixed(1)} ${Y(s.y[i]).toFixed(1)}`; pen = true;
    }
    return d;
  }
  // series: [{name, x, y, colour, dash}], marks: [{x, colour, text}], levels: [{y, colour}]
  function lineChart(host, { series, xLabel, yLabel, marks = [], levels = [], height = 220, onPick }) {
    host.textContent = "";
    const w = Math.max(300, host.clientWidth || 600), h = height, m = { l: 58, r: 12, t: 22, b: 34 };
    let [x0, x1] = extent(series.map(s => s.x)), [y0, y1] = extent([...series.map(s => s.y), levels.map(l => l.y)]);
    if (x0 > x1 || y0 > y1) { host.textContent = "nothing to show"; return null; }
    if (x0 === x1) { x0 -= 1; x1 += 1; } if (y0 === y1) { y0 -= 1; y1 += 1; }
    const pad = 0.04 * (y1 - y0); y0 -= pad; y1 += pad;
    const X = v => m.l + (v - x0) / (x1 - x0) * (w - m.l - m.r), Y = v => h - m.b - (v - y0) / (y1 - y0) * (h - m.t - m.b);
    const svg = node("svg", { viewBox: `0 0 ${w} ${h}`, width: "100%", class: "chart" }, host);
    for (const v of ticks(y0, y1, 5)) {
      node("line", { x1: m.l, x2: w - m.r, y1: Y(v), y2: Y(v), stroke: "#e3e8ec" }, svg);
      node("text", { x: m.l - 6, y: Y(v) + 4, "text-anchor": "end" }, svg, v.toLocaleString("en"));
    }
    for (const v of ticks(x0, x1, 8)) node("text", { x: X(v), y: h - m.b + 14, "text-anchor": "middle" }, svg, v.toLocaleString("en"));
    node("text", { x: w - m.r, y: h - 4, "text-anchor": "end" }, svg, xLabel || "");
    node("text", { x: 4, y: 12 }, svg, yLabel || "");
    for (const l of levels) node("line", { x1: m.l, x2: w - m.r, y1: Y(l.y), y2: Y(l.y), stroke: l.colour || "#c62828", "stroke-dasharray": "4 3" }, svg);
    let at = m.l + 34 + 6 * (yLabel || "").length;
    series.forEach((s, k) => {
      node("path", { d: path(s, X, Y, w - m.l - m.r), fill: "none", stroke: s.colour || colours[k % 6], "stroke-width": 1.4, "stroke-dasharray": s.dash || "" }, svg);
      if (s.dots) for (let i = 0; i < s.x.length; i++) if (Number.isFinite(s.y[i])) node("circle", { cx: X(s.x[i]).toFixed(1), cy: Y(s.y[i]).toFixed(1), r: 2.2, fill: s.colour }, svg);
      node("text", { x: at, y: 12, style: `fill:${s.colour || colours[k % 6]}` }, svg, s.name || "");
      at += 18 + 6.5 * (s.name || "").length;
    });
    for (const k of marks) {
      node("line", { x1: X(k.x), x2: X(k.x), y1: m.t, y2: h - m.b, stroke: k.colour || "#1b2733", "stroke-dasharray": "2 2", class: "mark" }, svg);
      if (k.text) node("text", { x: X(k.x) + (X(k.x) > w - 110 ? -4 : 4), y: m.t + 10, "text-anchor": X(k.x) > w - 110 ? "end" : "start", style: `fill:${k.colour || "#1b2733"}` }, svg, k.text);
      if (Number.isFinite(k.y)) node("circle", { cx: X(k.x), cy: Y(k.y), r: 4, fill: k.colour || "#1b2733" }, svg);
    }
    const cursor = node("line", { y1: m.t, y2: h - m.b, stroke: "#1b2733", "stroke-width": 1, visibility: "hidden" }, svg);
    if (onPick) svg.addEventListener("click", e => {
      const box = svg.getBoundingClientRect();
      onPick(x0 + ((e.clientX - box.left) / box.width * w - m.l) / (w - m.l - m.r) * (x1 - x0));
    });
    return { move(x) { const p = X(x).toFixed(1); cursor.setAttribute("x1", p); cursor.setAttribute("x2", p); cursor.setAttribute("visibility", "visible"); } };
  }
  // A click on a head cell of a plain table sorts it; numbers by value, the rest as text.
  function sortable(table) {
    const number = s => { const v = parseFloat(s.replace(/[\s,]/g, "").replace("−", "-")); return /^[-+−.\d]/.test(s) && Number.isFinite(v) ? v : null; };
    Array.from(table.tHead.rows[0].cells).forEach((th, k) => {
      let up = false; th.classList.add("sortable"); th.tabIndex = 0;
      const sort = () => {
        up = !up;
        const body = table.tBodies[0], rows = Array.from(body.rows).map((r, i) => [r, (r.cells[k] || {}).textContent || "", i]);
        const numeric = rows.every(r => r[1] === "" || r[1] === "-" || number(r[1]) !== null);
        rows.sort((a, b) => {
          const x = numeric ? number(a[1]) : a[1], y = numeric ? number(b[1]) : b[1];
          if (x === y) return a[2] - b[2];
          if (x === null) return 1;
          if (y === null) return -1;
          return (x < y ? -1 : 1) * (up ? 1 : -1);
        });
        for (const r of rows) body.appendChild(r[0]);
      };
      th.addEventListener("click", sort);
      th.addEventListener("keydown", e => { if (e.key === "Enter") sort(); });
    });
  }
  document.querySelectorAll("table.data").forEach(t => { if (t.tHead && t.tBodies.length) sortable(t); });
  return { data, unpack, text, ramp, css, extent, lineChart, decimate, colours, node };
})();
