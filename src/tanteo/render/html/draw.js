"use strict";
/* The picture: an orthographic view with WebGL 2. No library; everything it draws is in the page's data.
   Lengths are millimetres in the world, relative to the middle of the scene. */

const SHADERS = {
  mesh: [`#version 300 es
    uniform mat4 model, view; in vec3 place; out vec3 seen;
    void main() { vec4 p = view * model * vec4(place, 1.0); seen = p.xyz; gl_Position = p; }`,
  `#version 300 es
    precision highp float; uniform vec4 colour; uniform vec3 scale; in vec3 seen; out vec4 shown;
    void main() {
      vec3 p = seen / scale, n = normalize(cross(dFdx(p), dFdy(p)));
      float light = dot(vec3(n.xy, abs(n.z)), normalize(vec3(-0.55, 0.62, 0.56)));
      shown = vec4(colour.rgb * (0.6 + 0.5 * max(light, 0.0)), colour.a);
    }`],
  line: [`#version 300 es
    uniform mat4 model, view; uniform vec2 pixels; uniform float width;
    in vec3 from, to; in vec2 corner; out float along;
    void main() {
      vec4 a = view * model * vec4(from, 1.0), b = view * model * vec4(to, 1.0);
      vec2 d = (b.xy - a.xy) * pixels; float l = length(d);
      vec2 across = l > 0.0 ? vec2(-d.y, d.x) / l : vec2(0.0);
      vec4 p = mix(a, b, corner.x); p.xy += across * corner.y * width / pixels; along = corner.x * l;
      gl_Position = p;
    }`,
  `#version 300 es
    precision highp float; uniform vec4 colour; uniform float dash; in float along; out vec4 shown;
    void main() { if (dash > 0.0 && mod(along, 2.0 * dash) > dash) discard; shown = colour; }`],
  point: [`#version 300 es
    uniform mat4 view; uniform float size, zoom; in vec3 place; in float radius; in float sort; out float kind;
    void main() { gl_Position = view * vec4(place, 1.0); kind = sort; gl_PointSize = max(size * (1.0 + 0.5 * sort), radius * zoom * 2.0); }`,
  `#version 300 es
    precision highp float; uniform vec4 good, bad; in float kind; out vec4 shown;
    void main() {
      vec2 p = 2.0 * gl_PointCoord - 1.0; float r = length(p);
      if (kind < 0.5) { if (r > 1.0) discard; shown = r > 0.72 ? vec4(1.0, 1.0, 1.0, good.a) : good; }
      else { float d = min(abs(p.x - p.y), abs(p.x + p.y)); if (d > 0.42 || r > 1.1) discard; shown = d > 0.26 ? vec4(1.0, 1.0, 1.0, bad.a) : bad; }
    }`],
};

const unpack = (text, Kind) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
};
const IDENTITY = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

function makeProgram(gl, [vertex, fragment]) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(program, i);
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms, at: (name) => gl.getAttribLocation(program, name) };
}

function buffer(gl, array, target = gl.ARRAY_BUFFER) {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, array, gl.STATIC_DRAW);
  return made;
}

/* Where we look from: angles, millimetres a pixel, what is in the middle. */
const VIEWS = { reset: [-0.95, 0.5], top: [-Math.PI / 2, Math.PI / 2], front: [-Math.PI / 2, 0], side: [0, 0] };

