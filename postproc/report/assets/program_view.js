// A program shown: robot, part and path in 3D, play through time, tags, texts, charts.
import { valueColours } from "./colours.js";
import { unpack, unpackColumns, unpackText } from "./data.js";
import { byId } from "./dom.js";
import { showFindings } from "./findings.js";
import { JointCharts } from "./joints.js";
import { onColourChoice, showLegend } from "./legend.js";
import { columnField, RowList } from "./list.js";
import { anglesAt, moveAt, movesOfTags, nearestMove } from "./motion.js";
import { Player } from "./player.js";
import { openScene } from "./scene.js";
import { camLines, linesNear, linesOfMoves, markMove, showLines } from "./source.js";
import { showSpins, SpinMap } from "./spins.js";
import { trail } from "./trail.js";
import { corners } from "./views.js";

const FAILING = [1, 0, 0];
const NO_VALUE = [0.55, 0.55, 0.55];
const RAPID = [0.8, 0.72, 0.55];
const OTHER_MOVE = [0.3, 0.4, 0.5];

// What the page's data say of moves and tags, unpacked.
class ProgramData {
  constructor(data) {
    Object.assign(this, data);
    const take = (key) => unpack(data[key]);
    this.what = data.what || "tag";
    this.tags = data.names.length;
    this.columns = unpackColumns(data.columns);
    this.points = take("tag_positions");
    this.axes = take("tag_axes");
    this.moveOf = take("move_of_tag");
    this.lines = take("lines");
    this.camLine = data.cam_lines ? take("cam_lines") : this.lines;
    this.q = take("q");
    this.time = take("time");
    this.moves = this.time.length;
    this.tagOf = take("tag");
    this.rapid = take("rapid");
    this.station = take("station");
    this.frame = take("frame");
    this.krlLine = take("krl_line");
    this.krlFile = take("krl_file");
    this.movesOf = movesOfTags(this.tagOf, this.tags);
  }

  failed(tag) {
    return this.failing[tag] || "";
  }

  point(tag) {
    return this.points.subarray(3 * tag, 3 * tag + 3);
  }

  value(key, tag) {
    return this.columns.find((column) => column.key === key)?.values[tag] ?? NaN;
  }

  // the first tag that fails, else the first of all
  firstFailing() {
    const failing = Object.keys(this.failing).map(Number);
    return failing.length ? Math.min(...failing) : 0;
  }

  // the end of the last move of the whole program [s]
  get total() {
    return this.moves ? this.time[this.moves - 1] : 0;
  }

  // the move in which a tag is served; failing that one of a tag near it
  moveNear(tag) {
    const own = this.ownMove(tag);
    return own >= 0 ? own : nearestMove(this.points, this.moveOf, tag);
  }

  ownMove(tag) {
    return this.moveOf[tag] >= 0 ? this.moveOf[tag] : this.movesOf.last[tag];
  }

  fields() {
    const found = [
      [this.what, (i) => this.names[i]],
      ["line", (i) => this.lines[i]],
      ...this.columns.map(columnField),
    ];
    if (Object.keys(this.failing).length) found.push(["finding", (i) => this.failed(i) || null]);
    return found;
  }

  // line to move, of the moves of a tag in the file of its first one
  linesOf(tag) {
    const first = this.movesOf.first[tag];
    const found = new Map();
    for (let move = first; move <= this.movesOf.last[tag]; move++) {
      const here = this.krlFile[move] === this.krlFile[first] && this.tagOf[move] === tag;
      if (here) found.set(this.krlLine[move], move);
    }
    return found;
  }

  // what stands over the texts of a tag
  words(tag) {
    const finding = this.failed(tag);
    const note = this.poses[tag]?.note;
    return (
      `${this.what} ${this.names[tag]}, line ${this.lines[tag]}` +
      (this.tag_frames.length ? `, ${this.tag_frames[tag]}` : "") +
      (finding ? `: ${finding}` : "") +
      (note ? `. Shown: ${note}.` : "")
    );
  }
}

