// The page of a cell: the robot at home, sliders for its axes, the frames that the cell names.
import { pageData } from "./data.js";
import { byId, element } from "./dom.js";
import { DEGREES } from "./numbers.js";
import { openScene } from "./scene.js";
import { sortTables } from "./tables.js";
import { distance, middle, origin, raised } from "./views.js";

const FRAME = 0.25; // m

const data = pageData();
const angles = data.home.slice();
let colliding = [];

function look() {
  const root = origin(data.robot.T_world_robroot);
  const base = origin(data.robot.T_world_base);
  const reach = Math.max(data.reach, distance(root, base));
  const centre = raised(middle(root, base), 0.12 * reach);
  scene.look({ centre, radius: 0.62 * reach, from: [-0.75, -1, 0.5] });
}

function addSlider([low, high], j) {
  const range = { type: "range", min: low, max: high, step: "any", value: angles[j] * DEGREES };
  const input = element("input", { ...range, id: `axis${j + 1}` });
  const text = element("span");
  const tell = () => {
    const at = (angles[j] * DEGREES).toFixed(1);
    text.textContent = `A${j + 1} ${at} deg (${low.toFixed(0)} to ${high.toFixed(0)})`;
  };
  input.addEventListener("input", () => {
    angles[j] = input.value / DEGREES;
    scene.place(angles);
    tell();
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
  return { ready: true, angles: angles.slice(), colliding, tip, solids };
}

sortTables();
const scene = openScene(byId("scene"), data);
for (const { matrix } of data.frames) scene.addFrame(matrix, FRAME);
scene.addFloor();
scene.place(angles);
look();
work();
for (const what of ["tool", "base"]) byId(what)?.addEventListener("change", work);
data.robot.limits.forEach(addSlider);

window.ppPage = { state };
