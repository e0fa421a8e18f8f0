"use strict";
// The panel in which an eye looks out of the page: state, controls, pictures. window.emmetrope is its handle.

/// The state as one eye has it: where named lenses are worn each eye has its own.
function stateOf(eye, state) {
  const lens = state.worn && eye.lenses.find((one) => one.name === state.worn);
  return lens ? { ...state, sphere_D: lens.sphere_D, cylinder_D: lens.cylinder_D, axis_deg: lens.axis_deg, vertex_distance_mm: lens.vertex_distance_mm } : state;
}

const hasLens = (eye, name) => eye.lenses.some((lens) => lens.name === name);

const lensOf = (state) => (state.sphere_D || state.cylinder_D || state.prism_D || state.is_thick ? new Lens(state) : null);

/// One eye with its canvas.
class Eye {
  constructor(json, figure, airy) {
    Object.assign(this, json);
    this.map = new EyeMap(json.map, json.bands);
    this.canvas = figure.querySelector("canvas");
    this.picture = new Picture(this.canvas, airy);
    this.meshes = new Map();
  }

  /// Kept while nothing that it depends on changes.
  kept(key, make) {
    if (!this.meshes.has(key)) {
      if (this.meshes.size > 200) this.meshes.delete(this.meshes.keys().next().value);
      this.meshes.set(key, make());
    }
    return this.meshes.get(key);
  }

  /// What the picture is drawn with. Each wave has a mesh of its own, or where `together` all have that of the middle one
  /// and differ from it to first order.
  views(state, scene, waves, together) {
    const field = { x_mm: state.field_x_mm, y_mm: state.field_y_mm, size_mm: state.field_mm };
    const { scene: _, distance_mm, wavelength_nm, scene_follows_gaze, worn, eye, ...optical } = state;
    const key = (...more) => JSON.stringify([optical, ...more]);
    const { pupil_mm, accommodation_D, band, band_share } = state;
    const rays = (nm) => this.kept(JSON.stringify(["rays", nm, accommodation_D, band, band_share]), () => this.map.raysOf({ ...state, wavelength_nm: nm }));
    const bundle = (nm) => this.kept(JSON.stringify(["bundle", nm, pupil_mm, accommodation_D, band, band_share]), () => new Bundle(this.map, state, nm, rays(nm)));
    const beam = (nm) => this.kept(key("beam", nm), () => new Beam(this, state, nm, bundle(nm)));
    const tolerance_arcmin = together ? motionTolerance_arcmin : restTolerance_arcmin;
    const mesh = (nm) => this.kept(key("mesh", nm, tolerance_arcmin), () => beam(nm).mesh(field, state.accommodation_D, tolerance_arcmin));
    const entrance_mm = state.pupil_mm * this.entrance_pupil_magnification;
    const falloff = state.stiles_crawford_per_mm2 * Math.log2(10) * (entrance_mm / 2) ** 2;
    const seen_mm = (nm) => entrance_mm * this.kept(key("magnification", nm), () => beam(nm).pupilMagnification(field.x_mm, field.y_mm));
    const drawn = (wave, difference) => ({ matrix: wave.matrix, difference,
      airy_angle: state.diffraction ? wave.nm * 1e-6 / (Math.PI * seen_mm(wave.nm)) : 0 });
    if (!together) return waves.map((wave) => ({ mesh: mesh(wave.nm), scene, falloff, waves: [drawn(wave)] }));
    const middle = waves[waves.length >> 1].nm;
    return [{ mesh: mesh(middle), scene, falloff, waves: waves.map((wave) => drawn(wave, waves.length > 1
      ? this.kept(key("difference", wave.nm), () => beam(wave.nm).differenceFrom(beam(middle), field)) : null)) }];
  }
}

