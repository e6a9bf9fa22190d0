// The 3-D view: splats in WebGL 2, blended from the farthest to the nearest; the data are those of gspure.viewer.data.
const VERTEX = `#version 300 es
precision highp float;
precision highp isampler2D;
uniform isampler2D means;
uniform sampler2D scales, quats, paint;
uniform mat3 axes;  // right, down and forward
uniform vec3 eye;
uniform vec2 size, middle;  // of the canvas, and where its camera looks from there, in pixels
uniform float focal, near, unit, reach, largest, span;
in uint row;
out vec2 place;
out vec4 colour;
void main() {
  ivec2 at = ivec2(row & 1023u, row >> 10);
  vec3 p = axes * (unit * sinh(reach / 32767.0 * vec3(texelFetch(means, at, 0).xyz)) - eye);
  colour = texelFetch(paint, at, 0);
  colour.a *= colour.a;
  gl_Position = vec4(2, 2, 2, 1);
  if (p.z <= near || 255.0 * colour.a < 1.0) return;

  // The covariance on the screen: EWA, as in gspure's renderer.
  vec4 q = normalize(texelFetch(quats, at, 0));
  vec3 v = q.yzw, s = exp(largest - span * (1.0 - texelFetch(scales, at, 0).xyz));
  mat3 cross = mat3(0, v.z, -v.y, -v.z, 0, v.x, v.y, -v.x, 0);
  mat3 turn = mat3(1) + 2.0 * (q.x * cross + cross * cross);
  mat3 m = transpose(axes * turn * mat3(s.x, 0, 0, 0, s.y, 0, 0, 0, s.z));
  vec2 limit = 0.65 * size / focal, slope = clamp(p.xy / p.z, -limit, limit);
  vec3 x = focal / p.z * (m[0] - slope.x * m[2]), y = focal / p.z * (m[1] - slope.y * m[2]);
  float xx = dot(x, x) + 0.3, xy = dot(x, y), yy = dot(y, y) + 0.3;
  float apart = length(vec2(0.5 * (xx - yy), xy)), mean = 0.5 * (xx + yy), angle = 0.5 * atan(2.0 * xy, xx - yy);
  vec2 deviation = sqrt(vec2(mean + apart, max(mean - apart, 0.3))), along = vec2(cos(angle), sin(angle));
  place = sqrt(2.0 * log(255.0 * colour.a)) * vec2(2 * (gl_VertexID & 1) - 1, 2 * (gl_VertexID >> 1) - 1);
  vec2 pixel = focal * p.xy / p.z + mat2(along, -along.y, along.x) * (deviation * place);
  gl_Position = vec4(2.0 * (middle + pixel) / size * vec2(1, -1), 0, 1);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
in vec4 colour;
out vec4 light;
void main() {
  float alpha = min(0.99, colour.a * exp(-0.5 * dot(place, place)));
  if (255.0 * alpha < 1.0) discard;
  light = vec4(colour.rgb * alpha, alpha);
}`;
const WIDTH = 1024, NEAR = 0.2, DEPTHS = 65536, COARSE = 4;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a, t, b) => a.map((value, i) => value + t * b[i]);
function turned(vector, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), along = dot(axis, vector) * (1 - c);
  return vector.map((value, i) => {
    const j = (i + 1) % 3, k = (i + 2) % 3;
    return c * value + s * (axis[j] * vector[k] - axis[k] * vector[j]) + along * axis[i];
  });
}
const percent = share => {  // 0% and 100% are exact, as in gspure.text
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

async function inflated(text) {
  const packed = atob(text), bytes = new Uint8Array(packed.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

// Upload a cloud's arrays, which lie one after the other, as textures.
async function uploaded(gl, cloud) {
  const buffer = await inflated(cloud.data), { splats, unit, reach } = cloud, height = Math.ceil(splats / WIDTH);
  let start = 0;
  const next = (Type, width) => {
    const array = new Type(buffer, start, width * splats);
    start += array.byteLength;
    return array;
  };
  const texture = (array, internal, format, type) => {
    const filled = new array.constructor(WIDTH * height * array.length / splats);
    filled.set(array);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, WIDTH, height, 0, format, type, filled);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return gl.getParameter(gl.TEXTURE_BINDING_2D);
  };
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const means = next(Int16Array, 3);
  return {
    ...cloud,
    means: Float32Array.from(means, value => unit * Math.sinh(reach / 32767 * value)),
    shapes: [
      texture(means, gl.RGB16I, gl.RGB_INTEGER, gl.SHORT),
      texture(next(Uint8Array, 3), gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE),
      texture(next(Int8Array, 4), gl.RGBA8_SNORM, gl.RGBA, gl.BYTE),
    ],
    paints: Array.from({ length: cloud.paints }, () => texture(next(Uint8Array, 4), gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE)),
  };
}

// The rows from `first` to `last` in front of the eye, from the farthest: a counting sort by the logarithm of the depth.
function sorted({ means }, first, last, forward, eye, near) {
  const depths = new Float32Array(last - first), [x, y, z] = forward, offset = dot(forward, eye);
  let nearest = Infinity, farthest = near;
  for (let i = first, at = 3 * first; i < last; i++, at += 3) {
    const depth = x * means[at] + y * means[at + 1] + z * means[at + 2] - offset;
    depths[i - first] = depth;
    if (depth > near && depth < nearest) nearest = depth;
    if (depth > farthest) farthest = depth;
  }
  const keys = new Uint16Array(depths.length), ends = new Uint32Array(DEPTHS + 1);
  const scale = (DEPTHS - 1) / (Math.log(farthest / nearest) || 1);
  depths.forEach((depth, i) => {
    if (depth <= near) return;
    keys[i] = scale * Math.log(farthest / depth);
    ends[keys[i] + 1]++;
  });
  for (let key = 0; key < DEPTHS; key++) ends[key + 1] += ends[key];
  const rows = new Uint32Array(ends[DEPTHS]);
  depths.forEach((depth, i) => { if (depth > near) rows[ends[keys[i]]++] = first + i; });
  return rows;
}

async function start(form) {
  const canvas = form.querySelector("canvas"), controls = form.elements;
  const gl = canvas.getContext("webgl2", { antialias: false });
  if (!gl) { form.querySelector(".warning").hidden = false; return; }
  const data = JSON.parse(form.querySelector("script").textContent);
  const program = linked(gl), at = Object.fromEntries(Array.from(
    { length: gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) },
    (_, i) => gl.getActiveUniform(program, i).name).map(name => [name, gl.getUniformLocation(program, name)]));
  ["means", "scales", "quats", "paint"].forEach((name, unit) => gl.uniform1i(at[name], unit));
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  const row = gl.getAttribLocation(program, "row");
  gl.enableVertexAttribArray(row);
  gl.vertexAttribIPointer(row, 1, gl.UNSIGNED_INT, 0, 0);
  gl.vertexAttribDivisor(row, 1);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const clouds = [];
  for (const cloud of data.clouds) clouds.push(await uploaded(gl, cloud));
  let mode, view, scheduled = false, stride = COARSE;  // the first frame shows every fourth splat, at once

  const height = () => Math.min(canvas.clientHeight, canvas.clientWidth / view.aspect);  // of the camera's image
  const eye = () => plus(view.target, -view.distance, view.axes[2]);
  function pane([number, paint], left, right) {
    const cloud = clouds[number], near = Math.min(NEAR, view.distance / 10), cut = Number(controls.cut?.value ?? 0);
    const first = cloud.starts[cut] ?? 0, last = mode.name === "pruned" ? cloud.starts[data.decision] : cloud.splats;
    gl.scissor(left, 0, right - left, canvas.height);
    for (const name of ["unit", "reach", "largest", "span"]) gl.uniform1f(at[name], cloud[name]);
    gl.uniform1f(at.near, near);
    [...cloud.shapes, cloud.paints[paint]].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    const rows = sorted(cloud, Math.min(first, last), last, view.axes[2], eye(), near).filter(row => row % stride === 0);
    gl.bufferData(gl.ARRAY_BUFFER, rows, gl.DYNAMIC_DRAW);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, rows.length);
  }
  function draw() {
    scheduled = false;
    canvas.width = canvas.clientWidth * devicePixelRatio;
    canvas.height = canvas.clientHeight * devicePixelRatio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.SCISSOR_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.uniformMatrix3fv(at.axes, true, view.axes.flat());
    gl.uniform3fv(at.eye, eye());
    gl.uniform2f(at.size, canvas.width, canvas.height);
    const scale = height() * devicePixelRatio, [x, y] = view.middle;
    gl.uniform1f(at.focal, view.focal * scale);
    gl.uniform2f(at.middle, x * scale, y * scale);
    const share = mode.panes.length > 1 ? controls.divider.value / 100 : 1;
    const divider = Math.round(canvas.width * share);
    pane(mode.panes[0], 0, divider);
    if (mode.panes.length > 1) pane(mode.panes[1], divider, canvas.width);
    if (stride > 1) redraw();
    stride = 1;
  }
  const redraw = () => { if (!scheduled) scheduled = requestAnimationFrame(draw); };

  function choose() {
    mode = data.modes[controls.mode ? controls.mode.value : 0];
    canvas.style.background = mode.backdrop ?? "";
    form.querySelector(".key").replaceChildren(...(mode.legend ?? []).map(([label, colour]) => {
      const entry = document.createElement("span"), patch = document.createElement("i");
      patch.style.background = colour;
      entry.append(...colour === "none" ? [] : [patch], label);
      return entry;
    }));
    redraw();
  }
  function prune() {
    const cut = Number(controls.cut.value);
    form.classList.toggle("decided", cut === data.decision);
    for (const [name, shares] of Object.entries(data.removed)) {
      form.querySelector(`.bars .${name}`).style.setProperty("--share", shares[cut]);
      controls[name].value = percent(shares[cut]);
    }
    redraw();
  }
  function look() {
    const preset = data.cameras.views[controls.camera.value];
    view = { ...preset, target: plus(preset.eye, preset.distance, preset.axes[2]) };
    redraw();
  }

  function zoom(factor) { view.distance = Math.max(view.distance * factor, 1e-6); redraw(); }
  function move(dx, dy) {
    const step = view.distance / (view.focal * height());
    view.target = plus(plus(view.target, -step * dx, view.axes[0]), -step * dy, view.axes[1]);
    redraw();
  }
  function rotate(dx, dy) {
    const { up } = data.cameras, raised = dot(view.axes[2], up);
    view.axes = view.axes.map(axis => turned(axis, up, -0.008 * dx));
    if (Math.abs(raised) < 0.99 || raised * dy > 0) {
      const [right] = view.axes;
      view.axes = view.axes.map(axis => turned(axis, right, -0.008 * dy));
    }
    redraw();
  }

  const fingers = new Map();
  canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
  };
  canvas.onpointermove = event => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
    const apart = () => { const [a, b] = fingers.values(); return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
    const before = fingers.size > 1 && apart();
    fingers.set(event.pointerId, event);
    if (before) zoom(before / apart());
    if (before) move(dx / 2, dy / 2);
    else if (event.shiftKey || event.buttons > 1) move(dx, dy);
    else rotate(dx, dy);
  };
  canvas.onpointerup = canvas.onpointercancel = event => fingers.delete(event.pointerId);
  canvas.oncontextmenu = event => event.preventDefault();
  canvas.onwheel = event => {
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(event.deltaY * 0.001));
  };
  const fill = () => document.fullscreenElement ? document.exitFullscreen() : form.requestFullscreen();
  canvas.onkeydown = event => {
    const steps = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
    const act = { "+": () => zoom(0.9), "-": () => zoom(1.1), "0": look, f: fill }[event.key];
    if (event.ctrlKey || event.metaKey || !(steps || act)) return;
    event.preventDefault();
    if (act) act();
    else (event.shiftKey ? move : rotate)(...steps);
  };
  for (const choice of form.querySelectorAll("[name=mode]")) choice.onchange = choose;
  controls.camera.onchange = controls.reset.onclick = look;
  controls.fill.onclick = fill;
  controls.fill.hidden = !document.fullscreenEnabled;
  document.addEventListener("fullscreenchange", () => {
    controls.fill.textContent = document.fullscreenElement === form ? "exit" : "full screen";
  });
  if (controls.divider) controls.divider.oninput = redraw;
  if (controls.cut) {
    controls.cut.oninput = prune;
    controls.decision.onclick = () => { controls.cut.value = data.decision; prune(); };
  }
  look();
  choose();
  if (controls.cut) prune();
  new ResizeObserver(redraw).observe(canvas);
}

// Each view starts when it is first seen: a browser keeps few WebGL contexts.
const viewers = new IntersectionObserver(entries => {
  for (const { target } of entries.filter(entry => entry.isIntersecting)) {
    viewers.unobserve(target);
    start(target);
  }
});
for (const form of document.querySelectorAll(".viewer")) viewers.observe(form);