function axesOf({ turn, tilt }) {
  const [ct, st, cp, sp] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
  return { right: [-st, ct, 0], up: [-ct * sp, -st * sp, cp], back: [ct * cp, st * cp, sp] };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

class Picture {
  constructor(canvas, overlay, data) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!gl) throw new Error("no WebGL 2");
    Object.assign(this, { canvas, overlay, data, gl, chosen: 0, way: "0", picked: -1, waiting: false });
    this.layers = {};
    this.programs = Object.fromEntries(Object.entries(SHADERS).map(([k, s]) => [k, makeProgram(gl, s)]));
    this.corners = buffer(gl, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]));
    this.parts = data.parts.map((part) => this.partBuffers(part));
    this.points = unpack(data.readings.points, Float32Array);
    this.starts = unpack(data.readings.starts, Float32Array);
    this.beams = this.lineBuffers(interleave(this.starts, this.points));
    if (data.arrows) this.heads = this.meshBuffers(...cones(this.starts, this.points, 0.04 * data.size_mm));
    if (data.next) {
      const [start, point] = ["start", "point"].map((end) => unpack(data.next[end], Float32Array));
      this.next = { start, point, line: this.lineBuffers(interleave(start, point)), head: this.meshBuffers(...cones(start, point, 0.06 * data.size_mm)) };
    }
    this.free = this.lineBuffers(unpack(data.free, Float32Array));
    if (data.features) {
      this.features = this.lineBuffers(unpack(data.features.lines, Float32Array));
      this.featuresOff = this.lineBuffers(unpack(data.features.off, Float32Array));
    }
    this.pointBuffer = buffer(gl, this.points);
    this.radiusBuffer = buffer(gl, unpack(data.readings.radii, Float32Array));
    this.poses = data.hypotheses.map((h) => ({
      sticks: this.lineBuffers(unpack(h.sticks, Float32Array)), sorts: buffer(gl, new Float32Array(h.wrong)),
      differs: h.differs && this.facesOf(this.parts[h.part], unpack(h.differs, Uint32Array)),
    }));
    this.nothingWrong = buffer(gl, new Float32Array(this.points.length / 3));
    this.look("reset");
    new ResizeObserver(() => this.redraw()).observe(canvas);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  partBuffers(part) {
    const mesh = this.meshBuffers(unpack(part.vertices, Float32Array), unpack(part.triangles, Uint32Array));
    return { ...mesh, lines: this.lineBuffers(unpack(part.lines, Float32Array)) };
  }

  meshBuffers(places, triangles) {
    const gl = this.gl;
    return { places: buffer(gl, places), triangles: buffer(gl, triangles, gl.ELEMENT_ARRAY_BUFFER), count: triangles.length };
  }

  /* Some triangles of a part. */
  facesOf(part, triangles) {
    const { gl } = this;
    return { places: part.places, triangles: buffer(gl, triangles, gl.ELEMENT_ARRAY_BUFFER), count: triangles.length };
  }

  lineBuffers(ends) { return { ends: buffer(this.gl, ends), count: ends.length / 6 }; }

  look(name) {
    const [turn, tilt] = (name === "reset" && this.data.look) || VIEWS[name];
    const scale = this.data.size_mm * Math.max(1.18 / (this.canvas.clientWidth || 400), 0.98 / (this.canvas.clientHeight || 400));
    this.eye = { turn, tilt, scale, middle: [0, 0, 0] };
    this.fit(new Float32Array([...unpack(this.data.seen, Float32Array), ...(this.next ? [...this.next.start, ...this.next.point] : [])]));
    this.redraw();
  }

  /* Places in the middle and as large as they go, with room for words. */
  fit(places) {
    const { right, up } = axesOf(this.eye), spans = [right, up].map((axis) => {
      const along = Array.from({ length: places.length / 3 }, (_, i) => dot(axis, places.slice(3 * i, 3 * i + 3)));
      return [Math.min(...along), Math.max(...along)];
    });
    const [[left, most], [low, high]] = spans, { clientWidth: w, clientHeight: h } = this.canvas;
    this.eye.scale = Math.max((most - left) / ((w || 400) - 90), (high - low) / ((h || 400) - 90));
    this.eye.middle = right.map((r, i) => (r * (left + most) + up[i] * (low + high)) / 2);
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  /* Clip coordinates: x and y over half the canvas, depth over the scene. Column by column. */
  viewMatrix() {
    const { right, up, back } = axesOf(this.eye), { scale, middle } = this.eye;
    const w = (scale * this.canvas.clientWidth) / 2, h = (scale * this.canvas.clientHeight) / 2, d = 8 * this.data.size_mm;
    this.half = [w, h, d];
    const m = new Float32Array(16);
    for (let i = 0; i < 3; i++) { m[4 * i] = right[i] / w; m[4 * i + 1] = up[i] / h; m[4 * i + 2] = -back[i] / d; }
    m[12] = -dot(right, middle) / w; m[13] = -dot(up, middle) / h; m[14] = dot(back, middle) / d; m[15] = 1;
    return m;
  }

  /* Pixels of the page, from the upper left corner of the canvas. */
  project(p) {
    const { right, up } = axesOf(this.eye), { scale, middle } = this.eye;
    const q = [p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]];
    return [this.canvas.clientWidth / 2 + dot(right, q) / scale, this.canvas.clientHeight / 2 - dot(up, q) / scale];
  }

  colour(name, alpha = 1) {
    const hex = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255).concat(alpha);
  }

  draw() {
    const { gl, canvas } = this, dpr = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(canvas.clientWidth * dpr), Math.round(canvas.clientHeight * dpr)];
    if (!w || !h) return;
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
    gl.viewport(0, 0, w, h);
    gl.clearColor(...this.colour("panel"));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    this.view = this.viewMatrix(); this.dpr = dpr;
    const now = this.data.hypotheses[this.chosen];
    if (now) this.drawPart(this.parts[now.part], new Float32Array(now.pose), this.poses[this.chosen]?.differs);
    if (this.heads && this.layers.readings) {
      this.hiddenToo((faint) => {
        this.drawLines(this.beams, IDENTITY, this.colour("good", faint ? 0.25 : 1), 2.4);
        this.drawMesh(this.heads, IDENTITY, this.colour("good", faint ? 0.25 : 1));
      });
    }
    if (this.layers.beams) {
      this.hiddenToo((faint) => this.drawLines(this.beams, IDENTITY, this.colour("beam", faint ? 0.2 : 0.85), 1.3));
      this.hiddenToo((faint) => this.drawLines(this.free, IDENTITY, this.colour("free", faint ? 0.2 : 0.9), 1.3, 6));
    }
    if (this.next && this.layers.next) {
      this.hiddenToo((faint) => {
        this.drawLines(this.next.line, IDENTITY, this.colour("next", faint ? 0.35 : 1), 3);
        this.drawMesh(this.next.head, IDENTITY, this.colour("next", faint ? 0.35 : 1));
      });
    }
    if (now && this.layers.sticks) {
      this.hiddenToo((faint) => this.drawLines(this.poses[this.chosen].sticks, IDENTITY, this.colour("stick", faint ? 0.25 : 1), 3.2));
    }
    if (this.features && this.layers.features) {
      this.hiddenToo((faint) => this.drawLines(this.featuresOff, IDENTITY, this.colour("feature", faint ? 0.15 : 0.45), 1));
      this.hiddenToo((faint) => this.drawLines(this.features, IDENTITY, this.colour("feature", faint ? 0.4 : 1), 3));
    }
    if (now && this.way !== "") this.drawGhosts(now);
    if (this.layers.readings && !this.heads) this.hiddenToo((faint) => this.drawPoints(faint ? 0.3 : 1));
    this.drawOverlay(now);
  }

  /* The picture as an image, in the colours of paper. */
  still() {
    document.documentElement.dataset.paper = "";
    this.draw();
    const image = this.canvas.toDataURL("image/png");
    delete document.documentElement.dataset.paper;
    this.redraw();
    return image;
  }

  drawPart(part, pose, differs) {
    const { gl } = this;
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1.5, 2);
    this.drawMesh(part, pose, this.colour("part"));
    if (differs) { gl.depthFunc(gl.LEQUAL); this.drawMesh(differs, pose, this.colour("differs")); }
    gl.disable(gl.POLYGON_OFFSET_FILL);
    this.drawLines(part.lines, pose, this.colour("edge", 0.9), 1.1);
  }

  drawMesh(mesh, pose, colour) {
    const { gl } = this, { program, uniforms, at } = this.programs.mesh;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.model, false, pose);
    gl.uniformMatrix4fv(uniforms.view, false, this.view);
    gl.uniform4fv(uniforms.colour, colour);
    gl.uniform3f(uniforms.scale, 1 / this.half[0], 1 / this.half[1], -1 / this.half[2]);
    this.attribute(at("place"), mesh.places, 3);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
  }

  drawGhosts(now) {
    const { gl } = this, part = this.parts[now.part];
    gl.depthMask(false);
    now.overlays[Number(this.way)].forEach((level, k) => level.forEach((pose) => {
      this.drawLines(part.lines, new Float32Array(pose), this.colour("overlay", [0.9, 0.5, 0.28][k]), 0.9);
    }));
    gl.depthMask(true);
  }

  /* What the part hides is drawn as well, faintly. */
  hiddenToo(draw) {
    const { gl } = this;
    gl.depthMask(false); gl.depthFunc(gl.GREATER); draw(true);
    gl.depthMask(true); gl.depthFunc(gl.LEQUAL); draw(false);
  }

  attribute(at, made, size, stride = 0, offset = 0, each = 0) {
    const { gl } = this;
    if (at < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset);
    gl.vertexAttribDivisor(at, each);
  }

  drawLines(lines, pose, colour, width, dash = 0) {
    if (!lines.count) return;
    const { gl, dpr } = this, { program, uniforms, at } = this.programs.line;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.model, false, pose);
    gl.uniformMatrix4fv(uniforms.view, false, this.view);
    gl.uniform2f(uniforms.pixels, this.canvas.width / 2, this.canvas.height / 2);
    gl.uniform1f(uniforms.width, (width * dpr) / 2 + 0.25);
    gl.uniform1f(uniforms.dash, dash * dpr);
    gl.uniform4fv(uniforms.colour, colour);
    this.attribute(at("corner"), this.corners, 2);
    this.attribute(at("from"), lines.ends, 3, 24, 0, 1);
    this.attribute(at("to"), lines.ends, 3, 24, 12, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lines.count);
    for (const name of ["from", "to"]) gl.vertexAttribDivisor(at(name), 0);
  }

  drawPoints(alpha) {
    const { gl, dpr } = this, { program, uniforms, at } = this.programs.point;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.view, false, this.view);
    gl.uniform1f(uniforms.size, 9 * dpr);
    gl.uniform1f(uniforms.zoom, dpr / this.eye.scale);
    gl.uniform4fv(uniforms.good, this.colour("good", alpha));
    gl.uniform4fv(uniforms.bad, this.colour("bad", alpha));
    this.attribute(at("place"), this.pointBuffer, 3);
    this.attribute(at("radius"), this.radiusBuffer, 1);
    this.attribute(at("sort"), this.poses.length ? this.poses[this.chosen].sorts : this.nothingWrong, 1);
    gl.drawArrays(gl.POINTS, 0, this.points.length / 3);
  }

  place(i) { return this.points.slice(3 * i, 3 * i + 3); }

  /* Where the name of a reading belongs: at the beginning of an arrow, else at the reading. */
  nameAt(i) { return this.heads ? this.starts.slice(3 * i, 3 * i + 3) : this.place(i); }

  /* The reading nearest to a place of the canvas, -1 for none within reach of a finger. */
  nearest(x, y, reach = 16) {
    let best = -1, least = reach;
    for (let i = 0; i < this.points.length / 3; i++) {
      const to = (p) => { const [px, py] = this.project(p); return Math.hypot(px - x, py - y); };
      const d = Math.min(to(this.place(i)), to(this.nameAt(i)));
      if (d < least) [best, least] = [i, d];
    }
    return best;
  }

  drawOverlay(now) {
    const { clientWidth: w, clientHeight: h } = this.canvas, marks = [];
    const { right, up } = axesOf(this.eye), o = [46, h - 46];
    "xyz".split("").forEach((name, i) => {
      const d = [right[i], -up[i]];
      marks.push(line(o, [o[0] + 28 * d[0], o[1] + 28 * d[1]]), text(o[0] + 39 * d[0], o[1] + 39 * d[1] + 4, name));
    });
    const wanted = 0.25 * w * this.eye.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const bar = [5, 2, 1].map((m) => m * power).find((m) => m <= wanted), long = bar / this.eye.scale;
    marks.push(line([w - 18 - long, h - 18], [w - 18, h - 18]), text(w - 18 - long / 2, h - 26, `${Number(bar.toPrecision(3))} mm`));
    marks.push(...this.words(now, w, h));
    this.overlay.setAttribute("viewBox", `0 0 ${w} ${h}`);
    this.overlay.replaceChildren(...marks);
  }

  /* Names beside the readings, those that do not fit first, as long as they do not cover each other. */
  words(now, w, h) {
    const taken = [[0, h - 96, 96, h], [w - 0.3 * w, h - 44, w, h]], marks = [];
    if (this.next && this.layers.next) {
      const [[a, b], [c, d]] = [this.next.start, this.next.point].map((end) => this.project(end));
      for (let t = 0; t <= 1; t += 0.1) taken.push([a + t * (c - a) - 3, b + t * (d - b) - 3, a + t * (c - a) + 3, b + t * (d - b) + 3]);
      marks.push(...beside([a, b], "next", "next", taken, w, h));
    }
    if (!this.layers.readings) return marks;
    this.data.readings.names.forEach((_, i) => {
      const [x, y] = this.project(this.place(i));
      taken.push([x - 6, y - 6, x + 6, y + 6]);
    });
    const { names } = this.data.readings, wrong = (i) => Boolean(now && now.wrong[i]);
    names.forEach((name, i) => {
      if (wrong(i)) marks.push(...beside(this.project(this.place(i)), `${name}: ${Math.abs(now.off_mm[i]).toPrecision(3)} mm off`, "wrong", taken, w, h));
    });
    if (this.layers.names) {
      names.forEach((name, i) => { if (!wrong(i)) marks.push(...beside(this.project(this.nameAt(i)), name, "", taken, w, h)); });
    }
    return marks;
  }
}