/// Light by light: what is drawn one after the other, and what each adds to the colour.
function wavesOf(state, wavelengths, groups) {
  const luminance = [0.2126, 0.7152, 0.0722];
  if (state.wavelength_nm) return [{ nm: state.wavelength_nm, matrix: [...luminance, ...luminance, ...luminance] }];
  const together = wavelengths.length / groups;
  return Array.from({ length: groups }, (_, g) => {
    const part = wavelengths.slice(g * together, (g + 1) * together);
    return { nm: part.reduce((sum, wave) => sum + wave.nm, 0) / together,
      matrix: part[0].rgb_from_rgb.map((_, k) => groups * part.reduce((sum, wave) => sum + wave.rgb_from_rgb[k], 0)) };
  });
}

/// After what the reader does has had its turn; timers would wait for 4 ms each time.
const nextTask = (() => {
  const channel = new MessageChannel(), waiting = [];
  channel.port1.onmessage = () => waiting.shift()();
  return () => new Promise((resolve) => { waiting.push(resolve); channel.port2.postMessage(null); });
})();

/// What may be set: [least, most] of a number, a list of what is known, or a test. What depends on the eyes: rangesOf.
const isSwitch = (value) => typeof value === "boolean";
const allowed = { eye: null, scene: null, distance_mm: [100, Infinity], field_mm: [0, Infinity], field_x_mm: [-10, 10], field_y_mm: [-10, 10], sphere_D: [-30, 30],
  cylinder_D: [-15, 15], axis_deg: [0, 360], vertex_distance_mm: [0, 50], prism_D: [0, 20], prism_base_deg: [0, 360], is_thick: isSwitch, base_D: [-5, 20],
  index: [1.3, 2.5], accommodation_D: [0, Infinity], band: (value) => [0, 1, 2].includes(value), band_share: [-1, 1], wavelength_nm: [390, 700], stiles_crawford_per_mm2: [0, 1], diffraction: isSwitch,
  pupil_mm: [0, Infinity], samples: [1, 65536], scene_follows_gaze: isSwitch, worn: [null, "best", "rounded", "known"],
  gaze_deg: (value) => Array.isArray(value) && value.length === 2 && value.every((angle) => Number.isFinite(angle) && Math.abs(angle) <= 45) };

/// [least, most] that all of these eyes have.
function rangesOf(eyes) {
  const least = (of) => Math.min(...eyes.map(of));
  return { pupil_mm: [1, least((eye) => eye.map.pupil_mm)], accommodation_D: [0, least((eye) => eye.map.largest_accommodation_D)],
    field_mm: [0.1, least((eye) => eye.map.field_mm)] };
}

/// \param ranges  named instead of those of any eye
function refuseWrong(change, ranges) {
  for (const [key, value] of Object.entries(change)) {
    if (!(key in allowed)) throw new Error(`there is no ${key}`);
    const range = allowed[key];
    if (range === null || (key === "wavelength_nm" && value === null)) continue;
    const isRange = Array.isArray(range) && typeof range[0] === "number";
    const fits = typeof range === "function" ? range(value) : isRange ? typeof value === "number" && value >= range[0] && value <= range[1] : range.includes(value);
    const [from, to] = ranges[key] ?? (isRange ? range : []);
    if (!fits) throw new Error(`${key} cannot be ${JSON.stringify(value)}${isRange ? `: it is ${from} to ${to}` : ""}`);
  }
}

class Living {
  constructor(panel, data) {
    this.panel = panel;
    this.world = data;
    this.scenes = new Scenes(data.charts);
    const airy = floatsOf(data.airy);
    const pictures = panel.querySelector(".living-pictures");
    this.eyes = data.eyes.map((json) => {
      const figure = document.createElement("figure");
      figure.innerHTML = `<canvas width="512" height="512" role="img" aria-label="What ${json.name} sees"></canvas><figcaption></figcaption>`;
      figure.querySelector("figcaption").textContent = json.name;
      pictures.append(figure);
      const eye = new Eye(json, figure, airy);
      eye.figure = figure;
      return eye;
    });
    this.current = { ...Living.start, eye: this.eyes[0].id, pupil_mm: Math.min(this.eyes[0].pupil_mm, this.eyes[0].map.pupil_mm) };
    this.opening = { ...this.current };
    this.counts = { frames_per_s: 0, rays_per_frame: 0, rays_per_s: 0, width: 0 };
    this.resting = 256;
    this.moving = { width: 256, samples: 16 };
    this.work = 0;
  }

