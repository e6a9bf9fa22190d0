// The 3-D viewer: points in WebGL, drawn from the JSON in each form.
const VERTEX = `
attribute vec3 position, colour;
attribute float removal, cluster;
uniform mat3 turn;
uniform vec3 centre, paper;
uniform vec2 focal;
uniform float reach, distance, size, cut, selected;
varying vec3 shade;
void main() {
  vec3 p = turn * (reach * position - centre);
  float depth = distance - p.z;
  bool hidden = cut > 0.0 && removal <= cut || depth < 0.05;
  shade = selected < 0.0 || cluster == selected ? colour : mix(colour, paper, 0.8);
  gl_Position = hidden ? vec4(2, 2, 2, 1) : vec4(focal * p.xy, 1.005 * depth - 0.1, depth);
  gl_PointSize = size / depth;
}`;
const FRAGMENT = `
precision mediump float;
varying vec3 shade;
void main() {
  vec2 place = 2.0 * gl_PointCoord - 1.0;
  float edge = dot(place, place);
  if (edge > 1.0) discard;
  gl_FragColor = vec4(shade * (0.7 + 0.3 * sqrt(1.0 - edge)), 1);
}`;
const NOISE = 65535, FIELD = 2.4, NEAREST = 10;

const unpack = (text, Type) => new Type(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
const percent = share => {  // 0% and 100% are exact, as in gspure.progress
  const text = (100 * share).toFixed(1);
  return share > 0 && text === "0.0" ? "<0.1%" : share < 1 && text === "100.0" ? ">99.9%" : text + "%";
};

function linked(gl) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  return program;
}

function rgb(colours, count) {
  if (colours.rgb) return unpack(colours.rgb, Uint8Array);
  const palette = unpack(colours.palette, Uint8Array), index = unpack(colours.index, Uint8Array);
  return Uint8Array.from({ length: 3 * count }, (_, i) => palette[3 * index[Math.floor(i / 3)] + i % 3]);
}

function explain(key, { legend, ramp, words }) {
  const swatch = (background, text) => {
    const item = document.createElement("span"), patch = document.createElement("i");
    patch.style.background = background;
    item.append(patch, text);
    return item;
  };
  key.replaceChildren(...legend.map(([label, colour]) => swatch(colour, label)));
  if (ramp.length) {
    const scale = swatch(`linear-gradient(90deg, ${ramp.map(c => `rgb(${c})`)})`, "");
    scale.className = "ramp";
    scale.append(...words.map(word => swatch("", word)));
    key.append(scale);
  }
}

