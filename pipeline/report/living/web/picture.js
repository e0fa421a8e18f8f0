"use strict";
// What the eye sees, ray by ray in a fragment shader: for every pixel its polynomials of the pupil (beam.js), made at the
// corners of a mesh and interpolated over it, then the scene. Rays add up in a float texture.

const meshCells = 20;

const vertexShader = (terms) => `#version 300 es
precision highp float;
uniform sampler2D coefficients;
${Array.from({ length: terms }, (_, t) => `out vec4 c${t};`).join("\n")}
out vec4 weight_a, weight_b;  // the last two of weight_b: the place in the field, -1 to 1
void main() {
  int cells = ${meshCells}, vertex = gl_VertexID;
  vec2 share = vec2(float(vertex % (cells + 1)), float(vertex / (cells + 1))) / float(cells);
  gl_Position = vec4(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y, 0.0, 1.0);
  ${Array.from({ length: terms }, (_, t) => `c${t} = texelFetch(coefficients, ivec2(${t}, vertex), 0);`).join("\n  ")}
  weight_a = texelFetch(coefficients, ivec2(${terms}, vertex), 0);
  weight_b = vec4(texelFetch(coefficients, ivec2(${terms + 1}, vertex), 0).xy, 2.0 * share - 1.0);
}`;

/// Horner's scheme over terms x^i y^j that are numbered with i rising, for j = 0 ... degree; those of first order are the
/// wavelength's own.
function horner(degree) {
  const numbered = new Map(exponents(degree).map(([i, j], t) => [`${i},${j}`, `${i + j < 2 ? "k" : "c"}${t}`]));
  let text = "";
  for (let j = degree; j >= 0; --j) {
    let row = numbered.get(`${degree - j},${j}`);
    for (let i = degree - j - 1; i >= 0; --i) row = `(${row} * p.x + ${numbered.get(`${i},${j}`)})`;
    text = text === "" ? row : `(${text} * p.y + ${row})`;
  }
  return text;
}

/// waves: how many wavelengths share the pass; beyond one each differs from the mesh's by `difference`.
const fragmentShader = ({ degree, waves, diffraction, receptors, planes }) => `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
${exponents(degree).map((_, t) => `in vec4 c${t};`).join("\n")}
in vec4 weight_a, weight_b;
uniform uint first, seed;
uniform int samples, width;
uniform float plane;
uniform mat3 rgb_from_rgb[${waves}];
uniform vec3 background;
${waves > 1 ? `uniform vec4 difference[${5 * waves}];` : ""}
${receptors ? "uniform float falloff;" : ""}
${diffraction ? `uniform sampler2D airy;\nuniform float airy_angle[${waves}];` : ""}
${planes.map((_, k) => `uniform sampler2D texture_${k};\nuniform vec4 plane_${k}, right_${k}, up_${k};`).join("\n")}
out vec4 light;

uint scramble(uint h) {  // PCG, O'Neill 2014
  h = h * 747796405u + 2891336453u;
  uint w = ((h >> ((h >> 28u) + 4u)) ^ h) * 277803737u;
  return (w >> 22u) ^ w;
}
float unit_interval(uint h) { return float(h >> 8) * (1.0 / 16777216.0); }

vec3 look(vec3 at, vec3 to) {
  vec3 seen = background;
  float nearest = 1e30;
${planes.map((grey, k) => `  {
    float t = (plane_${k}.w - dot(plane_${k}.xyz, at)) / dot(plane_${k}.xyz, to);
    vec4 hit = vec4(at + t * to, 1.0);
    vec2 place = vec2(dot(right_${k}, hit), dot(up_${k}, hit));
    if (t > 0.0 && t < nearest && max(abs(place.x), abs(place.y)) <= 1.0) {
      nearest = t;
      seen = textureLod(texture_${k}, 0.5 + 0.5 * place, 0.0).${grey ? "rrr" : "rgb"};
    }
  }`).join("\n")}
  return seen;
}

/// Light of one wavelength at a pixel.
vec4 gather(int wave, vec4 k0, vec4 k1, vec4 k${degree + 1}, uint shift_1, uint shift_2) {
  vec4 sum = vec4(0.0);
  for (int s = 0; s < samples; ++s) {
    uint n = first + uint(wave * samples + s);
    float rho2 = unit_interval(n * 3242174889u + shift_1), angle = 6.2831853 * unit_interval(n * 2447445414u + shift_2);
    vec2 p = sqrt(rho2) * vec2(cos(angle), sin(angle));
    vec4 ray = ${horner(degree)};
    float weight = weight_a.x + p.x * (weight_a.y + p.x * weight_a.z + p.y * weight_b.x) + p.y * (weight_a.w + p.y * weight_b.y);
    ${receptors ? "weight *= exp2(-falloff * rho2);" : ""}
    vec3 at = vec3(ray.xy, plane), to = vec3(ray.zw, 1.0);
    ${diffraction ? `to = normalize(to);
    float share = min(1.0 - 1.0 / 4096.0, unit_interval(n * 1779033704u + scramble(shift_2)));
    float place = sqrt(share) * 1024.0;
    int step = int(min(1023.0, place));
    float theta = airy_angle[wave] * mix(texelFetch(airy, ivec2(step, 0), 0).x, texelFetch(airy, ivec2(step + 1, 0), 0).x, place - float(step)) / (1.0 - share);
    float turn = 6.2831853 * unit_interval(n * 3144134277u + scramble(scramble(shift_2)));
    vec2 bend = theta * vec2(cos(turn), sin(turn));
    float a = 1.0 / (1.0 + to.z), b = to.x * to.y * a;
    to = vec3(to.x + bend.x * (1.0 - to.x * to.x * a) - bend.y * b, to.y + bend.y * (1.0 - to.y * to.y * a) - bend.x * b, to.z - bend.x * to.x - bend.y * to.y);` : ""}
    sum += weight * vec4(look(at, to), 1.0);
  }
  return vec4(rgb_from_rgb[wave] * sum.rgb, sum.a);
}

void main() {
  uint shift_1 = scramble(uint(int(gl_FragCoord.y) * width + int(gl_FragCoord.x)) ^ seed), shift_2 = scramble(shift_1);
  light = vec4(0.0);
${Array.from({ length: waves }, (_, wave) => waves === 1 ? `  light += gather(0, c0, c1, c${degree + 1}, shift_1, shift_2);`
    : `  light += gather(${wave}, c0 + difference[${5 * wave}] + weight_b.z * difference[${5 * wave + 3}] + weight_b.w * difference[${5 * wave + 4}],
    c1 + difference[${5 * wave + 1}], c${degree + 1} + difference[${5 * wave + 2}], shift_1, shift_2);`).join("\n")}
}`;

