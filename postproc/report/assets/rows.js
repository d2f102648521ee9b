// Pages of rows in space: points with values, arrows, and the robot in the posture of a row.
import { lineChart } from "./chart.js";
import { LINE_COLOURS, valueColours } from "./colours.js";
import { pageData, unpack, unpackColumns } from "./data.js";
import { byId } from "./dom.js";
import { onColourChoice, showLegend } from "./legend.js";
import { columnField, RowList } from "./list.js";
import { spell } from "./numbers.js";
import { openScene } from "./scene.js";
import { dress } from "./dress.js";
import { corners } from "./views.js";

const NO_VALUE = [0.6, 0.6, 0.6];
const ARROW = [0.35, 0.1, 0.55];

const data = pageData();
const { names, what, notes, extent, centre } = data.rows;
const points = unpack(data.rows.points);
const columns = unpackColumns(data.rows.columns);
const q = data.rows.q ? unpack(data.rows.q) : null;
const vectors = data.rows.vectors ? unpack(data.rows.vectors) : null;
const markSize = Math.max(0.001, Math.min(0.02, extent / 120));
const radius = Math.max(extent / 2, 0.05);

let shown = -1;
let angles = null;
let arrows = null;

function look() {
  const middle = scene.inWorld(centre);
  if (data.robot) {
    scene.addFloor();
    scene.fit(corners(points), scene.side(points, null, angles ? [angles] : []));
  } else {
    scene.look({ centre: middle, radius: 1.3 * radius, from: [-0.5, -0.8, 0.5] });
  }
}

function paint(column) {
  const colours = valueColours(column);
  marks.paint((i) => colours.colourOf(i) ?? NO_VALUE);
  showLegend(colours);
}

// draws the vectors of all rows, made longer by a factor
function stretch(factor) {
  arrows?.remove();
  const ends = new Float32Array(2 * points.length);
  for (let k = 0; k < points.length; k += 3) {
    const start = points.subarray(k, k + 3);
    ends.set(start, 2 * k);
    ends.set(
      start.map((v, axis) => v + factor * vectors[k + axis]),
      2 * k + 3,
    );
  }
  arrows = scene.addSegments(ends);
  arrows.paint(() => ARROW);
  byId("factor").textContent = `${spell(factor)} x`;
}

function select(i) {
  shown = i;
  list.mark(i);
  list.reveal(i);
  if (q) {
    angles = Array.from(q.subarray(6 * i, 6 * i + 6));
    scene.place(angles);
  }
  scene.point(points.subarray(3 * i, 3 * i + 3), 1.8 * markSize);
  if (data.curves) showCurves(i);
}

// the curves of a row over the spin; what cannot be run is dashed
function showCurves(i) {
  const { spins: x, charts, values } = data.curves;
  const of = (all) => Array.from(all.subarray(i * x.length, (i + 1) * x.length));
  const blocked = of(unpack(data.curves.blocked));
  charts.forEach((drawn, k) => {
    const series = drawn.flatMap((name, c) => {
      const y = of(unpack(values[name]));
      const colour = LINE_COLOURS[c];
      const free = y.map((v, s) => (blocked[s] ? NaN : v));
      return [
        { name: "", x, y, colour, dash: "2 4" },
        { name, x, y: free, colour, dots: true },
      ];
    });
    const xLabel = "rotation about the tool axis [deg]; dashed: cannot be run";
    lineChart(byId(`curve${k}`), { series, xLabel, yLabel: "N/mm" });
  });
}

function state() {
  const { visible } = list;
  return {
    ...{ ready: true, shown, angles, rows: visible.length, first: visible[0] ?? -1 },
    ...{ colour: byId("colour").value, tip: scene.tip },
  };
}

dress();
const scene = openScene(byId("scene"), data);
const marks = scene.addMarks(points, null, markSize, select);
const fields = [[what, (i) => names[i]], ...columns.map(columnField)];
if (notes) fields.push(["finding", (i) => notes[i] || null]);
const list = new RowList({ n: names.length, what, fields, failed: () => "", select });

const slider = byId("stretch");
if (slider) {
  slider.addEventListener("input", () => stretch(10 ** +slider.value));
  stretch(10 ** +slider.value);
}
onColourChoice(columns, paint);
if (names.length) select(0);
look();

window.ppPage = { select, state };
