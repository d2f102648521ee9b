// The spin map: says what stands under the pointer.
"use strict";
(() => {
  const d = PP.data, image = document.getElementById("map"), out = document.getElementById("under");
  const classes = PP.unpack(d.classes), stiffness = PP.unpack(d.stiffness), chosen = PP.unpack(d.chosen), lines = PP.unpack(d.lines);
  const count = d.names.length, width = d.spins.length;
  image.addEventListener("mousemove", e => {
    const frame = image.getBoundingClientRect(), scale = d.width / frame.width;
    const x = (e.clientX - frame.left) * scale - d.box[0], y = (e.clientY - frame.top) * scale - d.box[1];
    const k = Math.floor(x / d.box[2] * count), s = width - 1 - Math.floor(y / d.box[3] * width);
    if (k < 0 || k >= count || s < 0 || s >= width) return;
    const i = k * width + s, [first, last] = d.names[k];
    const name = first === last ? `tag ${first}` : `tags ${first} to ${last}`;
    const value = Number.isFinite(stiffness[i]) ? `, ${stiffness[i].toFixed(0)} N/mm` : "";
    const line = Number.isFinite(chosen[k]) ? `; chosen ${chosen[k].toFixed(1)} deg` : "";
    out.textContent = `${name} (CAM line ${lines[k]}), ${d.spins[s]} deg: ${d.words[classes[i]]}${value}${line}`;
  });
})();
