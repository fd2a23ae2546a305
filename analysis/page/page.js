"use strict";
// Plays the robots of the page's data: forward kinematics of each robot's segments,
// between two recorded states by interpolation. One mesh of boxes per robot.
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const T = THREE;

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

// ---- robots ----
class Robot {
  constructor(entry) {
    Object.assign(this, entry);
    this.width = 7 + entry.joints;
    this.rows = floats(entry.motion);
    this.count = this.rows.length / this.width;
    this.end_s = this.start_s + (this.count - 1) * this.interval_s;
    this.places = entry.parents.map(() => new T.Vector3());
    this.turns = entry.parents.map(() => new T.Quaternion());
    this.anchors = entry.anchors.map((a) => new T.Vector3(...a));
    this.axes = entry.axes.map((a) => new T.Vector3(...a));
    const material = new T.MeshLambertMaterial();
    this.mesh = new T.InstancedMesh(new T.BoxGeometry(1, 1, 1), material, entry.boxes.length);
    this.mesh.frustumCulled = false;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.boxes = entry.boxes.map(([segment, ...b], at) => {
      this.mesh.setColorAt(at, new T.Color().setRGB(b[10], b[11], b[12], T.SRGBColorSpace));
      return { segment, centre: new T.Vector3(b[0], b[1], b[2]),
        turn: new T.Quaternion(b[3], b[4], b[5], b[6]),
        size: new T.Vector3(b[7], b[8], b[9]) };
    });
    if (entry.commands) this.ticks = floats(entry.commands);
  }

  // Pose the robot at a time [s]; it is shown only while it lives.
  pose(time_s) {
    const last = this.count - 1;
    const at = (time_s - this.start_s) / this.interval_s;
    this.mesh.visible = at > -0.5 && (at < last + 0.5 || data.curves.length === 0);
    if (!this.mesh.visible) return;
    const here = Math.min(Math.max(at, 0), last), low = Math.floor(here);
    const share = here - low, high = Math.min(low + 1, last);
    const a = low * this.width, b = high * this.width, r = this.rows;
    const mix = (n) => r[a + n] + share * (r[b + n] - r[a + n]);
    this.places[0].set(mix(0), mix(1), mix(2));
    this.turns[0].set(r[a + 4], r[a + 5], r[a + 6], r[a + 3])
      .slerp(other.set(r[b + 4], r[b + 5], r[b + 6], r[b + 3]), share);
    for (let s = 1; s < this.parents.length; s++) {
      const parent = this.parents[s], value = mix(6 + s);
      this.places[s].copy(this.anchors[s]);
      this.turns[s].identity();
      if (this.slides[s]) this.places[s].addScaledVector(this.axes[s], value);
      else this.turns[s].setFromAxisAngle(this.axes[s], value);
      this.places[s].applyQuaternion(this.turns[parent]).add(this.places[parent]);
      this.turns[s].premultiply(this.turns[parent]);
    }
    this.boxes.forEach((box, n) => {
      spot.copy(box.centre).applyQuaternion(this.turns[box.segment]).add(this.places[box.segment]);
      matrix.compose(spot, other.copy(this.turns[box.segment]).multiply(box.turn), box.size);
      this.mesh.setMatrixAt(n, matrix);
    });
    this.mesh.instanceMatrix.needsUpdate = true;
  }

  // Distance of the farthest box from the core, in the present pose [m].
  reach() {
    const away = this.boxes.map(({ centre, segment, size }) => 0.5 * size.length() +
      spot.copy(centre).applyQuaternion(this.turns[segment]).add(this.places[segment]).distanceTo(this.places[0]));
    return Math.max(...away);
  }
}
const other = new T.Quaternion(), spot = new T.Vector3(), matrix = new T.Matrix4();
const robots = data.robots.map((entry) => new Robot(entry));
const begin_s = Math.min(...robots.map((r) => r.start_s));
const end_s = Math.max(...robots.map((r) => r.end_s));

// ---- scene ----
const scene = new T.Scene();
scene.background = new T.Color(0xe9edf1);
const renderer = new T.WebGLRenderer({ canvas: $("view"), antialias: true });
renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
renderer.shadowMap.enabled = true;
renderer.shadowMap.type = T.PCFShadowMap;
const camera = new T.PerspectiveCamera(30, 1.6, 0.02, 200);
camera.up.set(0, 0, 1);
const controls = new T.OrbitControls(camera, $("view"));
controls.maxPolarAngle = 0.5 * Math.PI - 0.02;
const lamp = new T.DirectionalLight(0xffffff, 1.9);
lamp.castShadow = true;
lamp.shadow.mapSize.set(2048, 2048);
lamp.shadow.normalBias = 0.002;
scene.add(new T.AmbientLight(0xffffff, 1.7), lamp, lamp.target);
for (const one of robots) scene.add(one.mesh);

