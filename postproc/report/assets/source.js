// The lines of a tag in the CAM file and in the program, side by side.
import { byId, element } from "./dom.js";

const MOST_LINES = 60;

// text of a packed CAM file, "number<tab>text" a line, as a map from number to text
export function camLines(text) {
  return new Map(
    text.split("\n").map((line) => {
      const tab = line.indexOf("\t");
      return [+line.slice(0, tab), line.slice(tab + 1)];
    }),
  );
}

// lines about a line of the CAM file: {number, text, here}
export function linesNear(cam, at) {
  const numbers = at > 0 ? [at - 2, at - 1, at, at + 1, at + 2] : [];
  return numbers
    .filter((number) => cam.has(number))
    .map((number) => ({ number, text: cam.get(number), here: number === at, cam: number }));
}

// Lines of a program between first and last of some moves: {number, text, here, move}. moveOf: from
// line to move. A single line is shown among its neighbours.
export function linesOfMoves(texts, moveOf) {
  let low = Math.min(...moveOf.keys());
  let high = Math.max(...moveOf.keys());
  if (moveOf.size === 1) {
    low = Math.max(1, low - 3);
    high = Math.min(texts.length, high + 3);
  }
  return Array.from({ length: Math.min(high - low + 1, MOST_LINES) }, (_, k) => {
    const number = low + k;
    const move = moveOf.get(number);
    return { number, text: texts[number - 1], here: move !== undefined, move };
  });
}

export function showLines(host, lines) {
  host.replaceChildren(
    ...lines.map(({ number, text, here, move, cam }) => {
      const textContent = `${number}  ${text}`;
      const line = element("div", { textContent, className: here ? "here" : "" });
      if (move !== undefined) line.dataset.move = move;
      if (cam !== undefined) line.dataset.cam = cam;
      return line;
    }),
  );
}

// marks the line of the move that runs
export function markMove(move) {
  for (const line of byId("krl").children) {
    line.classList.toggle("now", +line.dataset.move === move);
  }
}
