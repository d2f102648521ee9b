// The workbench: the page of a program that asks for its plan, and takes edits of it.
import { ask, fetched, latest } from "./bench_calls.js";
import { pageData, unpack } from "./data.js";
import { byId, element } from "./dom.js";
import { Places } from "./bench_places.js";
import { MapView } from "./map_view.js";
import { spell } from "./numbers.js";
import { ProgramView } from "./program_view.js";
import { Tree } from "./tree.js";

const EVERY = 300; // ms between two looks at the state

const { colours, words } = pageData();
const rgb = colours.map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255));
const main = document.querySelector("main");
const RELOADED = ["scene", "list", "cam", "spin", "angles", "speeds", "findings"];
const template = Array.from(main.children, (section) => section.cloneNode(true));

let state = { plan: 0, map: 0, pins: {}, things: [] };
let program = null;
let map = null; // {spins, classes, stiffness}
let near = new Map(); // spin of the tags around the last edit, while the whole plan is made
let gone = false;
let loaded = 0; // number of the plan that is shown

// ---- the server ---------------------------------------------------------------------------------

function complain(text) {
  byId("error").textContent = text;
}

async function edit(name, content) {
  try {
    const found = await ask(name, content);
    complain("");
    await look();
    return found;
  } catch (problem) {
    complain(problem.message);
    return null;
  }
}

// one look after the other
let looks = Promise.resolve();
function look() {
  looks = looks.then(lookOnce, lookOnce);
  return looks;
}

async function lookOnce() {
  const before = state;
  try {
    state = await fetched("state");
  } catch {
    gone = true;
    byId("doing").textContent = "the workbench has ended: start postproc ui again";
    return;
  }
  gone = false;
  showState();
  if (state.plan && state.plan !== before.plan) {
    near = new Map();
    await loadPlan();
  }
  if (state.map && state.map !== before.map) {
    const found = await fetched("map");
    map = {
      spins: found.spins,
      classes: unpack(found.classes),
      stiffness: unpack(found.stiffness),
    };
  }
  if (state.plan !== before.plan || state.map !== before.map) showMap();
  loaded = state.plan;
  if (JSON.stringify(state.pins) !== JSON.stringify(before.pins)) showMap();
}

function showState() {
  const [done, total, what] = state.progress ?? [0, 0, ""];
  byId("progress").hidden = !state.busy;
  if (total) byId("progress").value = done / total;
  else byId("progress").removeAttribute("value");
  byId("doing").textContent = state.busy ? `${what}${total ? ` ${done} of ${total}` : ""}` : "";
  byId("undo").disabled = !state.undo;
  byId("redo").disabled = !state.redo;
  byId("save").disabled = state.undo === 0;
  byId("why").hidden = state.good || !state.plan;
  byId("places").hidden = !state.has_place;
  showCauses();
  if (state.error) complain(state.hint ? `${state.error} (${state.hint})` : state.error);
}

// why tags fail, each with what cures it
let told = "";
function showCauses() {
  const causes = state.causes ?? [];
  if (JSON.stringify(causes) === told) return;
  told = JSON.stringify(causes);
  const rows = causes.map(({ text, cell }, cause) => {
    const row = element("p", { className: "cause" }, `${text} `);
    const apply = element("button", { textContent: "apply", title: "change the cell so" });
    apply.addEventListener("click", () => edit("cure", { cause }));
    if (cell) row.append(apply);
    return row;
  });
  byId("causes").replaceChildren(...rows);
}

// ---- the plan -----------------------------------------------------------------------------------

async function loadPlan() {
  const data = await fetched("plan");
  if (!data) return;
  complain("");
  const first = program && program.shown < data.names.length ? program.shown : null;
  const scene = program?.scene ?? null;
  const choice = byId("colour").value;
  refresh(scene);
  fillColours(data.columns, choice);
  scene?.clear();
  scene?.stand(data.robot.T_world_robroot, data.robot.T_world_base);
  showLead(data);
  map = map && map.classes.length === data.names.length * map.spins.length ? map : null;
  program = new ProgramView(data, { scene, first, onShow: shown });
  byId("names").replaceChildren(
    ...data.names.slice(0, 2000).map((value) => element("option", { value })),
  );
  showTree();
  places.load();
  shown(program.shown);
}

