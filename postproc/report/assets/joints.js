// Charts of joint angles and joint speeds over time.
import { lineChart } from "./chart.js";
import { LINE_COLOURS } from "./colours.js";
import { byId } from "./dom.js";
import { jointCurves } from "./motion.js";

const JOINTS = [0, 1, 2, 3, 4, 5];

export class JointCharts {
  #time;
  #robot;
  #curves;
  #onPick;
  #cursors = [];

  // robot: limits [deg] and speeds [deg/s]; onPick: a time that was clicked
  constructor(q, time, robot, onPick) {
    this.#time = time;
    this.#robot = robot;
    this.#onPick = onPick;
    this.#curves = JOINTS.map((j) => jointCurves(q, time, j, robot.speeds[j]));
    this.draw();
  }

  // draws the joints that are chosen; a single one with its limits
  draw() {
    const choice = byId("axis").value;
    const joints = choice === "all" ? JOINTS : [+choice];
    const levels = joints.length === 1 ? this.#robot.limits[joints[0]].map((y) => ({ y })) : [];
    this.#cursors = [
      this.#chart("angles", joints, "angle", { yLabel: "deg", levels }),
      this.#chart("speeds", joints, "speed", { yLabel: "% of axis limit" }),
    ];
  }

  // moves the cursors to a time
  move(t) {
    for (const cursor of this.#cursors) cursor?.move(t);
  }

  #chart(id, joints, what, options) {
    const series = joints.map((j) => ({
      name: `A${j + 1}`,
      x: this.#time,
      y: this.#curves[j][what],
      colour: LINE_COLOURS[j],
    }));
    return lineChart(byId(id), { series, xLabel: "time [s]", onPick: this.#onPick, ...options });
  }
}
