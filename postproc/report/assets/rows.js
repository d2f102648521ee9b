// Pages of rows in space: points with values, arrows, and the robot in the posture of a row.
"use strict";
(() => {
  const D = PP.data, U = PP.unpack, $ = id => document.getElementById(id), R = D.rows;
  const points = U(R.points), n = R.names.length, q = R.q ? U(R.q) : null, vectors = R.vectors ? U(R.vectors) : null;
  const columns = R.columns.map(c => ({ ...c, values: U(c.values) })), byKey = new Map(columns.map(c => [c.key, c]));
  let shown = -1, scene = null, paint = () => {}, stretch = () => {}, angles = null;
  const small = Math.max(0.001, Math.min(0.02, R.extent / 120)), room = Math.max(R.extent / 2, 0.05);
  try {
    scene = PPScene($("scene"), D);
    const dots = scene.marks(points, null, small);
    let arrows = null;
    if (vectors) {
      stretch = factor => {
        if (arrows) { arrows.lines.removeFromParent(); arrows.lines.geometry.dispose(); }
        const ends = new Float32Array(6 * n);
        for (let i = 0; i < n; i++) for (let k = 0; k < 3; k++) { ends[6 * i + k] = points[3 * i + k]; ends[6 * i + 3 + k] = points[3 * i + k] + factor * vectors[3 * i + k]; }
        arrows = scene.segments(ends); arrows.paint(() => [0.35, 0.1, 0.55]);
      };
    }
    paint = c => {
      const [low, high] = PP.extent([c.values]), flip = c.worse === "low", span = high - low || 1;
      dots.paint(i => Number.isFinite(c.values[i]) ? PP.ramp((flip ? high - c.values[i] : c.values[i] - low) / span) : [0.6, 0.6, 0.6]);
      $("legend").style.background = `linear-gradient(90deg,${[0, 1 / 3, 2 / 3, 1].map(t => PP.css(PP.ramp(flip ? 1 - t : t))).join(",")})`;
      $("low").textContent = low <= high ? PPSpell(low) : ""; $("high").textContent = low <= high ? PPSpell(high) : "";
    };
    scene.pick(dots.mesh, i => select(i));
    const c = scene.inWorld(R.centre);
    if (D.robot) {
      const root = [D.robot.T_world_robroot[3], D.robot.T_world_robroot[7], D.robot.T_world_robroot[11]];
      const reach = Math.hypot(...[0, 1, 2].map(k => root[k] - c[k])), out = [c[0] - root[0], c[1] - root[1]], l = Math.hypot(...out) || 1;
      scene.floor(8, [0, 0, 0], 0);
      scene.look([0, 1, 2].map(k => (root[k] + c[k]) / 2 + (k === 2 ? 0.28 * reach : 0)), reach * 0.66 + room * 0.6, [out[1] / l - 0.45 * out[0] / l, -out[0] / l - 0.45 * out[1] / l, 0.45]);
    } else { scene.look(c, room * 1.3, [-0.5, -0.8, 0.5]); }
  } catch (problem) { $("scene").textContent = "This browser shows no 3D (WebGL is off): " + problem.message; }
  const fields = [[R.what, i => R.names[i]], ...columns.map(PPField), ...(R.notes ? [["finding", i => R.notes[i] || null]] : [])];
  const list = PPList({ n, what: R.what, fields, failed: () => "", select: i => select(i) });
  function select(i) {
    shown = i; list.mark(i); list.reveal(i);
    if (q) { angles = Array.from(q.subarray(6 * i, 6 * i + 6)); if (scene) scene.place(angles); }
    if (scene) scene.point(points.subarray(3 * i, 3 * i + 3), 1.8 * small);
  }
  $("colour").addEventListener("change", () => { const c = byKey.get($("colour").value); if (c) paint(c); });
  if ($("stretch")) {
    const update = () => { const f = 10 ** +$("stretch").value; stretch(f); $("factor").textContent = `${PPSpell(f)} x`; };
    $("stretch").addEventListener("input", update); update();
  }
  $("colour").dispatchEvent(new Event("change"));
  if (n) select(0);
  window.ppPage = { select, state: () => ({ ready: true, shown, angles, rows: list.visible().length, first: n ? list.visible()[0] : -1, colour: $("colour").value, tip: scene ? scene.tip() : null }) };
})();
