// The list of rows: sorts, filters what fails, keeps only the rows in sight in the document.
import { byId, element, onPress } from "./dom.js";
import { sortedIndices, spell } from "./numbers.js";

const ROW_HEIGHT = 24; // px, as in page.css
const PRINTED_ROWS = 300;

// a column of numbers as a field of the list
export function columnField({ label, unit, values }) {
  return [`${label} [${unit}]`, (i) => (Number.isFinite(values[i]) ? values[i] : null)];
}

// first and end of the rows that stand in the document, ten more than in sight at either end
export function rowsInSight(scrollTop, height, total) {
  const first = Math.max(0, Math.floor(scrollTop / ROW_HEIGHT) - 10);
  return [first, Math.min(total, first + Math.ceil(height / ROW_HEIGHT) + 20)];
}

// where the list is scrolled to so that the k-th row is in sight
export function scrollTo(k, scrollTop, height) {
  const at = k * ROW_HEIGHT;
  const hidden = at < scrollTop || at > scrollTop + height - 3 * ROW_HEIGHT;
  return k >= 0 && hidden ? Math.max(0, at - height / 2) : scrollTop;
}

// fields: [[name, i => value]]; failed: i => text, "" for a row that is good; select: i => {};
// grades: state of each row, where it has one
export class RowList {
  #order;
  #visible;
  #sortedBy = -1;
  #ascending = true;
  #printing = false;
  #marked = -1;
  #options;
  #table = byId("tags");
  #host = byId("list");

  constructor(options) {
    this.#options = options;
    this.#order = Array.from({ length: options.n }, (_, i) => i);
    options.fields.forEach((_, k) => this.#addHead(k));
    this.#host.addEventListener("scroll", () => this.#fill());
    window.onbeforeprint = () => this.#print(true);
    window.onafterprint = () => this.#print(false);
    this.#host.tabIndex = 0;
    this.#host.setAttribute("aria-label", `${options.what}s: up and down select`);
    this.#host.addEventListener("keydown", (event) => this.#key(event));
    byId("failing")?.addEventListener("change", () => this.#filter(0));
    byId("search")?.addEventListener("input", () => this.#filter(0));
    const states = byId("state");
    if (states && !options.grades) states.parentElement.hidden = true;
    states?.addEventListener("change", () => this.#filter(0));
    this.#filter();
  }

  // indices of the rows that pass the filter, in the order shown
  get visible() {
    return this.#visible;
  }

  mark(i) {
    this.#marked = i;
    for (const row of this.#table.tBodies[0].rows) {
      row.classList.toggle("selected", +row.dataset.tag === i);
    }
  }

  // within the list only: the page itself must not jump
  reveal(i) {
    const { scrollTop, clientHeight } = this.#host;
    const to = scrollTo(this.#visible.indexOf(i), scrollTop, clientHeight);
    if (to !== scrollTop) this.#host.scrollTop = to;
    this.#fill();
  }

  // up and down select the row before and after
  #key(event) {
    const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!by || event.target !== this.#host) return;
    event.preventDefault();
    const at = this.#visible.indexOf(this.#marked);
    const to = this.#visible[Math.max(0, Math.min(this.#visible.length - 1, at + by))];
    if (to !== undefined) this.#options.select(to);
  }

  #addHead(k) {
    const [word, unit] = this.#options.fields[k][0].split(" [");
    const head = element("th", { textContent: word, className: "sortable", tabIndex: 0 });
    if (unit) head.append(element("br"), element("small", { textContent: `[${unit}` }));
    onPress(head, () => this.#sort(k));
    this.#table.tHead.rows[0].append(head);
  }

  #sort(k) {
    this.#ascending = this.#sortedBy === k ? !this.#ascending : true;
    this.#sortedBy = k;
    const { n, fields } = this.#options;
    const values = Array.from({ length: n }, (_, i) => fields[k][1](i));
    this.#order = sortedIndices(values, this.#ascending);
    this.#filter(0);
  }

  #filter(scrollTop = this.#host.scrollTop) {
    const { n, what, failed, grades } = this.#options;
    this.#host.scrollTop = scrollTop;
    this.#visible = byId("failing")?.checked ? this.#order.filter(failed) : this.#order;
    const state = byId("state")?.value;
    if (state) this.#visible = this.#visible.filter((i) => grades?.[i] === +state);
    const words = byId("search")?.value.trim().toLowerCase();
    if (words) this.#visible = this.#visible.filter((i) => this.#says(i, words));
    byId("more").textContent = `${this.#visible.length} of ${n} ${what}s`;
    this.#fill();
  }

  // whether the name, the line or the finding of a row holds some words
  #says(i, words) {
    const { fields, failed } = this.#options;
    const texts = [fields[0][1](i), fields[1][1](i), failed(i)];
    return texts.some((text) => `${text ?? ""}`.toLowerCase().includes(words));
  }

  #print(on) {
    this.#printing = on;
    this.#fill();
  }

  #fill() {
    const total = this.#visible.length;
    const { scrollTop, clientHeight } = this.#host;
    const [first, end] = this.#printing
      ? [0, Math.min(total, PRINTED_ROWS)]
      : rowsInSight(scrollTop, clientHeight || 420, total);
    const parts = this.#visible.slice(first, end).map((i) => this.#row(i));
    if (first) parts.unshift(this.#spacer(first));
    if (end < total && !this.#printing) parts.push(this.#spacer(total - end));
    this.#table.tBodies[0].replaceChildren(...parts);
  }

  #row(i) {
    const { fields, failed, select } = this.#options;
    const row = element("tr");
    row.dataset.tag = i;
    row.className = (failed(i) ? "failing " : "") + (i === this.#marked ? "selected" : "");
    for (const [name, value] of fields) {
      const cell = element("td", { textContent: spell(value(i)) });
      if (name === "finding") cell.className = "text";
      row.append(cell);
    }
    row.addEventListener("click", () => select(i));
    return row;
  }

  #spacer(rows) {
    const cell = element("td", { colSpan: this.#options.fields.length, className: "spacer" });
    cell.style.height = `${rows * ROW_HEIGHT}px`;
    return element("tr", {}, cell);
  }
}