function grid(low, high) {
  // Tiles of 10 cm; of large grounds 1 m.
  const wide = Math.max(high.x - low.x, high.y - low.y), step = wide > 8 ? 1 : 0.1;
  const tiles = document.createElement("canvas"), paint = tiles.getContext("2d");
  tiles.width = tiles.height = 128;
  ["#eff1f4", "#e0e4ea"].forEach((colour, n) => [0, 64].forEach((x) => {
    paint.fillStyle = colour;
    paint.fillRect(x, n ? 64 - x : x, 64, 64);
  }));
  const texture = new T.CanvasTexture(tiles), side = 40 * step * Math.ceil((wide + 2) / step / 4);
  texture.wrapS = texture.wrapT = T.RepeatWrapping;
  texture.colorSpace = T.SRGBColorSpace;
  texture.anisotropy = renderer.capabilities.getMaxAnisotropy();
  texture.repeat.set(side / step / 2, side / step / 2);
  const floor = new T.Mesh(new T.PlaneGeometry(side, side), new T.MeshLambertMaterial({ map: texture }));
  floor.receiveShadow = true;
  const middle = (a, b) => step * Math.round((a + b) / 2 / step);
  floor.position.set(middle(low.x, high.x), middle(low.y, high.y), 0);
  scene.add(floor);
}

function solid(one) {
  let mesh;
  const paint = (colour) => new T.MeshLambertMaterial({ side: T.DoubleSide,
    color: new T.Color().setRGB(colour[0], colour[1], colour[2], T.SRGBColorSpace),
    transparent: colour[3] < 1, opacity: colour[3] });
  if (one.shape === "mesh") {
    // Heights by x, then y; a plane's vertices are by falling y, then x.
    const heights = floats(one.heights), n = Math.round(Math.sqrt(heights.length));
    const geometry = new T.PlaneGeometry(2 * one.extent, 2 * one.extent, n - 1, n - 1);
    heights.forEach((z, at) => geometry.attributes.position.setZ((n - 1 - at % n) * n + Math.floor(at / n), z));
    geometry.computeVertexNormals();
    mesh = new T.Mesh(geometry, paint([0.84, 0.86, 0.88, 1]));
  } else if (one.shape === "wall") {
    const [x, y, z, w, i, j, k, a, b, c] = one.wall;
    mesh = new T.Mesh(new T.BoxGeometry(2 * a, 2 * b, 2 * c), paint([0.6, 0.65, 0.7, 0.35]));
    mesh.position.set(x, y, z);
    mesh.quaternion.set(i, j, k, w);
  } else {
    const [a, b, c] = one.size;
    const shapes = {
      box: () => new T.BoxGeometry(2 * a, 2 * b, 2 * c),
      sphere: () => new T.SphereGeometry(a, 32, 16),
      ellipsoid: () => new T.SphereGeometry(1, 32, 16).scale(a, b, c),
      cylinder: () => new T.CylinderGeometry(a, a, 2 * b, 32).rotateX(0.5 * Math.PI),
      capsule: () => new T.CapsuleGeometry(a, 2 * b, 8, 24).rotateX(0.5 * Math.PI),
    };
    mesh = new T.Mesh(shapes[one.shape](), paint(one.colour));
    mesh.matrixAutoUpdate = false;
    mesh.matrix.fromArray(one.frame);
  }
  mesh.receiveShadow = true;
  scene.add(mesh);
}

// All places of the cores, which decide where the camera begins.
const low = new T.Vector3(Infinity, Infinity, 0), high = new T.Vector3(-Infinity, -Infinity, 0);
for (const one of robots) {
  for (let at = 0; at < one.rows.length; at += one.width) {
    spot.set(one.rows[at], one.rows[at + 1], one.rows[at + 2]);
    low.min(spot); high.max(spot);
  }
}
grid(low, high);
data.grounds.forEach(solid);
let chosen = robots.length === 1 ? robots[0] : null;

