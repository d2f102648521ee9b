// The page of a program: robot, part and path in 3D, play through time, tags, texts, charts.
import { valueColours } from "./colours.js";
import { pageData, unpack, unpackColumns, unpackText } from "./data.js";
import { byId } from "./dom.js";
import { JointCharts } from "./joints.js";
import { onColourChoice, showLegend } from "./legend.js";
import { columnField, RowList } from "./list.js";
import { anglesAt, moveAt, movesOfTags, nearestMove } from "./motion.js";
import { Player } from "./player.js";
import { openScene } from "./scene.js";
import { camLines, linesNear, linesOfMoves, markMove, showLines } from "./source.js";
import { showSpins, SpinMap } from "./spins.js";
import { sortTables } from "./tables.js";
import { trail } from "./trail.js";
import { origin, robotAndPart } from "./views.js";

const FAILING = [1, 0, 0];
const NO_VALUE = [0.55, 0.55, 0.55];
const RAPID = [0.8, 0.72, 0.55];
const OTHER_MOVE = [0.3, 0.4, 0.5];

const data = pageData();
const what = data.what || "tag";
const tags = data.names.length;
const columns = unpackColumns(data.columns);
const points = unpack(data.tag_positions);
const moveOf = unpack(data.move_of_tag);
const lines = unpack(data.lines);
const camLine = data.cam_lines ? unpack(data.cam_lines) : lines;

const q = unpack(data.q);
const time = unpack(data.time);
const moves = time.length;
const tagOf = unpack(data.tag);
const rapid = unpack(data.rapid);
const station = unpack(data.station);
const frame = unpack(data.frame);
const krlLine = unpack(data.krl_line);
const krlFile = unpack(data.krl_file);
const movesOf = movesOfTags(tagOf, tags);
const spinMap = data.spin_map ? new SpinMap(data.spin_map) : null;

const markSize = Math.max(0.0015, Math.min(0.01, data.extent / 150));
const radius = Math.max(data.extent / 2, 0.3);

let current = -1; // move
let shown = -1; // tag
let angles = [0, 0, 0, 0, 0, 0];
let colliding = [];
let texts = null;

function failed(tag) {
  return data.failing[tag] || "";
}

function pointOf(tag) {
  return points.subarray(3 * tag, 3 * tag + 3);
}

function valueOf(key, tag) {
  return columns.find((column) => column.key === key)?.values[tag] ?? NaN;
}

// ---- scene ------------------------------------------------------------------------------------

function look(at) {
  const centre = scene.inWorld(data.centre);
  if (at === "part") {
    scene.look({ centre, radius: 1.3 * Math.max(data.extent / 2, 0.08) });
  } else if (at === "tag" && shown >= 0) {
    scene.look({ centre: scene.inWorld(pointOf(shown)), radius: Math.max(0.2, 0.15 * radius) });
  } else {
    scene.look(robotAndPart(origin(data.robot.T_world_robroot), centre, radius));
  }
}

function paint(column) {
  const colours = valueColours(column);
  const { colourOf } = colours;
  marks.paint((tag) => (failed(tag) ? FAILING : (colourOf(tag) ?? NO_VALUE)));
  path.paint((k) => {
    const move = owner[k];
    if (rapid[move]) return RAPID;
    return (tagOf[move] >= 0 ? colourOf(tagOf[move]) : null) ?? OTHER_MOVE;
  });
  showLegend(colours);
}

function highlight(names, point = null) {
  if (names.join() === colliding.join() && !point) return;
  colliding = names;
  scene.highlight(names, point);
}

// ---- time -------------------------------------------------------------------------------------

// shows a time of the program; the tag that runs there too, unless follow is false
function seek(t, follow = true) {
  const clock = player.show(t);
  current = moveAt(time, clock);
  if (moves) {
    angles = anglesAt(q, time, current, clock);
    highlight([]);
    if (frame.length) scene.work(...data.frames[frame[current]]);
    if (station.length) scene.stand(...data.stations[station[current]]);
    scene.place(angles);
    charts?.move(clock);
    if (follow) showTag(tagOf[current]);
  }
  markMove(current);
}

// ---- one tag ----------------------------------------------------------------------------------

