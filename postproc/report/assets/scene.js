// The 3D view of all pages: robot, solids, path, marks. One place for cameras, lights, kinematics.
"use strict";
function PPScene(host, D) {
  const U = PP.unpack, V = (...a) => new THREE.Vector3(...a);
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
  host.appendChild(renderer.domElement);
  const scene = new THREE.Scene(); scene.background = new THREE.Color(0xeef2f5);
  const camera = new THREE.PerspectiveCamera(40, 1, 0.005, 200); camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a949e, 2.2));
  const sun = new THREE.DirectionalLight(0xffffff, 1.6); sun.position.set(-3, -4, 6); scene.add(sun);
  let asked = false;
  function draw() { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; renderer.render(scene, camera); }); } }
  controls.addEventListener("change", draw);

  // ---- solids and robot ---------------------------------------------------------------------
  const looks = { link: 0xe8792b, tool: 0x6c7a89, cutting: 0x37474f, workpiece: 0x9fb8cf, obstacle: 0xb0a18f };
  const solids = new Map(), carried = [], part = new THREE.Group();
  part.matrixAutoUpdate = false; scene.add(part);
  // where robot and workpiece stand (rows of 4 x 4); external axes move them
  function stand(robroot, base) { world.set(...robroot); part.matrix.set(...base); part.updateMatrixWorld(true); }
  for (const b of D.bodies || []) {
    const g = new THREE.BufferGeometry();
    g.setAttribute("position", new THREE.BufferAttribute(U(b.vertices), 3));
    g.setIndex(new THREE.BufferAttribute(new Uint32Array(U(b.faces)), 1));
    const flat = g.toNonIndexed(); flat.computeVertexNormals();
    const clear = b.kind === "workpiece";
    const mesh = new THREE.Mesh(flat, new THREE.MeshLambertMaterial({ color: looks[b.kind] || 0x999999, side: THREE.DoubleSide, transparent: clear, opacity: clear ? 0.85 : 1 }));
    mesh.matrixAutoUpdate = false; (clear ? part : scene).add(mesh);
    if (!solids.has(b.name)) solids.set(b.name, []);
    solids.get(b.name).push([mesh, looks[b.kind] || 0x999999]);
    if (b.link >= 0) carried.push([mesh, b.link]);
  }
  function highlight(names) {
    for (const [name, list] of solids) for (const [mesh, usual] of list) mesh.material.color.set(names.includes(name) ? 0xd32f2f : usual);
    draw();
  }
  // forward kinematics as a product of turns about the joint axes of the zero pose
  const R = D.robot, M4 = () => new THREE.Matrix4();
  const zero = R ? R.link_frames.map(f => M4().set(...f)) : [], frames = zero.map(M4), chain = M4(), T = M4(), turn = M4(), back = M4();
  const world = M4(); if (R) stand(R.T_world_robroot, R.T_world_base);
  const axes = R ? R.joint_axes.map(a => V(...a)) : [];
  function place(angles) {
    if (!R) return;
    chain.copy(world); frames[0].copy(chain).multiply(zero[0]);
    for (let j = 0; j < 6; j++) {
      const p = R.joint_points[j];
      turn.makeRotationAxis(axes[j], angles[j]);
      T.makeTranslation(p[0], p[1], p[2]).multiply(turn).multiply(back.makeTranslation(-p[0], -p[1], -p[2]));
      chain.multiply(T); frames[j + 1].copy(chain).multiply(zero[j + 1]);
    }
    for (const [mesh, link] of carried) mesh.matrix.copy(frames[link]);
    draw();
  }

  // ---- path, marks, arrows --------------------------------------------------------------------
  // ends: flat array of segments (6 numbers each)
  function segments(ends) {
    const g = new THREE.BufferGeometry(), tint = new Float32Array(ends.length).fill(0.4);
    g.setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
    g.setAttribute("color", new THREE.BufferAttribute(tint, 3));
    const lines = new THREE.LineSegments(g, new THREE.LineBasicMaterial({ vertexColors: true }));
    lines.frustumCulled = false; part.add(lines);
    const k = new THREE.Color();
    return { lines, paint(colourOf) {
      for (let i = 0; i < tint.length / 6; i++) { k.setRGB(...colourOf(i), "srgb"); tint.set([k.r, k.g, k.b, k.r, k.g, k.b], 6 * i); }
      g.attributes.color.needsUpdate = true; draw();
    } };
  }
  // cones whose tips stand at points and come from along the axes; balls without axes
  function marks(points, axesOf, size) {
    const n = points.length / 3, many = n > 3000, fine = many ? 3 : 8;
    const shape = axesOf ? new THREE.ConeGeometry(size, 3 * size, fine, 1, many) : new THREE.SphereGeometry(size, many ? 4 : 10, many ? 3 : 8);
    const mesh = new THREE.InstancedMesh(shape, new THREE.MeshLambertMaterial({ color: 0xffffff }), Math.max(1, n));
    mesh.count = n; mesh.frustumCulled = false;
    const m = M4(), up = V(0, 1, 0), a = V(), side = V(), third = V(), k = new THREE.Color(0x888888);
    for (let i = 0; i < n; i++) {
      m.identity();
      if (axesOf) {
        a.set(-axesOf[3 * i], -axesOf[3 * i + 1], -axesOf[3 * i + 2]).normalize();
        side.crossVectors(up, a); if (side.length() < 1e-6) side.set(1, 0, 0); else side.normalize();
        third.crossVectors(side, a); m.makeBasis(side, a, third);
        m.setPosition(points[3 * i] - a.x * 1.5 * size, points[3 * i + 1] - a.y * 1.5 * size, points[3 * i + 2] - a.z * 1.5 * size);
      } else m.setPosition(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
      mesh.setMatrixAt(i, m); mesh.setColorAt(i, k);
    }
    part.add(mesh);
    return { mesh, paint(colourOf) {
      for (let i = 0; i < n; i++) { k.setRGB(...colourOf(i), "srgb"); mesh.setColorAt(i, k); }
      if (n) mesh.instanceColor.needsUpdate = true; draw();
    } };
  }
  const ring = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), new THREE.MeshLambertMaterial({ color: 0xe91e63, transparent: true, opacity: 0.45 }));
  ring.visible = false; part.add(ring);
  function point(p, size) { ring.visible = true; ring.position.set(...p); ring.scale.setScalar(size); draw(); }
  function pick(target, done) {
    const ray = new THREE.Raycaster(), mouse = new THREE.Vector2(); let down = null;
    renderer.domElement.addEventListener("pointerdown", v => { down = [v.clientX, v.clientY]; });
    renderer.domElement.addEventListener("click", v => {
      if (down && Math.hypot(v.clientX - down[0], v.clientY - down[1]) > 4) return;
      const box = renderer.domElement.getBoundingClientRect();
      mouse.set((v.clientX - box.left) / box.width * 2 - 1, 1 - (v.clientY - box.top) / box.height * 2);
      ray.setFromCamera(mouse, camera);
      const hit = ray.intersectObject(target)[0]; if (hit) done(hit.instanceId);
    });
  }

  // ---- camera ---------------------------------------------------------------------------------
  function floor(size, centre, z) {
    const grid = new THREE.GridHelper(size, 16, 0xb8c2cc, 0xd5dce2);
    grid.rotation.x = Math.PI / 2; grid.position.set(centre[0], centre[1], z); scene.add(grid);
  }
  // the axes of a frame (row-wise 4 x 4): x red, y green, z blue
  function frame(rows, size) {
    const axes = new THREE.AxesHelper(size); axes.matrixAutoUpdate = false; axes.matrix.set(...rows); scene.add(axes);
  }
  // looks at a sphere from a direction; the direction stays as it is when none is given
  function look(centre, radius, from) {
    const way = from ? V(...from).normalize() : camera.position.clone().sub(controls.target).normalize();
    const far = radius / Math.sin(camera.fov * Math.PI / 360) / Math.min(1, camera.aspect);
    controls.target.set(...centre); camera.position.copy(controls.target).addScaledVector(way, far);
    controls.update(); draw();
  }
  function resize() {
    const w = host.clientWidth, h = host.clientHeight;
    renderer.setSize(w, h, false); renderer.domElement.style.height = h + "px"; camera.aspect = w / h; camera.updateProjectionMatrix();
    renderer.render(scene, camera);
  }
  window.addEventListener("resize", resize); window.addEventListener("beforeprint", () => renderer.render(scene, camera));
  resize();
  const tip = () => { const e = frames[6] ? frames[6].elements : [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]; return [e[12], e[13], e[14]]; };
  const inWorld = p => V(...p).applyMatrix4(part.matrix).toArray();
  return { place, stand, inWorld, segments, marks, point, pick, highlight, look, floor, frame, draw, tip, canvas: renderer.domElement };
}