function start(form) {
  const canvas = form.querySelector("canvas"), controls = form.elements;
  const gl = canvas.getContext("webgl");
  if (!gl) { form.querySelector(".warning").hidden = false; canvas.hidden = true; return; }
  const data = JSON.parse(form.querySelector("script").textContent);
  const positions = unpack(data.positions, Int16Array), removal = unpack(data.removal, Uint16Array);
  const clusters = unpack(data.clusters, Uint16Array), weights = unpack(data.weights, Float32Array);
  const pruned = unpack(data.pruned, Uint8Array);
  const program = linked(gl), at = name => gl.getUniformLocation(program, name);
  const eye = { yaw: -0.5, pitch: 0.45, distance: 3.4, centre: [0, 0, 0] };
  let selected = -1, cut = 0, scheduled = false;

  const attribute = (name, width, type, normalized) => {
    const buffer = gl.createBuffer(), place = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(place);
    return array => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
      gl.vertexAttribPointer(place, width, type, normalized, 0, 0);
    };
  };
  attribute("position", 3, gl.SHORT, true)(positions);
  attribute("removal", 1, gl.UNSIGNED_SHORT, false)(removal);
  attribute("cluster", 1, gl.UNSIGNED_SHORT, false)(clusters);
  const paint = attribute("colour", 3, gl.UNSIGNED_BYTE, true);

  // The rotation as columns: about the vertical, then about the horizontal.
  const turn = () => {
    const [cy, sy, cp, sp] = [Math.cos(eye.yaw), Math.sin(eye.yaw), Math.cos(eye.pitch), Math.sin(eye.pitch)];
    return [cy, sp * sy, -cp * sy, 0, cp, sp, sy, -sp * cy, cp * cy];
  };
  const side = () => Math.min(canvas.clientWidth, canvas.clientHeight);
  const focal = () => [FIELD * side() / canvas.clientWidth, FIELD * side() / canvas.clientHeight];

  function draw() {
    scheduled = false;
    const ratio = devicePixelRatio;
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(at("turn"), false, turn());
    gl.uniform3fv(at("centre"), eye.centre);
    gl.uniform3fv(at("paper"), getComputedStyle(canvas).backgroundColor.match(/\d+/g).slice(0, 3).map(c => c / 255));
    gl.uniform2fv(at("focal"), focal());
    gl.uniform1f(at("reach"), data.reach);
    gl.uniform1f(at("distance"), eye.distance);
    gl.uniform1f(at("size"), FIELD * side() * ratio * Math.min(1.6 / Math.sqrt(data.points), 0.04));
    gl.uniform1f(at("cut"), cut);
    gl.uniform1f(at("selected"), selected);
    gl.drawArrays(gl.POINTS, 0, data.points);
  }
  const redraw = () => { if (!scheduled) scheduled = requestAnimationFrame(draw); };

  function recolour() {
    const colours = data.colours[controls.colour.value];
    paint(rgb(colours, data.points));
    explain(form.querySelector(".key"), colours);
    redraw();
  }
  function prune() {
    const i = Number(controls.cut.value);
    cut = data.cuts[i];
    form.classList.toggle("decided", i === data.decision);
    for (const [name, shares] of Object.entries(data.removed)) {
      form.querySelector(`.bars .${name}`).style.setProperty("--share", shares[i]);
      controls[name].value = percent(shares[i]);
    }
    redraw();
  }

  // The nearest visible point to a place on the canvas, in pixels of the page; of several, the one in front.
  function pointAt(x, y) {
    const m = turn(), [fx, fy] = focal(), scale = data.reach / 32767;
    let best = -1, front = Infinity;
    for (let i = 0; i < data.points; i++) {
      if (cut && removal[i] <= cut) continue;
      const [a, b, c] = [0, 1, 2].map(k => scale * positions[3 * i + k] - eye.centre[k]);
      const depth = eye.distance - (m[2] * a + m[5] * b + m[8] * c);
      if (depth < 0.05 || depth >= front) continue;
      const dx = (fx * (m[0] * a + m[3] * b + m[6] * c) / depth + 1) * canvas.clientWidth / 2 - x;
      const dy = (1 - fy * (m[1] * a + m[4] * b + m[7] * c) / depth) * canvas.clientHeight / 2 - y;
      if (dx * dx + dy * dy < NEAREST) [best, front] = [i, depth];
    }
    return best;
  }
  function select(point) {
    const cluster = point < 0 ? -1 : clusters[point], noise = cluster === NOISE;
    selected = noise ? -1 : cluster;
    for (const text of form.querySelectorAll(".picked")) {
      text.hidden = point < 0 || (text.dataset.kind === "noise") !== noise;
      if (text.hidden) continue;
      const weight = noise ? weights[point] : data.cluster_weights[cluster], size = data.sizes[cluster];
      const facts = {
        size: size?.toLocaleString("en"), share: percent(size / data.count), weight: weight.toPrecision(3),
        ratio: (weight / data.mean_weight).toPrecision(2), fate: pruned[point] ? "prunes" : "keeps",
      };
      for (const output of text.querySelectorAll("output")) output.value = facts[output.name];
    }
    redraw();
  }

  function zoom(factor) { eye.distance = Math.min(Math.max(eye.distance * factor, 0.1), 15); redraw(); }
  function move(dx, dy) {
    const m = turn(), step = 2 * eye.distance / FIELD / side();
    eye.centre = eye.centre.map((value, k) => value - step * (dx * m[3 * k] - dy * m[3 * k + 1]));
    redraw();
  }
  function rotate(dx, dy) {
    eye.yaw += dx * 0.008;
    eye.pitch = Math.min(Math.max(eye.pitch + dy * 0.008, -1.57), 1.57);
    redraw();
  }

  const fingers = new Map();
  let travelled = 0;
  canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    travelled = 0;
  };
  canvas.onpointermove = event => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
    const apart = () => { const [a, b] = fingers.values(); return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
    const before = fingers.size > 1 && apart();
    fingers.set(event.pointerId, event);
    travelled += Math.abs(dx) + Math.abs(dy);
    if (before) zoom(before / apart());
    else if (event.shiftKey) move(dx, dy);
    else rotate(dx, dy);
  };
  canvas.onpointerup = canvas.onpointercancel = event => {
    fingers.delete(event.pointerId);
    if (event.type === "pointerup" && travelled < 4) select(pointAt(event.offsetX, event.offsetY));
  };
  canvas.onwheel = event => {
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(event.deltaY * 0.001));
  };
  canvas.onkeydown = event => {
    const turns = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
    const factor = { "+": 0.9, "-": 1.1 }[event.key];
    if (turns) rotate(...turns);
    if (factor) zoom(factor);
    if (turns || factor) event.preventDefault();
  };
  for (const choice of controls.colour) choice.onchange = recolour;
  controls.cut.oninput = prune;
  controls.decision.onclick = () => { controls.cut.value = data.decision; prune(); };
  new ResizeObserver(redraw).observe(canvas);
  form.classList.add("started");
  recolour();
  prune();
  draw();
}

// Each viewer starts when it is first seen: a browser keeps few WebGL contexts.
const viewers = new IntersectionObserver(entries => {
  for (const { target, isIntersecting } of entries)
    if (isIntersecting && !target.classList.contains("started")) start(target);
});
for (const form of document.querySelectorAll(".viewer")) viewers.observe(form);