const showVertices = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
const showPixels = `#version 300 es
precision highp float;
uniform sampler2D image;
out vec4 colour;
void main() {
  vec4 light = texelFetch(image, ivec2(gl_FragCoord.xy), 0);
  vec3 linear = clamp(light.rgb / max(light.a, 1e-6), 0.0, 1.0);
  colour = vec4(mix(12.92 * linear, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, linear)), 1.0);
}`;

/// The WebGL side of one canvas.
class Picture {
  /// Throws where the browser cannot.
  constructor(canvas, airy) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    if (!gl.getExtension("EXT_color_buffer_float") || !gl.getExtension("EXT_float_blend"))
      throw new Error("this browser's WebGL cannot add up light in floating point");
    this.gl = gl;
    this.programs = new Map();
    this.textures = new Map();
    // Polynomials of degree 6 need 30 vectors; what has fewer (15 are certain) gets those of degree 3, and misses rays by more.
    while (exponents(polynomials.largestDegree).length + 2 > gl.getParameter(gl.MAX_VARYING_VECTORS)) polynomials.largestDegree -= 1;
    const indices = [];
    for (let row = 0; row < meshCells; ++row)
      for (let column = 0; column < meshCells; ++column) {
        const corner = row * (meshCells + 1) + column, below = corner + meshCells + 1;
        indices.push(corner, below, corner + 1, corner + 1, below, below + 1);
      }
    gl.bindVertexArray(gl.createVertexArray());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(indices), gl.STATIC_DRAW);
    this.indexCount = indices.length;
    this.sums = { width: 0, texture: gl.createTexture(), buffer: gl.createFramebuffer() };
    this.coefficients = this.floatTexture();
    this.airy = this.floatTexture();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, airy.length, 1, 0, gl.RED, gl.FLOAT, airy);  // AIRY_STEPS + 1 of kernels/light.cl
    this.shown = this.link(showVertices, showPixels);
  }

  floatTexture(texture = this.gl.createTexture()) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    return texture;
  }

  link(vertices, pixels) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertices], [gl.FRAGMENT_SHADER, pixels]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`a shader does not link: ${gl.getProgramInfoLog(program)}`);
    const places = new Map();
    return { program, place: (name) => {
      if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
      return places.get(name);
    } };
  }

  /// A picture of the scene as a texture, made once.
  textureOf(picture) {
    if (this.textures.has(picture)) return this.textures.get(picture);
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    if (picture.linear) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, gl.RED, gl.UNSIGNED_BYTE, picture.image);
    } else {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, picture.image);
    }
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    this.textures.set(picture, texture);
    return texture;
  }

  begin(width) {
    const gl = this.gl;
    if (this.sums.width !== width) {
      this.floatTexture(this.sums.texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, width, 0, gl.RGBA, gl.FLOAT, null);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.sums.buffer);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.sums.texture, 0);
      this.sums.width = width;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.sums.buffer);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /// Adds rays to rows `from` to `to` (shares of the height) of the picture.
  /// view: { mesh, scene, waves: [{ matrix, airy_angle, difference }], falloff }
  add(view, first, samples, { seed = 1, from = 0, to = 1 } = {}) {
    const gl = this.gl, { mesh, scene, waves } = view, grey = scene.planes.map((plane) => !!plane.picture.linear);
    const form = { degree: mesh.degree, waves: waves.length, diffraction: !!waves[0].airy_angle, receptors: !!view.falloff, planes: grey };
    const key = JSON.stringify(form);
    if (!this.programs.has(key)) this.programs.set(key, this.link(vertexShader(exponents(mesh.degree).length), fragmentShader(form)));
    const { program, place } = this.programs.get(key);
    gl.useProgram(program);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.sums.buffer);
    gl.viewport(0, 0, this.sums.width, this.sums.width);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.coefficients);
    if (this.loaded !== mesh) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, mesh.rowTexels, (meshCells + 1) ** 2, 0, gl.RGBA, gl.FLOAT, mesh.values);
      this.loaded = mesh;
    }
    gl.uniform1i(place("coefficients"), 0);
    gl.uniform1ui(place("first"), first);
    gl.uniform1ui(place("seed"), seed);
    gl.uniform1i(place("samples"), samples);
    gl.uniform1i(place("width"), this.sums.width);
    gl.uniform1f(place("plane"), mesh.plane_mm);
    gl.uniformMatrix3fv(place("rgb_from_rgb"), true, waves.flatMap((wave) => wave.matrix));
    gl.uniform3fv(place("background"), scene.background);
    if (waves.length > 1) gl.uniform4fv(place("difference"), waves.flatMap((wave) => wave.difference));
    if (view.falloff) gl.uniform1f(place("falloff"), view.falloff);
    if (form.diffraction) {
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, this.airy);
      gl.uniform1i(place("airy"), 1);
      gl.uniform1fv(place("airy_angle"), waves.map((wave) => wave.airy_angle));
    }
    scene.planes.forEach((plane, k) => {
      gl.activeTexture(gl.TEXTURE2 + k);
      gl.bindTexture(gl.TEXTURE_2D, this.textureOf(plane.picture));
      gl.uniform1i(place(`texture_${k}`), 2 + k);
      // A normal and its height; then what takes a point to -1..1 across the picture, downwards.
      const { centre, right, up } = plane, over = (half, sign) => half.map((c) => sign * c / dot(half, half));
      const normal = unit([right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2], right[0] * up[1] - right[1] * up[0]]);
      gl.uniform4f(place(`plane_${k}`), ...normal, dot(normal, centre));
      for (const [name, across] of [["right", over(right, 1)], ["up", over(up, -1)]]) gl.uniform4f(place(`${name}_${k}`), ...across, -dot(across, centre));
    });
    const bottom = Math.round((1 - to) * this.sums.width);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, bottom, this.sums.width, Math.round((1 - from) * this.sums.width) - bottom);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    gl.drawElements(gl.TRIANGLES, this.indexCount, gl.UNSIGNED_SHORT, 0);
    gl.disable(gl.BLEND);
    gl.disable(gl.SCISSOR_TEST);
  }

  /// Onto the canvas.
  show() {
    const gl = this.gl;
    if (this.canvas.width !== this.sums.width) this.canvas.width = this.canvas.height = this.sums.width;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.sums.width, this.sums.width);
    gl.useProgram(this.shown.program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.sums.texture);
    gl.uniform1i(this.shown.place("image"), 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /// Waits until everything is drawn.
  finish() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.sums.buffer);
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.FLOAT, new Float32Array(4));
  }

  /// Linear light, red green blue, row after row from the top.
  linear() {
    const gl = this.gl, size = this.sums.width, raw = new Float32Array(4 * size * size), out = new Float32Array(3 * size * size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.sums.buffer);
    gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, raw);
    for (let row = 0; row < size; ++row)
      for (let column = 0; column < size; ++column) {
        const from = 4 * ((size - 1 - row) * size + column), to = 3 * (row * size + column);
        for (let c = 0; c < 3; ++c) out[to + c] = raw[from + c] / Math.max(raw[from + 3], 1e-6);
      }
    return { width: size, height: size, data: out };
  }
}
