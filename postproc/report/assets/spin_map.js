// The spin map: says what stands under the pointer.
import { pageData, unpack } from "./data.js";
import { byId } from "./dom.js";
import { tagAndSpin, wordsOf } from "./spin_cells.js";
import { dress } from "./dress.js";

const data = pageData();
const map = {
  ...data,
  classes: unpack(data.classes),
  stiffness: unpack(data.stiffness),
  chosen: unpack(data.chosen),
  lines: unpack(data.lines),
};

dress();
byId("map").addEventListener("mousemove", ({ clientX, clientY, currentTarget }) => {
  const frame = currentTarget.getBoundingClientRect();
  const scale = map.width / frame.width;
  const at = tagAndSpin(map, (clientX - frame.left) * scale, (clientY - frame.top) * scale);
  if (at) byId("under").textContent = wordsOf(map, ...at);
});