// A program on the page. scene: a 3D view of the same cell that is there already; first: the tag
// that is shown first; onShow: called with the tag that is shown.
export class ProgramView {
  #onShow;
  #markSize;
  #current = -1; // move
  #shown = -1; // tag
  #angles = [0, 0, 0, 0, 0, 0];
  #colliding = [];
  #texts = null;
  #marks;
  #path;
  #owner;
  #player;
  #list;
  #charts = null;
  #spinMap = null;

  constructor(data, { scene = null, first = null, onShow = () => {} } = {}) {
    this.data = new ProgramData(data);
    this.#onShow = onShow;
    this.#markSize = Math.max(0.0015, Math.min(0.01, data.extent / 150));
    this.scene = scene ?? openScene(byId("scene"), data);
    if (data.spin_map) this.#spinMap = new SpinMap(data.spin_map);
    this.#draw();
    this.#fill();
    this.#listen();
    this.seek(0);
    if (this.data.tags) this.select(first ?? this.data.firstFailing());
    if (!scene) {
      this.scene.addFloor();
      this.#look("cell");
    }
    this.#loadTexts();
  }

  get shown() {
    return this.#shown;
  }

  #draw() {
    const { data, scene } = this;
    this.#marks = scene.addMarks(data.points, data.axes, this.#markSize, (tag) => this.select(tag));
    const { ends, owner } = trail(data, unpack(data.positions));
    this.#path = scene.addSegments(ends);
    this.#owner = owner;
  }

  #fill() {
    const { data } = this;
    const select = (tag) => this.select(tag);
    const failed = (tag) => data.failed(tag);
    const seek = (t) => this.seek(t);
    this.#player = new Player(data.total, seek);
    const { tags: n, what } = data;
    const grades = data.grade ? unpack(data.grade) : null;
    this.#list = new RowList({ n, what, fields: data.fields(), failed, select, grades });
    if (data.moves) this.#charts = new JointCharts(data.q, data.time, data.robot, seek);
    else {
      this.#player.disable();
      for (const id of ["angles", "speeds"]) byId(id).textContent = "no motion was planned";
    }
  }

  #listen() {
    onColourChoice(this.data.columns, (column) => this.#paint(column));
    byId("view").addEventListener("change", () => this.#look(byId("view").value));
    byId("axis").addEventListener("change", () => {
      this.#charts?.draw();
      this.seek(this.#player.clock, false);
    });
    const { findings } = this.data;
    if (findings) showFindings(byId("findings"), findings, (tag) => this.select(tag));
  }

  // ---- scene ----------------------------------------------------------------------------------

  #look(at) {
    const { data, scene } = this;
    const half = data.extent / 2;
    const centre = scene.inWorld(data.centre);
    if (at === "part") {
      scene.look({ centre, radius: 1.3 * Math.max(half, 0.08) });
    } else if (at === "tag" && this.#shown >= 0) {
      const radius = Math.max(0.2, 0.15 * half);
      scene.look({ centre: scene.inWorld(data.point(this.#shown)), radius });
    } else {
      scene.fit(corners(data.points), scene.side(data.points, data.axes, this.#somePoses()));
    }
  }

  // poses spread over the program
  #somePoses() {
    const { q, moves } = this.data;
    if (!moves) return [this.#angles];
    return [0.1, 0.3, 0.5, 0.7, 0.9].map((share) => {
      const move = Math.floor(share * moves);
      return Array.from(q.subarray(6 * move, 6 * move + 6));
    });
  }

  #paint(column) {
    const { data } = this;
    const colours = valueColours(column);
    this.paintTags((tag) => (data.failed(tag) ? FAILING : colours.colourOf(tag)));
    this.#path.paint((k) => {
      const move = this.#owner[k];
      if (data.rapid[move]) return RAPID;
      const tag = data.tagOf[move];
      return (tag >= 0 ? colours.colourOf(tag) : null) ?? OTHER_MOVE;
    });
    showLegend(colours);
  }

  // gives tags the colours of a function; null: without a value
  paintTags(colourOf) {
    this.#marks.paint((tag) => colourOf(tag) ?? NO_VALUE);
  }

  #highlight(names, point = null) {
    if (names.join() === this.#colliding.join() && !point) return;
    this.#colliding = names;
    this.scene.highlight(names, point);
  }

  // shows a pose: {q, frames, pair, point}, and stand where external axes carry robot and part
  pose({ q, frames, pair, point, stand }) {
    this.#angles = q.slice();
    if (stand) this.scene.stand(...stand);
    this.scene.work(...frames);
    this.scene.place(this.#angles);
    this.scene.miss(this.#shown >= 0 ? this.data.point(this.#shown) : null);
    this.#highlight(pair, point);
  }

  // ---- time -----------------------------------------------------------------------------------

  // shows a time of the program; the tag that runs there too, unless follow is false
  seek(t, follow = true) {
    const { data, scene } = this;
    const clock = this.#player.show(t);
    const move = moveAt(data.time, clock);
    this.#current = move;
    if (data.moves) {
      this.#angles = anglesAt(data.q, data.time, move, clock);
      scene.miss(null);
      this.#highlight([]);
      if (data.frame.length) scene.work(...data.frames[data.frame[move]]);
      if (data.station.length) scene.stand(...data.stations[data.station[move]]);
      scene.place(this.#angles);
      this.#charts?.move(clock);
      if (follow) this.#show(data.tagOf[move]);
    }
    markMove(move);
  }

  seekMove(move) {
    this.seek(this.data.time[move]);
  }

  // ---- one tag --------------------------------------------------------------------------------

  select(tag) {
    const { data } = this;
    const pose = data.poses[tag];
    const move = pose ? data.ownMove(tag) : data.moveNear(tag);
    const standing = pose ? this.#player.clock : 0;
    this.seek(move >= 0 ? data.time[move] : standing, false);
    this.#show(tag);
    if (pose) this.pose(pose);
    this.#list.reveal(tag);
    if (byId("view").value === "tag") this.#look("tag");
  }

  // selects the first tag of a line of the CAM file
  selectLine(line) {
    const tag = this.data.camLine.indexOf(line);
    if (tag >= 0) this.select(tag);
  }

  #show(tag) {
    if (tag === this.#shown || tag < 0) return;
    const { data } = this;
    this.#shown = tag;
    this.#list.mark(tag);
    byId("which").textContent = data.words(tag);
    byId("which").className = data.failed(tag) ? "bad" : "";
    this.scene.point(data.point(tag), 1.6 * this.#markSize);
    this.#showSource(tag);
    if (byId("spin")) {
      const chosen = [data.value("spin", tag), data.value("stiffness", tag)];
      showSpins(this.#spinMap, data.no_spin_map, tag, data.objective, ...chosen);
    }
    this.#onShow(tag);
  }

  #showSource(tag) {
    if (!this.#texts) return;
    const { data } = this;
    const { cam, krl } = this.#texts;
    showLines(byId("cam"), linesNear(cam, data.camLine[tag]));
    const from = data.movesOf.first[tag];
    if (data.krlLine.length && from >= 0) {
      const file = data.krlFile[from];
      byId("krl_file").textContent = data.krl_files[file];
      showLines(byId("krl"), linesOfMoves(krl[file], data.linesOf(tag)));
    } else {
      const has = data.krlLine.length > 0;
      byId("krl_file").textContent = has ? "no motion for this tag" : "no program text";
      showLines(byId("krl"), []);
    }
    markMove(this.#current);
  }

  async #loadTexts() {
    const { data } = this;
    const [cam, ...krl] = await Promise.all([data.cam, ...data.krl].map(unpackText));
    this.#texts = { cam: camLines(cam), krl: krl.map((text) => text.split("\n")) };
    if (this.#shown >= 0) this.#showSource(this.#shown);
  }

  spinCurve(tag) {
    return this.#spinMap.curve(tag);
  }

  state() {
    const { data, scene } = this;
    const { visible } = this.#list;
    const { clock, playing } = this.#player;
    const current = this.#current;
    return {
      ...{ ready: this.#texts !== null, clock, playing, current, shown: this.#shown },
      ...{ moves: data.moves, tags: data.tags, angles: this.#angles, colliding: this.#colliding },
      ...{ rows: visible.length, first: visible[0] ?? -1, colour: byId("colour").value },
      ...{ tip: scene.tip, toolTip: scene.toolTip, solids: scene.solids, meeting: scene.meeting },
      line: current >= 0 && data.krlLine.length ? data.krlLine[current] : null,
    };
  }
}