  static start = { scene: "letters", distance_mm: 6000, field_mm: field_mm_of.chart, field_x_mm: 0, field_y_mm: 0, sphere_D: 0, cylinder_D: 0, axis_deg: 0,
    vertex_distance_mm: 12, prism_D: 0, prism_base_deg: 0, is_thick: false, base_D: 4, index: 1.5, accommodation_D: 0, band: 0, band_share: 0,
    gaze_deg: [0, 0], scene_follows_gaze: true, worn: null, wavelength_nm: null, stiles_crawford_per_mm2: 0, diffraction: false };

  eyeOf(id) {
    const found = this.eyes.find((eye) => eye.id === id);
    if (!found) throw new Error(`no eye is called ${id}`);
    return found;
  }

  shownEyes() { return this.current.eye === "both" ? this.eyes : [this.eyeOf(this.current.eye)]; }

  /// As scripts ask: the state after a change; what the eyes that are shown do not have throws.
  asked(change) {
    const next = this.nearest(change);
    for (const key of ["worn", "pupil_mm", "accommodation_D", "band", "band_share", "field_mm", "field_x_mm", "field_y_mm"])
      if (key in change && next[key] !== change[key])
        throw new Error(`${key} cannot be ${JSON.stringify(change[key])} with what is shown: the nearest is ${JSON.stringify(next[key])}`);
    return next;
  }

  set(change) { this.take(this.asked(change)); }

  /// As controls and links ask: the nearest that the eyes shown have.
  approach(change) { this.take(this.nearest(change)); }

  take({ samples = this.resting, ...next }) {
    this.resting = samples;
    this.current = next;
    this.draw();
  }

  /// The state after a change, every value within what the eyes and the scene allow.
  nearest(change) {
    const next = { ...this.current, ...change };
    const eyes = next.eye === "both" ? this.eyes : [this.eyeOf(next.eye)], ranges = rangesOf(eyes);
    refuseWrong(change, ranges);
    // A lens that is dragged is nobody's prescription.
    if (change.worn === undefined && ["sphere_D", "cylinder_D", "axis_deg", "vertex_distance_mm"].some((key) => change[key] !== undefined)) next.worn = null;
    const scene = this.scenes.all.get(next.scene);
    if (!scene) throw new Error(`no scene is called ${next.scene}`);
    if (change.scene && change.scene !== this.current.scene) {
      if (change.distance_mm === undefined) next.distance_mm = scene.distance_mm;
      if (change.field_mm === undefined) next.field_mm = scene.field_mm;
    }
    const within = (value, low, high) => Math.min(high, Math.max(low, value));
    if (!eyes.every((eye) => hasLens(eye, next.worn))) next.worn = null;
    Object.assign(next, stateOf(eyes[0], next));
    next.axis_deg %= 180;
    for (const [key, [low, high]] of Object.entries(ranges)) next[key] = within(next[key], low, high);
    const bands = Math.max(...eyes.map((eye) => eye.bands.length));
    next.band = within(next.band, 0, Math.max(0, bands - 1));
    if (!bands) next.band_share = 0;
    const reach = (ranges.field_mm[1] - next.field_mm) / 2;
    for (const key of ["field_x_mm", "field_y_mm"]) next[key] = within(next[key], -reach, reach);
    return next;
  }

  state() { return { ...this.current, samples: this.resting }; }
  stats() { return { ...this.counts }; }

  wake() {
    this.isAwake = true;
    this.draw();
  }

