// The program page: robot, part and path in 3D, play through time, tags, charts.
"use strict";
(() => {
  const D = PP.data, U = PP.unpack, $ = id => document.getElementById(id);
  const q = U(D.q), time = U(D.time), pos = U(D.positions), tagOf = U(D.tag), rapid = U(D.rapid);
  const moves = time.length, nTags = D.tags.length;
  let current = 0, clock = 0, playing = false, last = 0;

  // ---- scene ----------------------------------------------------------------------------------
  const host = $("scene");
  let draw = () => {}, place = () => {}, colour = () => {}, pickTag = null;
  function build() {
    const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    host.appendChild(renderer.domElement);
    const scene = new THREE.Scene(); scene.background = new THREE.Color(0xeef2f5);
    const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 100); camera.up.set(0, 0, 1);
    const controls = new THREE.OrbitControls(camera, renderer.domElement);
    scene.add(new THREE.HemisphereLight(0xffffff, 0x8a949e, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6); sun.position.set(-3, -4, 6); scene.add(sun);
    const grid = new THREE.GridHelper(8, 16, 0xb8c2cc, 0xd5dce2); grid.rotation.x = Math.PI / 2; scene.add(grid);
    const looks = { link: 0xe8792b, tool: 0x6c7a89, cutting: 0x37474f, workpiece: 0x9fb8cf, obstacle: 0xb0a18f };
    const carried = [];
    for (const b of D.bodies) {
      const g = new THREE.BufferGeometry();
      g.setAttribute("position", new THREE.BufferAttribute(U(b.vertices), 3));
      g.setIndex(new THREE.BufferAttribute(new Uint32Array(U(b.faces)), 1));
      const flat = g.toNonIndexed(); flat.computeVertexNormals();
      const hit = D.colliding.includes(b.name);
      const mesh = new THREE.Mesh(flat, new THREE.MeshLambertMaterial({ color: hit ? 0xd32f2f : looks[b.kind] || 0x999999, side: THREE.DoubleSide, transparent: b.kind === "workpiece", opacity: b.kind === "workpiece" ? 0.85 : 1 }));
      mesh.matrixAutoUpdate = false; mesh.name = b.name; scene.add(mesh);
      if (b.link >= 0) carried.push([mesh, b.link]);
    }
    const tagPos = U(D.tag_positions), tagAxis = U(D.tag_axes);
    const size = Math.max(0.002, Math.min(0.01, D.extent / 150));
    const dots = new THREE.InstancedMesh(new THREE.ConeGeometry(size, 3 * size, 8), new THREE.MeshLambertMaterial({ color: 0xffffff }), Math.max(1, nTags));
    const up = new THREE.Vector3(0, 1, 0), axis = new THREE.Vector3(), turn = new THREE.Matrix4(), M = new THREE.Matrix4();
    for (let i = 0; i < nTags; i++) {
      axis.set(-tagAxis[3 * i], -tagAxis[3 * i + 1], -tagAxis[3 * i + 2]).normalize();
      const side = new THREE.Vector3().crossVectors(up, axis);
      if (side.length() < 1e-6) side.set(1, 0, 0); else side.normalize();
      const third = new THREE.Vector3().crossVectors(side, axis);
      turn.makeBasis(side, axis, third);
      M.copy(turn).setPosition(tagPos[3 * i] - axis.x * 1.5 * size, tagPos[3 * i + 1] - axis.y * 1.5 * size, tagPos[3 * i + 2] - axis.z * 1.5 * size);
      dots.setMatrixAt(i, M); dots.setColorAt(i, new THREE.Color(0x888888));
    }
    if (nTags) scene.add(dots);
    const ends = [];
    for (let i = 1; i < moves; i++) ends.push(pos[3 * i - 3], pos[3 * i - 2], pos[3 * i - 1], pos[3 * i], pos[3 * i + 1], pos[3 * i + 2]);
    const lines = new THREE.BufferGeometry(); lines.setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
    const tint = []; for (let i = 1; i < moves; i++) { const c = rapid[i] ? [0.75, 0.55, 0.2] : [0.1, 0.35, 0.6]; tint.push(...c, ...c); }
    lines.setAttribute("color", new THREE.Float32BufferAttribute(tint, 3));
    scene.add(new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ vertexColors: true })));
    const c = D.centre, e = Math.max(D.extent, 0.6);
    controls.target.set(c[0] * 0.75, c[1], c[2]); camera.position.set(c[0] - 1.2 * e - 1.2, c[1] - 1.6 * e - 2.2, c[2] + e + 0.9);
    controls.update();
    draw = () => renderer.render(scene, camera);
    controls.addEventListener("change", draw);
    const resize = () => { const w = host.clientWidth, h = host.clientHeight; renderer.setSize(w, h, false); renderer.domElement.style.height = h + "px"; camera.aspect = w / h; camera.updateProjectionMatrix(); draw(); };
    window.addEventListener("resize", resize);
    // forward kinematics as a product of turns about the joint axes of the zero pose
    const zero = D.link_frames.map(f => new THREE.Matrix4().set(...f)), R = new THREE.Matrix4(), chain = new THREE.Matrix4(), T = new THREE.Matrix4();
    const world = new THREE.Matrix4().set(...D.T_world_robroot); const frames = zero.map(() => new THREE.Matrix4());
    place = angles => {
      chain.copy(world); frames[0].copy(chain).multiply(zero[0]);
      for (let j = 0; j < 6; j++) {
        const p = D.joint_points[j], a = new THREE.Vector3(...D.joint_axes[j]);
        R.makeRotationAxis(a, angles[j]);
        T.makeTranslation(p[0], p[1], p[2]).multiply(R).multiply(new THREE.Matrix4().makeTranslation(-p[0], -p[1], -p[2]));
        chain.multiply(T); frames[j + 1].copy(chain).multiply(zero[j + 1]);
      }
      for (const [mesh, link] of carried) mesh.matrix.copy(frames[link]);
      draw();
    };
    for (const m of scene.children) if (m.isMesh && m.name && !carried.some(([k]) => k === m)) m.matrix.copy(new THREE.Matrix4());
    colour = values => {
      const good = values.filter(Number.isFinite), k = new THREE.Color();
      const [low, high] = good.reduce((e, v) => [Math.min(e[0], v), Math.max(e[1], v)], [Infinity, -Infinity]);
      for (let i = 0; i < nTags; i++) {
        if (D.tags[i].failed) k.set(0xff0000); else if (!Number.isFinite(values[i])) k.set(0x888888); else k.setRGB(...PP.ramp((values[i] - low) / (high - low || 1)), "srgb");
        dots.setColorAt(i, k);
      }
      if (dots.instanceColor) dots.instanceColor.needsUpdate = true;
      $("low").textContent = good.length ? low.toPrecision(4) : ""; $("high").textContent = good.length ? high.toPrecision(4) : ""; draw();
    };
    const ray = new THREE.Raycaster(), mouse = new THREE.Vector2(); let down = null;
    renderer.domElement.addEventListener("pointerdown", v => { down = [v.clientX, v.clientY]; });
    renderer.domElement.addEventListener("click", v => {
      if (down && Math.hypot(v.clientX - down[0], v.clientY - down[1]) > 4) return;
      const box = renderer.domElement.getBoundingClientRect();
      mouse.set((v.clientX - box.left) / box.width * 2 - 1, 1 - (v.clientY - box.top) / box.height * 2);
      ray.setFromCamera(mouse, camera); const hit = ray.intersectObject(dots)[0];
      if (hit && pickTag) pickTag(hit.instanceId);
    });
    resize();
  }
  try { build(); } catch (problem) { host.textContent = "This browser shows no 3D (WebGL is off): " + problem.message; }

  // ---- time -----------------------------------------------------------------------------------
  const total = moves ? time[moves - 1] : 0, slider = $("slider");
  const angles = new Float64Array(6);
  function seek(t) {
    clock = Math.max(0, Math.min(total, t));
    let low = 0, high = moves - 1;
    while (low < high) { const mid = (low + high) >> 1; if (time[mid] < clock) low = mid + 1; else high = mid; }
    current = low;
    const before = Math.max(0, low - 1), span = time[low] - time[before], f = low === before || span <= 0 ? 1 : (clock - time[before]) / span;
    for (let j = 0; j < 6; j++) angles[j] = q[6 * before + j] + f * (q[6 * low + j] - q[6 * before + j]);
    if (moves) place(angles);
    slider.value = total ? 1000 * clock / total : 0; $("clock").textContent = `${clock.toFixed(1)} s of ${total.toFixed(1)} s`;
    if (cursorQ) cursorQ.move(clock); if (cursorV) cursorV.move(clock);
    if (moves) showTag(tagOf[current]);
  }
  slider.addEventListener("input", () => seek(total * slider.value / 1000));
  $("play").addEventListener("click", () => { playing = !playing; $("play").textContent = playing ? "pause" : "play"; last = performance.now(); if (clock >= total) clock = 0; if (playing) requestAnimationFrame(step); });
  function step(now) { if (!playing) return; seek(clock + (now - last) / 1000 * +$("speed").value); last = now; if (clock >= total) { playing = false; $("play").textContent = "play"; } else requestAnimationFrame(step); }

  // ---- tags -----------------------------------------------------------------------------------
  const columns = D.columns, body = $("tags").tBodies[0], lastMove = new Int32Array(nTags).fill(-1);
  for (let i = 0; i < moves; i++) if (tagOf[i] >= 0) lastMove[tagOf[i]] = i;
  const firstCut = new Int32Array(nTags).fill(-1);
  for (let i = moves - 1; i >= 0; i--) if (tagOf[i] >= 0 && !rapid[i]) firstCut[tagOf[i]] = i;
  let order = D.tags.map((_, i) => i), sortBy = -1, ascending = true, shown = -1, limit = 500;
  const rows = new Map();
  function fill() {
    body.textContent = ""; rows.clear();
    const only = $("failing").checked, list = order.filter(i => !only || D.tags[i].failed);
    for (const i of list.slice(0, limit)) {
      const tr = document.createElement("tr"); tr.dataset.tag = i; if (D.tags[i].failed) tr.className = "failing";
      for (const v of D.tags[i].row) { const td = document.createElement("td"); td.textContent = v === null ? "" : v; tr.appendChild(td); }
      tr.addEventListener("click", () => select(i)); body.appendChild(tr); rows.set(i, tr);
    }
    $("more").textContent = list.length > limit ? `${limit} of ${list.length} shown` : `${list.length} tags`;
    if (shown >= 0 && rows.has(shown)) rows.get(shown).classList.add("selected");
  }
  columns.forEach((name, k) => {
    const th = document.createElement("th"); th.textContent = name; th.className = "sortable";
    th.addEventListener("click", () => {
      ascending = sortBy === k ? !ascending : true; sortBy = k;
      const key = i => D.tags[i].row[k], sign = ascending ? 1 : -1;
      order.sort((a, b) => { const x = key(a), y = key(b); return x === y ? a - b : (x === null ? 1 : y === null ? -1 : (x < y ? -1 : 1) * sign); });
      fill();
    });
    $("tags").tHead.rows[0].appendChild(th);
  });
  $("failing").addEventListener("change", fill);
  function showTag(i) {
    if (i === shown || i < 0) return;
    if (rows.has(shown)) rows.get(shown).classList.remove("selected");
    shown = i; if (rows.has(i)) rows.get(i).classList.add("selected");
    const t = D.tags[i];
    $("cam").textContent = t.cam; $("krl").textContent = t.krl.join("\n"); $("which").textContent = `tag ${t.name}` + (t.failed ? `: ${t.failed}` : "");
    if (D.spin_map) {
      const map = spinMap, n = D.spin_map.spins.length, y = map.subarray(i * n, (i + 1) * n);
      PP.lineChart($("spin"), { series: [{ name: D.spin_map.label, x: D.spin_map.spins, y }], xLabel: "turn about the tool axis [deg]", yLabel: "N/mm", marks: t.spin === null ? [] : [{ x: t.spin }], height: 200 });
    }
  }
  function select(i) { const m = firstCut[i] >= 0 ? firstCut[i] : lastMove[i]; if (m >= 0) seek(time[m]); showTag(i); if (rows.has(i)) reveal(rows.get(i)); }
  function reveal(row) {  // within the list only: the page itself must not jump
    const list = row.closest(".scroll"), top = row.offsetTop - list.clientHeight / 2;
    if (row.offsetTop < list.scrollTop || row.offsetTop > list.scrollTop + list.clientHeight - 30) list.scrollTop = top;
  }
  pickTag = select;
  const spinMap = D.spin_map ? U(D.spin_map.values) : null;

  // ---- charts ---------------------------------------------------------------------------------
  const names = ["A1", "A2", "A3", "A4", "A5", "A6"], t = Array.from(time), deg = 180 / Math.PI;
  const joint = j => { const y = new Float64Array(moves); for (let i = 0; i < moves; i++) y[i] = q[6 * i + j] * deg; return y; };
  let cursorQ = null, cursorV = null;
  function charts() {
    const pick = $("axis").value, chosen = pick === "all" ? [0, 1, 2, 3, 4, 5] : [+pick];
    const levels = chosen.length === 1 ? D.limits[chosen[0]].map(y => ({ y })) : [];
    cursorQ = PP.lineChart($("angles"), { series: chosen.map(j => ({ name: names[j], x: t, y: joint(j), colour: PP.colours[j] })), xLabel: "time [s]", yLabel: "deg", levels, onPick: seek });
    const speed = chosen.map(j => { const y = new Float64Array(moves); for (let i = 1; i < moves; i++) { const dt = time[i] - time[i - 1]; y[i] = dt > 1e-6 ? Math.abs(q[6 * i + j] - q[6 * i - 6 + j]) * deg / dt / D.speeds[j] * 100 : NaN; } return { name: names[j], x: t, y, colour: PP.colours[j] }; });
    cursorV = PP.lineChart($("speeds"), { series: speed, xLabel: "time [s]", yLabel: "% of axis limit", onPick: seek });
  }
  $("axis").addEventListener("change", () => { charts(); seek(clock); });
  $("colour").addEventListener("change", () => colour(D.tags.map(g => { const v = g.values[$("colour").value]; return v === null ? NaN : v; })));
  window.ppPage = { seek, select, state: () => ({ clock, current, shown, angles: Array.from(angles), moves, rows: body.rows.length, first: body.rows.length ? +body.rows[0].dataset.tag : -1 }) };
  fill(); if (moves) charts();
  if ($("colour").options.length) $("colour").dispatchEvent(new Event("change"));
  const failing = D.tags.findIndex(g => g.failed);
  seek(0); if (failing >= 0) select(failing); else if (nTags) select(0);
})();
