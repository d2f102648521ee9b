// The tree of a job: operations with their tools and tags, each in the colour of its state.
import { element } from "./dom.js";

const MOST = 500; // tags of an operation that stand in the tree; all stand in the list
export const STATES = ["good", "acceptable", "critical", "invalid"];

// runs of tags of one operation with one tool: {operation, tool, first, last}
export function runsOf(operation, tool) {
  const runs = [];
  for (let tag = 0; tag < operation.length; tag++) {
    const last = runs.at(-1);
    if (last && last.operation === operation[tag] && last.tool === tool[tag]) last.last = tag;
    else runs.push({ operation: operation[tag], tool: tool[tag], first: tag, last: tag });
  }
  return runs;
}

function dot(state) {
  return element("i", { className: `state ${STATES[state]}`, title: STATES[state] });
}

// job: {names, operations, operation, tools, tool, grade, pinned(tag)}
export class Tree {
  #host;
  #onTag;
  #onRun;
  #rows = new Map();
  #shown = -1;

  // onTag(tag), onRun(first, last): what a click selects
  constructor(host, onTag, onRun) {
    this.#host = host;
    this.#onTag = onTag;
    this.#onRun = onRun;
  }

  load(job) {
    const open = new Set(
      [...this.#host.querySelectorAll("details[open]")].map((d) => d.dataset.run),
    );
    this.#rows.clear();
    const runs = runsOf(job.operation, job.tool);
    this.#host.replaceChildren(...runs.map((run, k) => this.#run(job, run, k, open)));
    this.mark(this.#shown);
  }

  mark(tag) {
    this.#rows.get(this.#shown)?.classList.remove("selected");
    this.#shown = tag;
    this.#rows.get(tag)?.classList.add("selected");
  }

  #run(job, { operation, tool, first, last }, k, open) {
    const grades = job.grade.subarray(first, last + 1);
    const worst = grades.reduce((a, b) => Math.max(a, b), 0);
    const failing = grades.reduce((sum, g) => sum + (g === 3), 0);
    const words = `${job.operations[operation] ?? "(no name)"}, ${job.tools[tool] ?? "no tool"}: `;
    const count = last - first + 1;
    const text = `${words}${count} tag${count > 1 ? "s" : ""}${failing ? `, ${failing} fail` : ""}`;
    const summary = element("summary", {}, dot(worst), text);
    const box = element("details", {}, summary);
    box.dataset.run = `${k}`;
    const fill = () => {
      if (box.open && box.children.length === 1) box.append(...this.#tags(job, first, last));
    };
    box.addEventListener("toggle", fill);
    box.open = open.has(`${k}`);
    fill();
    summary.addEventListener("click", () => this.#onRun(first, last));
    return box;
  }

  *#tags(job, first, last) {
    for (let tag = first; tag <= Math.min(last, first + MOST - 1); tag++) {
      const text = `${job.names[tag]}${job.pinned(tag) ? " (pinned)" : ""}`;
      const row = element("div", { className: "leaf" }, dot(job.grade[tag]), text);
      row.addEventListener("click", () => this.#onTag(tag));
      this.#rows.set(tag, row);
      yield row;
    }
    const left = last - first + 1 - MOST;
    if (left > 0) yield element("p", { textContent: `and ${left} more: see the list of tags` });
  }
}
