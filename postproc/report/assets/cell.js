// The page of a cell: the robot at home, sliders for its axes, the frames that the cell names.
"use strict";
(() => {
  const D = PP.data, $ = id => document.getElementById(id), angles = D.home.slice(), deg = 180 / Math.PI;
  let scene = null;
  try {
    scene = PPScene($("scene"), D);
    for (const f of D.frames) scene.frame(f.matrix, 0.25);
    scene.floor(8, [0, 0, 0], 0); scene.place(angles);
    const root = D.robot.T_world_robroot, base = D.robot.T_world_base, mid = [3, 7, 11].map(k => (root[k] + base[k]) / 2), reach = Math.max(D.reach, Math.hypot(...[3, 7, 11].map(k => root[k] - base[k])));
    scene.look([mid[0], mid[1], mid[2] + 0.12 * reach], 0.62 * reach, [-0.75, -1, 0.5]); scene.highlight(D.colliding);
  } catch (problem) { $("scene").textContent = "This browser shows no 3D (WebGL is off): " + problem.message; }
  D.robot.limits.forEach(([low, high], j) => {
    const label = document.createElement("label"), input = document.createElement("input"), out = document.createElement("span");
    input.type = "range"; input.min = low; input.max = high; input.step = "any"; input.value = angles[j] * deg; input.id = `axis${j + 1}`;
    const tell = () => { out.textContent = `A${j + 1} ${(angles[j] * deg).toFixed(1)} deg (${low.toFixed(0)} to ${high.toFixed(0)})`; };
    input.addEventListener("input", () => { angles[j] = input.value / deg; if (scene) scene.place(angles); tell(); });
    label.append(input, out); label.className = "axis"; $("axes").appendChild(label); tell();
  });
  window.ppPage = { state: () => ({ ready: true, angles: angles.slice(), colliding: D.colliding, tip: scene ? scene.tip() : null }) };
})();
