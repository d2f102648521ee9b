// The 3D view of all pages: robot, solids, path, marks. One place for camera, lights, drawing.
import {
  AxesHelper,
  Color,
  DirectionalLight,
  GridHelper,
  Group,
  HemisphereLight,
  Mesh,
  MeshLambertMaterial,
  OrbitControls,
  PerspectiveCamera,
  Raycaster,
  Scene,
  SphereGeometry,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "./three.bundle.js";
import { Arm } from "./arm.js";
import { lineSegments, MANY, pointMarks } from "./marks.js";
import { Solids } from "./solids.js";
import { Tips } from "./tips.js";
import { openSide, viewOf } from "./views.js";

const CLICK = 4; // px that the mouse may move between press and release
const FLOOR = 8; // m
const STEP = Math.PI / 24; // that an arrow turns
const HIGHEST = 1.5; // above or below the level
const NEARER = 1.15;
const MEETING = 0.025; // m
const LIGHT = 0xeef2f5;
const DARK = 0x232c35;
const PINK = 0xe91e63;
const YELLOW = 0xffd600;
const FILLED = 0.94; // share of the view

class SceneView {
  #host;
  #renderer;
  #scene = new Scene();
  #camera = new PerspectiveCamera(40, 1, 0.005, 200);
  #controls;
  #part = new Group();
  #arm = null;
  #solids;
  #ball;
  #meeting;
  #asked = false;
  #fitted = null;
  #tips = null;
  #removals = [];

  constructor(host, renderer, { robot, bodies = [] }) {
    this.#host = host;
    this.#renderer = renderer;
    renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    host.append(renderer.domElement);
    const dark = window.matchMedia("screen and (prefers-color-scheme: dark)");
    const paint = () => {
      this.#scene.background = new Color(dark.matches ? DARK : LIGHT);
      this.#draw();
    };
    dark.addEventListener("change", paint);
    this.#camera.up.set(0, 0, 1);
    this.#controls = new OrbitControls(this.#camera, renderer.domElement);
    this.#controls.addEventListener("change", () => this.#draw());
    this.#hearKeys(renderer.domElement);
    this.#part.matrixAutoUpdate = false;
    this.#scene.add(this.#part);
    this.#addLights();
    this.#solids = new Solids(bodies, this.#scene, this.#part);
    this.#solids.work(0, 0);
    this.#ball = this.#addBall(PINK, { opacity: 0.45 });
    this.#part.add(this.#ball);
    this.#meeting = this.#addBall(YELLOW, { depthTest: false });
    this.#meeting.scale.setScalar(MEETING);
    this.#scene.add(this.#meeting);
    if (robot) {
      this.#arm = new Arm(robot);
      this.#tips = new Tips(robot, this.#scene, host);
      this.stand(robot.T_world_robroot, robot.T_world_base);
    }
    paint();
    window.addEventListener("resize", () => this.#resize());
    window.addEventListener("beforeprint", () => renderer.render(this.#scene, this.#camera));
    this.#resize();
  }

  // ---- robot and solids ---------------------------------------------------------------------

  // where robot and workpiece stand (rows of 4 x 4); external axes move them
  stand(robroot, base) {
    this.#arm.stand(robroot);
    this.#part.matrix.set(...base);
    this.#part.updateMatrixWorld(true);
  }

  // moves the robot to joint angles [rad]
  place(angles) {
    if (!this.#arm) return;
    this.#arm.place(angles);
    this.#solids.carry(this.#arm.frames);
    this.#tips.carry(this.#arm.frames.at(-1));
    this.#draw();
  }

  // shows the solids of one tool and what stands there in one base (their places in the cell)
  work(tool, base) {
    this.#solids.work(tool, base);
    this.#tips?.work(tool);
    this.#draw();
  }

  // draws what is missing from the tool to a point of the workpiece; null: nothing
  miss(point) {
    this.#tips?.miss(point && this.inWorld(point));
    this.#draw();
  }

  // the frame of a link in the world
  linkFrame(link) {
    return this.#arm.frames.at(link).clone();
  }

  // shows a tool or a fixture off its place, as Solids.shift
  shift(kind, index, off) {
    this.#solids.shift(kind, index, off);
    if (this.#arm) this.#solids.carry(this.#arm.frames);
    this.#draw();
  }

  // a handle in this view: a class as Handle, and whom it tells
  handle(Handle, on) {
    const [scene, camera, controls] = [this.#scene, this.#camera, this.#controls];
    const canvas = this.#renderer.domElement;
    return new Handle({ scene, camera, canvas, controls, draw: () => this.#draw() }, on);
  }

  // a point of the world in the window [px]
  pixel(point) {
    const box = this.#renderer.domElement.getBoundingClientRect();
    const [x, y] = this.#inView(point);
    return [box.left + x, box.top + y];
  }

  #inView(point) {
    const { x, y } = new Vector3(...point).project(this.#camera);
    return [((x + 1) / 2) * this.#host.clientWidth, ((1 - y) / 2) * this.#host.clientHeight];
  }

  // names of the solids that are shown
  get solids() {
    return this.#solids.shown;
  }

  // shows solids of some names in red, and through them the point [robot root] where they meet
  highlight(names, point = null) {
    this.#solids.highlight(names);
    this.#meeting.visible = point !== null;
    if (point) this.#meeting.position.set(...this.#arm.inWorld(point));
    this.#draw();
  }

  // where solids meet in the world, null where nothing is shown
  get meeting() {
    return this.#meeting.visible ? this.#meeting.position.toArray() : null;
  }

  // the origin of the flange [m]
  get tip() {
    return this.#arm ? this.#arm.tip : [0, 0, 0];
  }

  // the point of the tool that is shown in the world, null where there is none
  get toolTip() {
    return this.#tips?.point ?? null;
  }

  // a point of the workpiece in the world
  inWorld(point) {
    return new Vector3(...point).applyMatrix4(this.#part.matrix).toArray();
  }

  // ---- path and marks -----------------------------------------------------------------------

  // adds segments in the workpiece; returns paint(i => colour) and remove()
  addSegments(ends) {
    const { lines, paint } = lineSegments(ends);
    const remove = this.#add(lines);
    return { paint: this.#painting(paint), remove };
  }

  // adds marks as pointMarks; returns paint(i => colour); a click gives the index
  addMarks(points, axes, size, onPick) {
    const { mesh, indexOf, paint } = pointMarks(points, axes, size);
    this.#add(mesh);
    const listening = new AbortController();
    this.#pick(mesh, size, (hit) => onPick(indexOf(hit)), listening);
    this.#removals.push(() => listening.abort());
    return { paint: this.#painting(paint) };
  }

  // adds an object to the workpiece; returns what takes it away
  #add(object) {
    this.#part.add(object);
    const remove = () => {
      object.removeFromParent();
      object.geometry.dispose();
    };
    this.#removals.push(remove);
    return remove;
  }

  // takes paths and marks away
  clear() {
    for (const remove of this.#removals) remove();
    this.#removals = [];
  }

  // shows where a point of the workpiece lies
  point(point, size) {
    this.#ball.visible = true;
    this.#ball.position.set(...point);
    this.#ball.scale.setScalar(size);
    this.#draw();
  }

  #painting(paint) {
    return (colourOf) => {
      paint(colourOf);
      this.#draw();
    };
  }

  #addBall(colour, settings) {
    const material = new MeshLambertMaterial({ color: colour, transparent: true, ...settings });
    const ball = new Mesh(new SphereGeometry(1, 16, 12), material);
    ball.visible = false;
    return ball;
  }

  #pick(mesh, near, onHit, { signal }) {
    const canvas = this.#renderer.domElement;
    const ray = new Raycaster();
    ray.params.Line.threshold = near;
    let down = null;
    const hear = (name, heard) => canvas.addEventListener(name, heard, { signal });
    hear("pointerdown", (event) => {
      down = [event.clientX, event.clientY];
    });
    hear("click", ({ clientX, clientY }) => {
      if (down && Math.hypot(clientX - down[0], clientY - down[1]) > CLICK) return;
      const box = canvas.getBoundingClientRect();
      const x = ((clientX - box.left) / box.width) * 2 - 1;
      const y = 1 - ((clientY - box.top) / box.height) * 2;
      ray.setFromCamera(new Vector2(x, y), this.#camera);
      const [hit] = ray.intersectObject(mesh);
      if (hit) onHit(hit);
    });
  }

  // ---- camera, lights, floor ----------------------------------------------------------------

  addFloor() {
    const grid = new GridHelper(FLOOR, 16, 0xb8c2cc, 0xd5dce2);
    grid.rotation.x = Math.PI / 2;
    this.#scene.add(grid);
  }

  // adds the axes of a frame (rows of 4 x 4): x red, y green, z blue
  addFrame(rows, size) {
    const axes = new AxesHelper(size);
    axes.matrixAutoUpdate = false;
    axes.matrix.set(...rows);
    this.#scene.add(axes);
  }

  // looks so that the whole robot, its tool, the solids shown and points of the workpiece are in view
  fit(points, from) {
    this.#fitted = [points, from];
    const seen = points.map((point) => this.inWorld(point));
    for (const frame of this.#arm?.frames ?? []) seen.push(frame.elements.slice(12, 15));
    seen.push(...this.#solids.corners());
    if (this.toolTip) seen.push(this.toolTip);
    const vertical = Math.tan((this.#camera.fov * Math.PI) / 360) * FILLED;
    const { target, distance } = viewOf(seen, from, vertical, vertical * this.#camera.aspect);
    this.#controls.target.set(...target);
    this.#camera.position.set(...target);
    this.#camera.position.addScaledVector(new Vector3(...from).normalize(), distance);
    this.#controls.update();
    this.#draw();
  }

  // the side from which points of the workpiece are seen best in poses of the robot, as openSide
  side(points, axes, poses) {
    const arms = poses.map((angles) => this.#arm.origins(angles));
    return openSide(points, axes, (point) => this.inWorld(point), arms);
  }

  // looks at a sphere of the world; without a direction from where it looks now
  look({ centre, radius, from }) {
    const target = this.#controls.target;
    const way = from ? new Vector3(...from) : this.#camera.position.clone().sub(target);
    const sine = Math.sin((this.#camera.fov * Math.PI) / 360);
    const distance = radius / sine / Math.min(1, this.#camera.aspect);
    target.set(...centre);
    this.#camera.position.copy(target).addScaledVector(way.normalize(), distance);
    this.#controls.update();
    this.#draw();
  }

  #hearKeys(canvas) {
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "3D view: arrows turn, + and - zoom, 0 shows all");
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  // arrows turn about what is looked at, + and - go nearer and away, 0 shows all again
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const near = { "+": 1 / NEARER, "=": 1 / NEARER, "-": NEARER }[event.key];
    const target = this.#controls.target;
    const way = this.#camera.position.clone().sub(target);
    if (turn[event.key]) {
      const [around, down] = turn[event.key];
      const flat = Math.hypot(way.x, way.y);
      const high = Math.atan2(way.z, flat) - down * STEP;
      const angle = Math.atan2(way.y, way.x) + around * STEP;
      const up = Math.max(-HIGHEST, Math.min(HIGHEST, high));
      const length = way.length();
      way.set(Math.cos(up) * Math.cos(angle), Math.cos(up) * Math.sin(angle), Math.sin(up));
      way.multiplyScalar(length);
    } else if (near) way.multiplyScalar(near);
    else if (event.key !== "0") return;
    event.preventDefault();
    if (event.key === "0" && this.#fitted) this.fit(...this.#fitted);
    else this.#camera.position.copy(target).add(way);
    this.#controls.update();
    this.#draw();
  }

  // where the camera stands [m]
  get eye() {
    return this.#camera.position.toArray();
  }

  #addLights() {
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(-3, -4, 6);
    this.#scene.add(new HemisphereLight(0xffffff, 0x8a949e, 2.2), sun);
  }

  // draws once before the next frame, however often it is asked
  #draw() {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#renderer.render(this.#scene, this.#camera);
      this.#tips?.label((point) => this.#inView(point));
    });
  }

  #resize() {
    const { clientWidth, clientHeight } = this.#host;
    this.#renderer.setSize(clientWidth, clientHeight, false);
    this.#renderer.domElement.style.height = `${clientHeight}px`;
    this.#camera.aspect = clientWidth / clientHeight;
    this.#camera.updateProjectionMatrix();
    this.#renderer.render(this.#scene, this.#camera);
  }
}

// What stands in for the view where the browser has no WebGL: the rest of the page works.
const SILENT = "stand place miss work highlight clear shift point addFloor addFrame look fit side";
export const NO_SCENE = {
  ...Object.fromEntries(SILENT.split(" ").map((name) => [name, () => {}])),
  ...{ solids: [], tip: null, meeting: null, eye: null },
  inWorld: (point) => point,
  addSegments: () => ({ paint() {}, remove() {} }),
  addMarks: () => ({ paint() {} }),
  handle: () => ({ at() {}, turns: false, axis: null }),
  linkFrame: () => null,
  pixel: () => [0, 0],
};

// the 3D view of a page's data in an element
export function openScene(host, data) {
  try {
    // smooth edges cost software GL most of a frame with lines of thousands of tags
    const antialias = (data.names ?? data.rows?.names ?? []).length <= MANY;
    const renderer = new WebGLRenderer({ antialias, preserveDrawingBuffer: true });
    return new SceneView(host, renderer, data);
  } catch (problem) {
    host.textContent = `This browser shows no 3D (WebGL is off): ${problem.message}`;
    return NO_SCENE;
  }
}