// puts fresh elements where a program is shown: what listened to the former plan is gone with it
function refresh(scene) {
  Array.from(main.children).forEach((section, k) => {
    if (!RELOADED.some((id) => section.querySelector(`#${id}`))) return;
    const fresh = template[k].cloneNode(true);
    if (section.querySelector("#scene") && scene) {
      fresh.querySelector("#scene").replaceWith(byId("scene"));
    }
    section.replaceWith(fresh);
  });
  for (const box of [byId("cam"), byId("krl")]) box.addEventListener("click", pickLine);
}

function fillColours(columns, choice) {
  const order = [...columns].sort((a, b) => (b.key === "stiffness") - (a.key === "stiffness"));
  byId("colour").replaceChildren(
    ...order.map(({ key, label, unit }) =>
      element("option", { value: key, textContent: `${label} [${unit}]` }),
    ),
  );
  if (columns.some(({ key }) => key === choice)) byId("colour").value = choice;
}

function showLead({ lead }) {
  const header = document.querySelector("header");
  for (const line of header.querySelectorAll("p")) line.remove();
  lead.forEach((textContent, k) => {
    const tone = k ? "" : `lead ${state.good ? "good" : "bad"}`;
    header.append(element("p", { textContent, className: tone }));
  });
}

function pinOf(tag) {
  return state.pins[program.data.names[tag]];
}

function showTree() {
  const { names, operations, tools, operation, tag_tool, grade } = program.data;
  tree.load({
    ...{ names, operations, tools },
    operation: unpack(operation),
    tool: unpack(tag_tool),
    grade: unpack(grade),
    pinned: (tag) => pinOf(tag) !== undefined,
  });
}

// the map over the spin; before it is made, the line of the plan alone
function showMap() {
  if (!program) return;
  const { names } = program.data;
  const spins = map?.spins ?? program.data.spin_map?.spins ?? [-180, -90, 0, 90];
  const cells = names.length * spins.length;
  const middle = (spins[0] + spins.at(-1)) / 2;
  const within = (v) => v - 360 * Math.round((v - middle) / 360);
  const column = program.data.columns.find(({ key }) => key === "spin");
  const spinOf = (tag) => (near.has(tag) ? near.get(tag) : (column?.values[tag] ?? NaN));
  const chosen = Array.from(names, (_, tag) => within(spinOf(tag)));
  const pins = new Map();
  names.forEach((name, tag) => {
    if (name in state.pins) pins.set(tag, within(state.pins[name]));
  });
  const none = { classes: new Uint8Array(cells), stiffness: new Float32Array(cells).fill(NaN) };
  view.load({ spins, ...none, ...map, chosen, pins, names });
  showTree();
  const [low, high] = view.range;
  byId("legend_map").replaceChildren(
    ...words.flatMap((word, k) => [
      element("i", { className: "state", style: `background:${colours[k]}` }),
      k ? `${word} ` : map ? `free, ${spell(low)} to ${spell(high)} N/mm ` : "free ",
    ]),
  );
}

// ---- one tag ------------------------------------------------------------------------------------

function shown(tag) {
  if (!program || tag < 0) return;
  view.mark(tag);
  tree.mark(tag);
  const column = program.data.columns.find(({ key }) => key === "spin");
  byId("find").value = program.data.names[tag];
  const pin = pinOf(tag);
  const spin = pin ?? column?.values[tag];
  byId("spin_deg").value = Number.isFinite(spin) ? +spin.toFixed(3) : "";
  byId("unpin").disabled = pin === undefined;
}

function select(tag) {
  view.try(null);
  program?.select(tag);
}

function pickLine({ target }) {
  const { move, cam } = target.dataset;
  if (move !== undefined) program.seekMove(+move);
  else if (cam !== undefined) program.selectLine(+cam);
}