  /// A quick picture now, and the fine one once nothing moves.
  draw() {
    this.changed?.();
    if (!this.isAwake) return;
    const number = ++this.work;
    clearTimeout(this.settle);
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.quick(number));
    this.settle = setTimeout(() => this.fine(number), 180);
  }

  async quick(number) {
    const state = this.current, begun = performance.now(), { width, samples } = this.moving, eyes = this.shownEyes();
    const waves = wavesOf(state, this.world.wavelengths, 4);
    for (const eye of eyes) {
      const own = stateOf(eye, state), scene = await this.scenes.at(own, eye.rotation_centre_mm);
      if (number !== this.work) return;
      const views = this.viewsOr(eye, () => eye.views(own, scene, waves, true));
      if (!views) continue;
      eye.picture.begin(width);
      eye.picture.add(views[0], 0, samples / waves.length);
      eye.picture.show();
      eye.picture.finish();
    }
    const took_ms = performance.now() - begun, rays = eyes.length * width * width * samples;
    this.counts = { ...this.counts, frames_per_s: 1e3 / took_ms, rays_per_frame: rays, rays_per_s: rays / took_ms * 1e3, width };
    this.moving.width = took_ms < 14 ? 512 : took_ms > 60 ? 256 : width;
  }

  /// What an eye is drawn with; where it cannot be, its picture is blank and the panel says why.
  viewsOr(eye, make) {
    try {
      return make();
    } catch (fault) {
      eye.picture.begin(8);
      eye.picture.show();
      this.fault = fault.message;
      this.says?.(`No picture: ${fault.message}.`);
      return null;
    }
  }

  /// Rays in portions of a strip each, so that the page stays responsive; shown when all wavelengths have had their share.
  /// Whether all was drawn before the state changed.
  async fine(number, width = 512, eyes = this.shownEyes()) {
    const state = this.current, strips = 4, begun = performance.now();
    this.fault = "";
    for (const eye of eyes) {
      const own = stateOf(eye, state), scene = await this.scenes.at(own, eye.rotation_centre_mm);
      const waves = wavesOf(own, this.world.wavelengths, 16), run = Math.ceil(this.resting / waves.length);
      if (number !== this.work) return false;
      const views = this.viewsOr(eye, () => eye.views(own, scene, waves, false));
      if (!views) continue;
      const few = Math.min(run, Math.max(1, 64 / waves.length));
      for (const [done, portion] of run > few ? [[0, few], [few, run - few]] : [[0, run]]) {
        for (const [k, view] of views.entries())
          for (let strip = 0; strip < strips; ++strip) {
            if (number !== this.work) return false;
            if (done === 0 && k === 0 && strip === 0) eye.picture.begin(width);
            eye.picture.add(view, k * run + done, portion, { from: strip / strips, to: (strip + 1) / strips });
            eye.picture.finish();
            await nextTask();
          }
        if (number !== this.work) return false;
        eye.picture.show();
      }
    }
    this.counts.rest_ms = performance.now() - begun;
    this.panel.dataset.ready = number;
    if (!this.fault) this.finished?.();
    return true;
  }

  /// The finished picture: ImageData, or linear light as { width, height, data } with three floats a pixel. One after the
  /// other; fails where the state changes before it is finished, or where there is no picture.
  image(options = {}) {
    const next = (this.images ?? Promise.resolve()).then(() => this.finishedImage(options));
    this.images = next.catch(() => {});
    return next;
  }

  async finishedImage({ eye = this.shownEyes()[0].id, linear = false, width = 512 }) {
    const one = this.eyeOf(eye);
    clearTimeout(this.settle);
    cancelAnimationFrame(this.frame);
    if (!await this.fine(++this.work, width, [one])) throw new Error("the state was changed before the picture was finished");
    if (this.fault) throw new Error(this.fault);
    const light = one.picture.linear();
    if (width !== 512 || !this.shownEyes().includes(one)) this.draw();
    if (linear) return light;
    const encoded = new ImageData(light.width, light.height);
    for (let i = 0; i < light.width * light.height; ++i) {
      for (let c = 0; c < 3; ++c) {
        const value = Math.min(1, Math.max(0, light.data[3 * i + c]));
        encoded.data[4 * i + c] = Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));
      }
      encoded.data[4 * i + 3] = 255;
    }
    return encoded;
  }

  /// The blur of the middle of the field: of the state, or of what set() would make of it for this eye.
  quality(id = this.shownEyes()[0].id, change = {}) {
    return qualityOf(this.eyeOf(id), this.asked({ ...change, eye: id }));
  }
}