function look() {
  const way = 0.5 * Math.hypot(high.x - low.x, high.y - low.y);
  const reach = chosen ? chosen.reach() : way + Math.max(...robots.map((r) => r.reach()));
  const away = 0.65 * reach / Math.sin(Math.PI / 12) / Math.min(1, camera.aspect);
  const middle = chosen ? chosen.places[0].clone() : low.clone().add(high).multiplyScalar(0.5);
  controls.target.copy(middle);
  camera.position.copy(middle).add(spot.set(0.57, -0.68, 0.47).multiplyScalar(away));
  camera.far = 20 * away;
  const span = lamp.shadow.camera;
  span.left = span.bottom = -1.3 * reach;
  span.right = span.top = 1.3 * reach;
  span.near = 0.1; span.far = 12 * reach;
  span.updateProjectionMatrix();
  camera.updateProjectionMatrix();
}

// ---- panels ----
function charts() {
  $("facts").hidden = !chosen;
  for (const id of ["joints", "brain", "ancestry"]) $(id).replaceChildren();
  document.querySelectorAll("#robots button").forEach((b, n) =>
    b.setAttribute("aria-pressed", String(robots[n] === chosen)));
  if (!chosen) return;
  $("name").textContent = chosen.name;
  const { joints, width, rows, count } = chosen;
  if (joints) {
    const angles = (t, j) => rows[t * width + 7 + j];
    heat("joints", "Angles of joints, one row each", count, joints, angles, chosen.interval_s);
  }
  const { motors, ticks } = chosen;
  if (motors) {
    heat("brain", "Brain activity: commands to the motors", ticks.length / motors, motors,
      (t, m) => ticks[t * motors + m], chosen.commands_s);
  }
  if (chosen.ancestry) tree(chosen.ancestry);
}

// A picture of numbers over time: blue below 0, red above, white 0.
function heat(id, title, times, rows, value, interval_s) {
  const head = document.createElement("h3"), figure = document.createElement("figure");
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
  head.textContent = title;
  canvas.width = times; canvas.height = rows;
  canvas.style.height = `${Math.max(28, Math.min(140, 11 * rows))}px`;
  canvas.style.imageRendering = "pixelated";
  let most = 1e-6;
  for (let t = 0; t < times; t++) for (let n = 0; n < rows; n++) most = Math.max(most, Math.abs(value(t, n)));
  const image = context.createImageData(times, rows);
  for (let n = 0; n < rows; n++) for (let t = 0; t < times; t++) {
    const share = value(t, n) / most, at = 4 * (n * times + t), fade = 1 - Math.abs(share);
    image.data.set(share < 0 ? [44 + 201 * fade, 110 + 135 * fade, 187 + 58 * fade, 255]
      : [205 + 40 * fade, 84 + 161 * fade, 60 + 185 * fade, 255], at);
  }
  context.putImageData(image, 0, 0);
  figure.append(canvas);
  cursor(figure, () => (now_s - chosen.start_s) / (times * interval_s));
  canvas.addEventListener("click", (event) =>
    seek(chosen.start_s + event.offsetX / canvas.clientWidth * times * interval_s));
  $(id).append(head, figure);
}

const cursors = [];
function cursor(figure, share) {
  const line = document.createElement("i");
  line.style.cssText = "position:absolute;top:0;bottom:0;width:1.5px;background:#111;pointer-events:none";
  figure.append(line);
  cursors.push({ line, share });
}

