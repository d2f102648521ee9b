// The motions of a program in time; q: flat joint angles [rad], six per move; time: end of each [s].
import { DEGREES } from "./numbers.js";

// the move that runs at a time: the first that ends at it or later; -1 without moves
export function moveAt(time, t) {
  let low = 0;
  let high = time.length - 1;
  if (high < 0) return -1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

// joint angles at a time within a move, between those of its start and its end
export function anglesAt(q, time, move, t) {
  const start = Math.max(0, move - 1);
  const span = time[move] - time[start];
  const f = span > 0 ? (t - time[start]) / span : 1;
  return Array.from(
    { length: 6 },
    (_, j) => q[6 * start + j] + f * (q[6 * move + j] - q[6 * start + j]),
  );
}

// first and last move of each tag, -1 for a tag without one
export function movesOfTags(tagOf, tags) {
  const first = new Int32Array(tags).fill(-1);
  const last = new Int32Array(tags).fill(-1);
  tagOf.forEach((tag, move) => {
    if (tag < 0) return;
    if (first[tag] < 0) first[tag] = move;
    last[tag] = move;
  });
  return { first, last };
}

// the move of the tag nearest to a tag among those that have one, -1 where none has
export function nearestMove(points, moveOf, tag) {
  let best = -1;
  let least = Infinity;
  for (let k = 0; k < moveOf.length; k++) {
    if (moveOf[k] < 0) continue;
    const [x, y, z] = [0, 1, 2].map((a) => points[3 * k + a] - points[3 * tag + a]);
    const away = Math.hypot(x, y, z);
    if (away < least) {
      least = away;
      best = moveOf[k];
    }
  }
  return best;
}

// angles [deg] of a joint, and its mean speed in each move [% of the axis' limit in deg/s]
export function jointCurves(q, time, joint, limit) {
  const angle = Float64Array.from(time, (_, i) => q[6 * i + joint] * DEGREES);
  const speed = angle.map((value, i) => {
    const dt = i ? time[i] - time[i - 1] : 0;
    return dt > 1e-4 ? ((Math.abs(value - angle[i - 1]) / dt) * 100) / limit : 0;
  });
  return { angle, speed };
}