/* Words at the first place about a point where nothing stands; nowhere, if there is none. */
function beside([x, y], words, kind, taken, w, h) {
  const long = 7.9 * words.length + 2;
  const ring = [9, 22, 38].flatMap((r) => [
    [x + r, y + 4], [x - r - long, y + 4], [x - long / 2, y - r], [x - long / 2, y + r + 11],
    [x + r, y - r], [x - r - long, y - r], [x + r, y + r + 11], [x - r - long, y + r + 11],
  ]);
  for (const [k, [left, base]] of ring.entries()) {
    const box = [left, base - 13, left + long, base + 4];
    const clear = taken.every((t) => box[0] >= t[2] || t[0] >= box[2] || box[1] >= t[3] || t[1] >= box[3]);
    if (!clear || left < 3 || left + long > w - 3 || base < 16 || base > h - 6) continue;
    taken.push(box);
    const word = text(left, base, words, kind, "start");
    const near = [Math.min(Math.max(x, box[0]), box[2]), Math.min(Math.max(y, box[1]), box[3])];
    return k < 8 ? [word] : [svg("line", { x1: x, y1: y, x2: near[0], y2: near[1], class: "leader" }), word];
  }
  return [];
}

/* Heads of arrows: places and triangles of one cone each, its tip at the end. */
function cones(starts, ends, long, sides = 12) {
  const places = [], triangles = [];
  for (let k = 0; k < ends.length; k += 3) {
    const tip = ends.slice(k, k + 3), d = tip.map((v, i) => v - starts[k + i]), l = Math.hypot(...d) || 1;
    const z = d.map((v) => v / l), least = z.map(Math.abs).indexOf(Math.min(...z.map(Math.abs)));
    const x = unit(cross(z, [0, 1, 2].map((i) => Number(i === least)))), y = cross(z, x), first = places.length / 3;
    places.push(...tip, ...tip.map((v, i) => v - long * z[i]));
    for (let j = 0; j < sides; j++) {
      const a = (2 * Math.PI * j) / sides, r = 0.3 * long, next = first + 2 + ((j + 1) % sides);
      places.push(...tip.map((v, i) => v - long * z[i] + r * (Math.cos(a) * x[i] + Math.sin(a) * y[i])));
      triangles.push(first, first + 2 + j, next, first + 1, next, first + 2 + j);
    }
  }
  return [new Float32Array(places), new Uint32Array(triangles)];
}
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (v) => { const l = Math.hypot(...v); return v.map((c) => c / l); };

function interleave(a, b) {
  const out = new Float32Array(2 * a.length);
  for (let i = 0; i < a.length; i += 3) { out.set(a.subarray(i, i + 3), 2 * i); out.set(b.subarray(i, i + 3), 2 * i + 3); }
  return out;
}

function svg(name, attributes) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}
const line = (a, b) => svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] });
function text(x, y, words, kind = "", anchor = "middle") {
  const made = svg("text", { x, y, class: kind, "text-anchor": anchor });
  made.textContent = words;
  return made;
}