function svg(name, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

const short = (value) => value === null || value === undefined ? "" : Number(value).toPrecision(3);

// Ancestors above: a robot's number of birth and its fitness.
function tree({ levels, edges }) {
  const head = document.createElement("h3"), wide = 340, step = 46;
  head.textContent = "Ancestry: parents above, birth and fitness";
  const high = step * levels.length, spots = {};
  levels.forEach((level, n) => level.forEach((one, at) => {
    spots[one.row] = [(at + 0.5) * wide / level.length, high - step * n - 24];
  }));
  const picture = svg("svg", { viewBox: `0 0 ${wide} ${high}` });
  for (const [down, up] of edges) {
    if (!spots[up] || !spots[down]) continue;
    const [x1, y1] = spots[down], [x2, y2] = spots[up];
    picture.append(svg("line", { x1, y1: y1 - 9, x2, y2: y2 + 16, stroke: "currentColor", opacity: 0.3 }));
  }
  for (const level of levels) {
    const room = wide / level.length;
    for (const { row, name, fitness } of level) {
      const [x, y] = spots[row];
      picture.append(svg("text", { x, y, "text-anchor": "middle" }, room < 30 ? "•" : name));
      if (room >= 42) picture.append(svg("text", { x, y: y + 12, "text-anchor": "middle" }, short(fitness)));
    }
  }
  $("ancestry").append(head, picture);
}

function curve({ title, times, values }) {
  if (!times.length) return;
  const head = document.createElement("h3"), figure = document.createElement("figure");
  const box = document.createElement("div"), wide = 400, tall = 110;
  head.textContent = title;
  const first = times[0], last = Math.max(times[times.length - 1], end_s);
  const most = Math.max(...values, 1e-9), least = Math.min(...values, 0);
  const x = (t) => wide * (t - first) / Math.max(last - first, 1e-9);
  const y = (v) => tall - 16 - (tall - 30) * (v - least) / (most - least || 1);
  const picture = svg("svg", { viewBox: `0 0 ${wide} ${tall}`, preserveAspectRatio: "none" });
  picture.append(svg("rect", { x: x(begin_s), y: 0, width: Math.max(1, x(end_s) - x(begin_s)), height: tall - 14, fill: "currentColor", opacity: 0.07 }));
  picture.append(svg("polyline", { points: times.map((t, n) => `${x(t)},${y(values[n])}`).join(" "), fill: "none", stroke: "var(--mark)", "stroke-width": 1.5 }));
  picture.append(svg("text", { x: 0, y: 10 }, short(most)), svg("text", { x: 0, y: tall - 3 }, `${Math.round(first)} s`),
    svg("text", { x: wide, y: tall - 3, "text-anchor": "end" }, `${Math.round(last)} s`));
  figure.append(picture);
  cursor(figure, () => (now_s - first) / Math.max(last - first, 1e-9));
  box.append(head, figure);
  $("curves").append(box);
}

function choose(robot) {
  cursors.splice(data.curves.length);
  chosen = robot === chosen && robots.length > 1 ? null : robot;
  show(0);
  look();
  charts();
}

robots.forEach((robot) => {
  const button = document.createElement("button");
  const name = document.createElement("span"), fact = document.createElement("span");
  name.textContent = robot.name;
  const fitness = robot.fitness === undefined ? "" : `fitness ${short(robot.fitness)}, `;
  fact.textContent = `${fitness}${robot.parts} parts, ${robot.joints} joints`;
  button.append(name, fact);
  button.addEventListener("click", () => choose(robot));
  $("robots").append(button);
});
data.curves.forEach(curve);

// ---- time ----
let now_s = begin_s, isPlaying = true, before = null;
const seek = (time_s) => { now_s = Math.min(Math.max(time_s, begin_s), end_s); show(0); };
$("play").addEventListener("click", () => { isPlaying = !isPlaying; $("play").textContent = isPlaying ? "Pause" : "Play"; });
$("time").addEventListener("input", () => seek(begin_s + Number($("time").value) * (end_s - begin_s)));

const target = new T.Vector3();
function show() {
  for (const one of robots) one.pose(now_s);
  if (chosen) {
    // The camera goes along in the plane.
    target.copy(chosen.places[0]).setZ(controls.target.z).sub(controls.target);
    controls.target.add(target); camera.position.add(target);
  }
  lamp.target.position.copy(controls.target);
  const reach = lamp.shadow.camera.right;
  lamp.position.copy(controls.target).add(spot.set(-1.6 * reach, -1.2 * reach, 3.4 * reach));
  $("time").value = (now_s - begin_s) / Math.max(end_s - begin_s, 1e-9);
  $("clock").textContent = `${now_s.toFixed(2)} s`;
  for (const { line, share } of cursors) line.style.left = `${100 * Math.min(Math.max(share(), 0), 1)}%`;
}

function resize() {
  const { clientWidth, clientHeight } = $("stage");
  renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = clientWidth / clientHeight;
  camera.updateProjectionMatrix();
  // A new size clears the canvas.
  renderer.render(scene, camera);
}

function frame(clock_ms) {
  const passed_s = before === null ? 0 : (clock_ms - before) / 1000;
  before = clock_ms;
  if (isPlaying) {
    now_s += Math.min(passed_s, 0.1) * Number($("speed").value);
    if (now_s > end_s) now_s = begin_s;
  }
  show();
  controls.update();
  renderer.render(scene, camera);
  requestAnimationFrame(frame);
}

new ResizeObserver(resize).observe($("stage"));
resize();
show();
look();
charts();
requestAnimationFrame(frame);