const askPose = latest(
  "pose",
  (pose, { tag }) => {
    const { data } = program;
    if (pose.q) program.pose(pose);
    const numbers = [
      [pose.margin_deg, "deg to a joint limit"],
      [pose.wrist_deg, "deg from the straight wrist"],
      [pose.clearance_mm, "mm clearance"],
      [pose.stiffness_N_per_mm, "N/mm"],
    ].filter(([value]) => value !== null);
    byId("pose").textContent =
      `${data.names[tag]} at ${spell(pose.spin_deg)} deg: ${pose.words}` +
      numbers.map(([value, unit]) => `, ${spell(value)} ${unit}`).join("") +
      (pose.turned ? ", in another posture than the plan" : "");
    byId("pose").className = pose.free ? "good" : "bad";
    byId("spin_deg").value = pose.spin_deg;
  },
  complain,
);

async function drop(tag, spin) {
  await edit("pin", { tag, spin_deg: spin });
  view.try(null);
  around(tag);
}

async function unpin(tag) {
  if (pinOf(tag) === undefined) return;
  await edit("unpin", { tag });
  around(tag);
}

// what an edit makes of the tags beside it, before the whole plan is there
async function around(tag) {
  const asked = state.number;
  try {
    const found = await ask("around", { tag });
    if (asked !== state.number || state.plan === state.number) return;
    near = new Map(found.tags.map((t, k) => [t, found.spin_deg[k] ?? NaN]));
    byId("doing").textContent = found.words;
    byId("pose").textContent = found.words;
    byId("pose").className = found.good ? "good" : "bad";
    showMap();
  } catch (problem) {
    complain(problem.message);
  }
}

const view = new MapView(byId("map"), colours, {
  ...{ select, drop, unpin },
  drag: (tag, spin_deg) => askPose({ tag, spin_deg }),
  cancel: select,
});
const tree = new Tree(byId("tree"), select, (first, last) => {
  view.zoomTo(first, last);
  select(first);
});

const places = new Places(complain, {
  things: () => state.things,
  program: () => program,
  paint: (classes) => program.paintTags((tag) => rgb[classes[tag]]),
  paintAgain: () => byId("colour").dispatchEvent(new Event("change")),
});

// ---- the page -----------------------------------------------------------------------------------

byId("move").addEventListener("click", () => edit("move", places.frame()));
for (const name of ["undo", "redo", "reload", "why", "place"])
  byId(name).addEventListener("click", () => edit(name));
byId("save").addEventListener("click", async () => {
  const found = await edit("save");
  if (found) byId("saved").textContent = `written: ${found.files.join(", ")}; ${found.call}`;
});
byId("all").addEventListener("click", () => view.whole());
byId("find").addEventListener("change", ({ target }) => {
  const tag = program?.data.names.indexOf(target.value.trim()) ?? -1;
  if (tag >= 0) select(tag);
  else complain(`no tag is named ${target.value.trim()}`);
});
byId("spin_deg").addEventListener("input", ({ target }) => {
  if (!target.value || !program) return;
  view.try({ tag: program.shown, spin: +target.value });
  askPose({ tag: program.shown, spin_deg: +target.value });
});
byId("spin_deg").addEventListener("keydown", ({ key }) => key === "Enter" && byId("pin").click());
byId("pin").addEventListener("click", () => {
  if (program && byId("spin_deg").value) drop(program.shown, +byId("spin_deg").value);
});
byId("unpin").addEventListener("click", () => program && unpin(program.shown));
document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey)) return;
  const name = { z: "undo", y: "redo" }[event.key];
  if (!name || event.target.matches("input")) return;
  event.preventDefault();
  edit(name);
});

async function watch() {
  for (;;) {
    await look();
    await new Promise((done) => setTimeout(done, gone ? 2000 : EVERY));
  }
}
watch();

window.ppBench = {
  place: (tag, spin) => view.place(tag, spin),
  state: () => ({
    ...state,
    plan: loaded,
    gone,
    shown: program?.shown ?? -1,
    mapped: map !== null,
    preview: places.preview,
  }),
  program: () => program,
  near: () => [...near.keys()],
  grip: () => places.grip(),
  held: () => places.held,
};
