// The list of all pages: sorts, filters what fails, keeps only the rows in sight in the document.
"use strict";
function PPSpell(v) {
  if (v === null || v === undefined) return "";
  if (typeof v !== "number" || Number.isInteger(v)) return String(v);
  return String(Math.abs(v) < 1 ? +v.toFixed(4) : +v.toPrecision(4));
}
// a column of numbers as a field of the list
function PPField(column) {
  return [`${column.label} [${column.unit}]`, i => { const v = column.values[i]; return Number.isFinite(v) ? v : null; }];
}
// fields: [[name, i => value]]; failed: i => text; select: i => {}
function PPList({ n, what, fields, failed, select }) {
  const $ = id => document.getElementById(id), table = $("tags"), body = table.tBodies[0], host = $("list"), rowHeight = 24;
  let order = Array.from({ length: n }, (_, i) => i), visible = order, sortBy = -1, ascending = true, everything = false, marked = -1;
  function row(i) {
    const tr = document.createElement("tr"); tr.dataset.tag = i;
    tr.className = (failed(i) ? "failing " : "") + (i === marked ? "selected" : "");
    for (const f of fields) { const td = document.createElement("td"); td.textContent = PPSpell(f[1](i)); if (f[0] === "finding") td.className = "text"; tr.appendChild(td); }
    tr.addEventListener("click", () => select(i));
    return tr;
  }
  function spacer(count) { const tr = document.createElement("tr"), td = document.createElement("td"); td.colSpan = fields.length; td.style.height = count * rowHeight + "px"; td.className = "spacer"; tr.appendChild(td); return tr; }
  function fill() {
    const first = everything ? 0 : Math.max(0, Math.floor(host.scrollTop / rowHeight) - 10);
    const count = everything ? 300 : Math.ceil((host.clientHeight || 420) / rowHeight) + 20, end = Math.min(visible.length, first + count);
    const parts = [];
    if (first) parts.push(spacer(first));
    for (let k = first; k < end; k++) parts.push(row(visible[k]));
    if (end < visible.length && !everything) parts.push(spacer(visible.length - end));
    body.replaceChildren(...parts);
  }
  function filter() {
    visible = $("failing") && $("failing").checked ? order.filter(i => failed(i)) : order;
    $("more").textContent = `${visible.length} of ${n} ${what}s`; fill();
  }
  function reveal(i) {  // within the list only: the page itself must not jump
    const at = visible.indexOf(i) * rowHeight;
    if (at >= 0 && (at < host.scrollTop || at > host.scrollTop + host.clientHeight - 3 * rowHeight)) host.scrollTop = Math.max(0, at - host.clientHeight / 2);
    fill();
  }
  host.addEventListener("scroll", fill);
  window.addEventListener("beforeprint", () => { everything = true; fill(); });
  window.addEventListener("afterprint", () => { everything = false; fill(); });
  fields.forEach(([name, key], k) => {
    const th = document.createElement("th"), [word, unit] = name.split(" ["); th.textContent = word; th.className = "sortable"; th.tabIndex = 0;
    if (unit) { const small = document.createElement("small"); small.textContent = "[" + unit; th.append(document.createElement("br"), small); }
    const sort = () => {
      ascending = sortBy === k ? !ascending : true; sortBy = k;
      const sign = ascending ? 1 : -1;
      order.sort((a, b) => { const x = key(a), y = key(b); return x === y ? a - b : (x === null ? 1 : y === null ? -1 : (x < y ? -1 : 1) * sign); });
      host.scrollTop = 0; filter();
    };
    th.addEventListener("click", sort); th.addEventListener("keydown", e => { if (e.key === "Enter") sort(); });
    table.tHead.rows[0].appendChild(th);
  });
  if ($("failing")) $("failing").addEventListener("change", () => { host.scrollTop = 0; filter(); });
  filter();
  return { reveal, mark(i) { marked = i; for (const tr of body.rows) tr.classList.toggle("selected", +tr.dataset.tag === i); }, visible: () => visible };
}
