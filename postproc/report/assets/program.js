// The program page: robot, part and path in 3D, play through time, tags, charts.
"use strict";
(() => {
  const D = PP.data, U = PP.unpack, $ = id => document.getElementById(id);
  const q = U(D.q), time = U(D.time), pos = U(D.positions), tagOf = U(D.tag), rapid = U(D.rapid), lines = U(D.lines);
  const points = U(D.tag_positions), moveOf = U(D.move_of_tag), krlLine = U(D.krl_line), krlFile = U(D.krl_file), station = U(D.station), camLines = D.cam_lines ? U(D.cam_lines) : lines;
  const moves = time.length, nTags = D.names.length, columns = D.columns.map(c => ({ ...c, values: U(c.values) }));
  const byKey = new Map(columns.map(c => [c.key, c])), failed = i => D.failing[i] || "";
  let current = -1, clock = 0, playing = false, last = 0, shown = -1, colliding = [];

  // ---- scene ----------------------------------------------------------------------------------
  const nothing = { place() {}, stand() {}, inWorld: p => p, point() {}, highlight() {}, look() {}, pick() {}, tip: () => [0, 0, 0] };
  let scene = nothing, paint = () => {};
  function path() {  // segments of all moves, arcs in small pieces; owner: the move of each segment
    const ends = [], owner = [];
    if (D.trail) {  // sampled beforehand
      const t = U(D.trail), o = U(D.owner);
      for (let k = 1; k < o.length; k++) { ends.push(t[3 * k - 3], t[3 * k - 2], t[3 * k - 1], t[3 * k], t[3 * k + 1], t[3 * k + 2]); owner.push(o[k]); }
      return [ends, owner];
    }
    const aux = U(D.aux), arcOf = new Map(), circles = U(D.circles);
    circles.forEach((m, k) => arcOf.set(m, aux.subarray(3 * k, 3 * k + 3)));
    const at = m => new THREE.Vector3(pos[3 * m], pos[3 * m + 1], pos[3 * m + 2]);
    for (let m = 1; m < moves; m++) {
      const a = at(m - 1), b = at(m), via = arcOf.get(m), pieces = via ? arc(a, new THREE.Vector3(...via), b) : [a, b];
      for (let i = 1; i < pieces.length; i++) { ends.push(...pieces[i - 1].toArray(), ...pieces[i].toArray()); owner.push(m); }
    }
    return [ends, owner];
  }
  function arc(a, via, b) {
    const u = via.clone().sub(a), v = b.clone().sub(a), n = new THREE.Vector3().crossVectors(u, v), nn = n.lengthSq();
    if (nn < 1e-16) return [a, via, b];
    const c = new THREE.Vector3().crossVectors(n, u).multiplyScalar(v.lengthSq()).add(new THREE.Vector3().crossVectors(v, n).multiplyScalar(u.lengthSq())).divideScalar(2 * nn).add(a);
    n.normalize();
    const x = a.clone().sub(c), y = new THREE.Vector3().crossVectors(n, x), w = b.clone().sub(c);
    let sweep = Math.atan2(w.dot(y), w.dot(x)); if (sweep <= 0) sweep += 2 * Math.PI;
    const count = Math.max(2, Math.ceil(sweep / 0.2)), out = [];
    for (let i = 0; i <= count; i++) { const t = sweep * i / count; out.push(c.clone().addScaledVector(x, Math.cos(t)).addScaledVector(y, Math.sin(t))); }
    return out;
  }
  const small = Math.max(0.0015, Math.min(0.01, D.extent / 150)), room = Math.max(D.extent / 2, 0.3);
  const root = [D.robot.T_world_robroot[3], D.robot.T_world_robroot[7], D.robot.T_world_robroot[11]];
  function view(which) {
    const c0 = scene.inWorld(D.centre);
    if (which === "part") scene.look(c0, Math.max(D.extent / 2, 0.08) * 1.3);
    else if (which === "tag" && shown >= 0) scene.look(scene.inWorld(points.subarray(3 * shown, 3 * shown + 3)), Math.max(0.2, 0.15 * room));
    else {  // robot and part, from the side that faces neither
      const mid = [0, 1, 2].map(k => (root[k] + c0[k]) / 2), reach = Math.hypot(...[0, 1, 2].map(k => root[k] - c0[k]));
      const out = [c0[0] - root[0], c0[1] - root[1]], l = Math.hypot(...out) || 1;
      scene.look([mid[0], mid[1], mid[2] + 0.28 * reach], reach * 0.66 + room * 0.6, [out[1] / l - 0.45 * out[0] / l, -out[0] / l - 0.45 * out[1] / l, 0.45]);
    }
  }
  try {
    const s = PPScene($("scene"), D), [ends, owner] = path();
    const dots = s.marks(points, U(D.tag_axes), small), trail = s.segments(ends);
    s.floor(8, [0, 0, 0], 0);
    paint = column => {
      const [low, high] = PP.extent([column.values]), flip = column.worse === "low", span = high - low || 1;
      const tint = i => !Number.isFinite(column.values[i]) ? null : PP.ramp((flip ? high - column.values[i] : column.values[i] - low) / span);
      dots.paint(i => failed(i) ? [1, 0, 0] : tint(i) || [0.55, 0.55, 0.55]);
      trail.paint(k => { const m = owner[k]; return rapid[m] ? [0.80, 0.72, 0.55] : (tagOf[m] >= 0 && tint(tagOf[m])) || [0.3, 0.4, 0.5]; });
      const stops = [0, 1 / 3, 2 / 3, 1].map(t => PP.css(PP.ramp(flip ? 1 - t : t)));
      $("legend").style.background = `linear-gradient(90deg,${stops.join(",")})`;
      $("low").textContent = low <= high ? spell(low) : ""; $("high").textContent = low <= high ? spell(high) : "";
    };
    s.pick(dots.mesh, i => select(i));
    scene = s; view("cell");
  } catch (problem) { $("scene").textContent = "This browser shows no 3D (WebGL is off): " + problem.message; }

  // ---- time -----------------------------------------------------------------------------------
  const total = moves ? time[moves - 1] : 0, slider = $("slider"), angles = new Float64Array(6);
  function seek(t, follow = true) {
    clock = Math.max(0, Math.min(total, t));
    let low = 0, high = moves - 1;
    while (low < high) { const mid = (low + high) >> 1; if (time[mid] < clock) low = mid + 1; else high = mid; }
    current = moves ? low : -1;
    const before = Math.max(0, low - 1), span = time[low] - time[before], f = low === before || span <= 0 ? 1 : (clock - time[before]) / span;
    for (let j = 0; j < 6 && moves; j++) angles[j] = q[6 * before + j] + f * (q[6 * low + j] - q[6 * before + j]);
    if (moves) { hit([]); if (station.length) scene.stand(...D.stations[station[low]]); scene.place(angles); }
    slider.value = total ? 1000 * clock / total : 0; $("clock").textContent = `${clock.toFixed(1)} s of ${total.toFixed(1)} s`;
    if (cursorQ) cursorQ.move(clock); if (cursorV) cursorV.move(clock);
    if (moves && follow) showTag(tagOf[current]);
    markLine();
  }
  function hit(names) { if (names.join() !== colliding.join()) { colliding = names; scene.highlight(names); } }
  slider.addEventListener("input", () => seek(total * slider.value / 1000));
  $("play").addEventListener("click", () => { playing = !playing; $("play").textContent = playing ? "pause" : "play"; last = performance.now(); if (clock >= total) clock = 0; if (playing) requestAnimationFrame(step); });
  function step(now) { if (!playing) return; seek(clock + Math.max(0, now - last) / 1000 * +$("speed").value); last = now; if (clock >= total) { playing = false; $("play").textContent = "play"; } else requestAnimationFrame(step); }

  // ---- the list ----------------------------------------------------------------------------------
  const spell = PPSpell;
  const fields = [[D.what || "tag", i => D.names[i]], ["line", i => lines[i]], ...columns.map(PPField)];
  if (Object.keys(D.failing).length) fields.push(["finding", i => failed(i) || null]);
  const list = PPList({ n: nTags, what: D.what || "tag", fields, failed, select: i => select(i) });

  // ---- one tag: its lines, its stiffness over the turn -------------------------------------------
  const cam = new Map(), krl = []; let ready = false, firstMove = new Int32Array(nTags).fill(-1), lastMove = new Int32Array(nTags).fill(-1);
  for (let m = 0; m < moves; m++) { const t = tagOf[m]; if (t >= 0) { if (firstMove[t] < 0) firstMove[t] = m; lastMove[t] = m; } }
  function source(host, texts) {  // texts: [[number, text, class, move]]
    host.replaceChildren(...texts.map(([n, s, name, m]) => {
      const div = document.createElement("div"); div.textContent = `${n}  ${s}`; div.className = name; if (m !== undefined) div.dataset.move = m; return div;
    }));
  }
  function showLines(i) {
    if (!ready) return;
    const at = camLines[i], near = [];
    for (let n = at - 2; at > 0 && n <= at + 2; n++) if (cam.has(n)) near.push([n, cam.get(n), n === at ? "here" : ""]);
    source($("cam"), near);
    const rows = [];
    if (krlLine.length && firstMove[i] >= 0) {
      const from = firstMove[i], file = krlFile[from], mine = new Map();
      for (let m = from; m <= lastMove[i]; m++) if (krlFile[m] === file && tagOf[m] === i) mine.set(krlLine[m], m);
      let low = Math.min(...mine.keys()), high = Math.max(...mine.keys());
      if (mine.size === 1) { low = Math.max(1, low - 3); high = Math.min(krl[file].length, high + 3); }
      for (let n = low; n <= high && rows.length < 60; n++) rows.push([n, krl[file][n - 1], mine.has(n) ? "here" : "", mine.get(n)]);
      $("krl_file").textContent = D.krl_files[file];
    } else $("krl_file").textContent = krlLine.length ? "no motion for this tag" : "no program text";
    source($("krl"), rows); markLine();
  }
  function markLine() { for (const div of $("krl").children) div.classList.toggle("now", +div.dataset.move === current); }
  function showTag(i) {
    if (i === shown || i < 0) return;
    shown = i;
    list.mark(i);
    const pose = D.poses[i];
    $("which").textContent = `${D.what || "tag"} ${D.names[i]}, line ${lines[i]}` + (failed(i) ? `: ${failed(i)}` : "") + (pose && pose.note ? `. Shown: ${pose.note}.` : "");
    $("which").className = failed(i) ? "bad" : "";
    scene.point(points.subarray(3 * i, 3 * i + 3), 1.6 * small);
    showLines(i); showSpin(i);
  }
  const map = D.spin_map ? U(D.spin_map.level) : null, hits = D.spin_map && D.spin_map.hit ? U(D.spin_map.hit) : null;
  function spinCurve(i) { const s = D.spin_map, n = s.spins.length; return Array.from(map.subarray(i * n, (i + 1) * n), v => v ? s.low + (v - 1) * s.step : NaN); }
  function showSpin(i) {
    if (!$("spin")) return;
    if (!map) { $("spin").textContent = "no joint stiffness, or too many tags"; return; }
    const turn = byKey.get("spin") ? byKey.get("spin").values[i] : NaN, k = byKey.get("stiffness").values[i];
    const marks = Number.isFinite(turn) ? [{ x: turn, y: k, text: `chosen ${turn.toFixed(0)} deg`, colour: "#c62828" }] : [];
    const y = spinCurve(i), n = y.length, x = D.spin_map.spins, series = [{ name: D.objective, x, y }];
    if (hits) {
      series[0] = { name: "collides", x, y, colour: "#98a4ae", dash: "3 3" };
      series.push({ name: `free, ${D.objective}`, x, y: y.map((v, k) => hits[i * n + k] ? NaN : v), colour: PP.colours[0], dots: true });
    }
    PP.lineChart($("spin"), { series, xLabel: "turn about the tool axis [deg]", yLabel: "N/mm", marks, height: 230 });
  }
  function select(i) {
    const m = moveOf[i] >= 0 ? moveOf[i] : lastMove[i], pose = D.poses[i];
    if (pose) { seek(m >= 0 ? time[m] : clock, false); for (let j = 0; j < 6; j++) angles[j] = pose.q[j]; scene.place(angles); showTag(i); hit(pose.pair); }
    else if (m >= 0) { seek(time[m], false); showTag(i); }
    else { seek(time[nearest(i)] || 0, false); showTag(i); }
    list.reveal(i); if ($("view").value === "tag") view("tag");
  }
  function nearest(i) {  // the move of the nearest tag that can be run
    let best = -1, least = Infinity;
    for (let k = 0; k < nTags; k++) if (moveOf[k] >= 0) {
      const d = Math.hypot(points[3 * k] - points[3 * i], points[3 * k + 1] - points[3 * i + 1], points[3 * k + 2] - points[3 * i + 2]);
      if (d < least) { least = d; best = moveOf[k]; }
    }
    return best;
  }
  document.querySelectorAll("#findings tr[data-goto]").forEach(tr => tr.addEventListener("click", () => select(+tr.dataset.goto)));

  // ---- charts ---------------------------------------------------------------------------------
  const names = ["A1", "A2", "A3", "A4", "A5", "A6"], deg = 180 / Math.PI, curves = [0, 1, 2, 3, 4, 5].map(j => {
    const angle = new Float64Array(moves), speed = new Float64Array(moves);
    for (let i = 0; i < moves; i++) {
      const dt = i ? time[i] - time[i - 1] : 0;
      angle[i] = q[6 * i + j] * deg; speed[i] = dt > 1e-4 ? Math.abs(q[6 * i + j] - q[6 * i - 6 + j]) * deg / dt / D.robot.speeds[j] * 100 : 0;
    }
    return { angle, speed };
  });
  let cursorQ = null, cursorV = null;
  function charts() {
    const pick = $("axis").value, chosen = pick === "all" ? [0, 1, 2, 3, 4, 5] : [+pick];
    const levels = chosen.length === 1 ? D.robot.limits[chosen[0]].map(y => ({ y })) : [];
    const series = what => chosen.map(j => ({ name: names[j], x: time, y: curves[j][what], colour: PP.colours[j] }));
    cursorQ = PP.lineChart($("angles"), { series: series("angle"), xLabel: "time [s]", yLabel: "deg", levels, onPick: seek });
    cursorV = PP.lineChart($("speeds"), { series: series("speed"), xLabel: "time [s]", yLabel: "% of axis limit", onPick: seek });
  }
  $("axis").addEventListener("change", () => { charts(); seek(clock, false); });
  $("colour").addEventListener("change", () => { const c = byKey.get($("colour").value); if (c) paint(c); });
  $("view").addEventListener("change", () => view($("view").value));

  window.ppPage = { seek, select, spinCurve, state: () => ({
    ready, clock, current, shown, moves, tags: nTags, angles: Array.from(angles), colliding, playing,
    rows: list.visible().length, first: list.visible().length ? list.visible()[0] : -1, colour: $("colour").value, tip: scene.tip(),
    line: current >= 0 && krlLine.length ? krlLine[current] : null,
  }) };
  if (moves) charts();
  if ($("colour").options.length) $("colour").dispatchEvent(new Event("change"));
  seek(0);
  const bad = Object.keys(D.failing).map(Number).sort((a, b) => a - b);
  if (bad.length) select(bad[0]); else if (nTags) select(0);
  if (!moves) { slider.disabled = true; $("play").disabled = true; for (const id of ["angles", "speeds"]) $(id).textContent = "no motion was planned"; }
  Promise.all([PP.text(D.cam), ...D.krl.map(PP.text)]).then(([camText, ...programs]) => {
    for (const l of camText.split("\n")) { const t = l.indexOf("\t"); cam.set(+l.slice(0, t), l.slice(t + 1)); }
    for (const p of programs) krl.push(p.split("\n"));
    ready = true; if (shown >= 0) showLines(shown);
  });
})();
