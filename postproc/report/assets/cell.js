// The page of a cell: the robot at home, sliders for its axes, the frames that the cell names.
import { matrix } from "./arm.js";
import { pageData } from "./data.js";
import { byId, element } from "./dom.js";
import { dress } from "./dress.js";
import { showFindings } from "./findings.js";
import { DEGREES } from "./numbers.js";
import { openScene } from "./scene.js";
import { Matrix4, Vector3 } from "./three.bundle.js";

const FRAME = 0.25; // m
const FROM = [-0.75, -1, 0.5];

const data = pageData();
// of the arm [rad], then of the external axes [m or rad]; those of the address where it has them
const values = [...data.home, ...data.externals.map(({ limits }) => nearest(0, limits))];
let colliding = [];

function nearest(value, [low, high]) {
  return Math.min(Math.max(value, low), high);
}

// the angles that the address of the page holds
function fromAddress() {
  const given = window.location.hash.slice(1).split(",").map(Number);
  if (given.length !== values.length || !given.every(Number.isFinite)) return;
  given.forEach((value, k) => (values[k] = value / scaleOf(k)));
}

// file units of an axis for its own
function scaleOf(k) {
  const external = data.externals[k - 6];
  return external && !external.turns ? 1000 : DEGREES;
}

// what an external axis moves
function motionOf({ turns, axis, point }, value) {
  const way = new Vector3(...axis);
  if (!turns) return new Matrix4().makeTranslation(...way.multiplyScalar(value).toArray());
  const [there, back] = [point, point.map((v) => -v)].map((at) =>
    new Matrix4().makeTranslation(...at),
  );
  return there.multiply(new Matrix4().makeRotationAxis(way.normalize(), value)).multiply(back);
}

function stand() {
  const world = { robot: new Matrix4(), part: new Matrix4() };
  data.externals.forEach((external, k) => {
    world[external.turns ? "part" : "robot"].multiply(motionOf(external, values[6 + k]));
  });
  const rows = (M) => M.clone().transpose().toArray();
  const { T_world_robroot, T_world_base } = data.robot;
  const robot = world.robot.multiply(matrix(T_world_robroot));
  scene.stand(rows(robot), rows(world.part.multiply(matrix(T_world_base))));
}

function show() {
  if (data.externals.length) stand();
  scene.place(values.slice(0, 6));
}

// keeps what is set in the address: a reload, or a copy of it, shows the same
function keep() {
  const told = values.map((value, k) => +(value * scaleOf(k)).toFixed(3));
  window.history.replaceState(null, "", `#${told.join(",")}`);
  tellKeys(told);
}

function tellKeys(told) {
  byId("keys").textContent = `[motion] home_deg = [${told.slice(0, 6).join(", ")}]`;
}

function addSlider(name, unit, limits, k) {
  const scale = scaleOf(k);
  const [min, max] = limits.map((v) => v * scale);
  const range = { type: "range", min, max, step: "any", value: values[k] * scale };
  const input = element("input", { ...range, id: `axis${k + 1}` });
  const text = element("span");
  const tell = () => {
    const at = (values[k] * scale).toFixed(1);
    text.textContent = `${name} ${at} ${unit} (${min.toFixed(0)} to ${max.toFixed(0)})`;
  };
  input.addEventListener("input", () => {
    values[k] = input.value / scale;
    show();
    tell();
    keep();
  });
  byId("axes").append(element("label", { className: "axis" }, input, text));
  tell();
}

// shows the tool and the base that are chosen, and what collides with them
function work() {
  const [tool, base] = ["tool", "base"].map((what) => +(byId(what)?.value ?? 0));
  colliding = data.colliding[tool][base];
  scene.work(tool, base);
  scene.highlight(colliding);
}

function state() {
  const { tip, solids } = scene;
  return { ready: true, angles: values.slice(0, 6), values: [...values], colliding, tip, solids };
}

dress();
showFindings(byId("findings"), data.findings, () => {});
fromAddress();
const scene = openScene(byId("scene"), data);
for (const { matrix: rows } of data.frames) scene.addFrame(rows, FRAME);
scene.addFloor();
show();
work();
scene.fit([], FROM);
for (const what of ["tool", "base"]) byId(what)?.addEventListener("change", work);
data.robot.limits.forEach((limits, k) => {
  addSlider(
    `A${k + 1}`,
    "deg",
    limits.map((v) => v / DEGREES),
    k,
  );
});
data.externals.forEach(({ name, turns, limits }, k) => {
  addSlider(name, turns ? "deg" : "mm", limits, 6 + k);
});
tellKeys(values.map((value, k) => +(value * scaleOf(k)).toFixed(3)));

window.ppPage = { state };