function select(tag) {
  const own = moveOf[tag] >= 0 ? moveOf[tag] : movesOf.last[tag];
  const pose = data.poses[tag];
  if (pose) {
    seek(own >= 0 ? time[own] : player.clock, false);
    angles = pose.q.slice();
    scene.work(...pose.frames);
    scene.place(angles);
  } else {
    seek(time[own >= 0 ? own : nearestMove(points, moveOf, tag)] || 0, false);
  }
  showTag(tag);
  if (pose) highlight(pose.pair, pose.point);
  list.reveal(tag);
  if (byId("view").value === "tag") look("tag");
}

function showTag(tag) {
  if (tag === shown || tag < 0) return;
  shown = tag;
  list.mark(tag);
  const finding = failed(tag);
  const note = data.poses[tag]?.note;
  byId("which").textContent =
    `${what} ${data.names[tag]}, line ${lines[tag]}` +
    (data.tag_frames.length ? `, ${data.tag_frames[tag]}` : "") +
    (finding ? `: ${finding}` : "") +
    (note ? `. Shown: ${note}.` : "");
  byId("which").className = finding ? "bad" : "";
  scene.point(pointOf(tag), 1.6 * markSize);
  showSource(tag);
  if (byId("spin")) {
    const chosen = [valueOf("spin", tag), valueOf("stiffness", tag)];
    showSpins(spinMap, data.no_spin_map, tag, data.objective, ...chosen);
  }
}

function showSource(tag) {
  if (!texts) return;
  showLines(byId("cam"), linesNear(texts.cam, camLine[tag]));
  const from = movesOf.first[tag];
  if (krlLine.length && from >= 0) {
    const file = krlFile[from];
    const moveOfLine = new Map();
    for (let move = from; move <= movesOf.last[tag]; move++) {
      if (krlFile[move] === file && tagOf[move] === tag) moveOfLine.set(krlLine[move], move);
    }
    byId("krl_file").textContent = data.krl_files[file];
    showLines(byId("krl"), linesOfMoves(texts.krl[file], moveOfLine));
  } else {
    byId("krl_file").textContent = krlLine.length ? "no motion for this tag" : "no program text";
    showLines(byId("krl"), []);
  }
  markMove(current);
}

async function loadTexts() {
  const [cam, ...krl] = await Promise.all([data.cam, ...data.krl].map(unpackText));
  texts = { cam: camLines(cam), krl: krl.map((text) => text.split("\n")) };
  if (shown >= 0) showSource(shown);
}

// ---- the page ---------------------------------------------------------------------------------

function fields() {
  const found = [
    [what, (i) => data.names[i]],
    ["line", (i) => lines[i]],
    ...columns.map(columnField),
  ];
  if (Object.keys(data.failing).length) found.push(["finding", (i) => failed(i) || null]);
  return found;
}

function state() {
  const { visible } = list;
  const { clock, playing } = player;
  return {
    ...{ ready: texts !== null, clock, playing, current, shown, moves, tags, angles, colliding },
    ...{ rows: visible.length, first: visible[0] ?? -1, colour: byId("colour").value },
    ...{ tip: scene.tip, solids: scene.solids, meeting: scene.meeting },
    line: current >= 0 && krlLine.length ? krlLine[current] : null,
  };
}

sortTables();
const scene = openScene(byId("scene"), data);
const marks = scene.addMarks(points, unpack(data.tag_axes), markSize, select);
const { ends, owner } = trail(data, unpack(data.positions));
const path = scene.addSegments(ends);
const player = new Player(moves ? time[moves - 1] : 0, seek);
const list = new RowList({ n: tags, what, fields: fields(), failed, select });
const charts = moves ? new JointCharts(q, time, data.robot, seek) : null;

scene.addFloor();
look("cell");
onColourChoice(columns, paint);
byId("view").addEventListener("change", () => look(byId("view").value));
byId("axis").addEventListener("change", () => {
  charts?.draw();
  seek(player.clock, false);
});
for (const row of document.querySelectorAll("#findings tr[data-goto]")) {
  row.addEventListener("click", () => select(+row.dataset.goto));
}
if (!moves) {
  player.disable();
  for (const id of ["angles", "speeds"]) byId(id).textContent = "no motion was planned";
}
seek(0);
const failing = Object.keys(data.failing).map(Number);
if (failing.length) select(Math.min(...failing));
else if (tags) select(0);
loadTexts();

window.ppPage = { seek, select, state, spinCurve: (tag) => spinMap.curve(tag) };
