"use strict";
// The panel in which an eye looks out of the page: state, controls, pictures. window.emmetrope is its handle.

const lensOf = (state) => (state.sphere_D || state.cylinder_D || state.prism_D || state.is_thick ? new Lens(state) : null);

/// One eye with its canvas.
class Eye {
  constructor(json, figure, airy) {
    Object.assign(this, json);
    this.map = new EyeMap(json.map, json.bands);
    this.canvas = figure.querySelector("canvas");
    this.picture = new Picture(this.canvas, airy);
    this.airy = airy;
    this.meshes = new Map();
  }

  /// Kept while nothing that it depends on changes.
  kept(key, make) {
    if (!this.meshes.has(key)) {
      if (this.meshes.size > 80) this.meshes.delete(this.meshes.keys().next().value);
      this.meshes.set(key, make());
    }
    return this.meshes.get(key);
  }

  /// What the picture is drawn with. Each wave has a mesh of its own, or where `together` all have that of the middle one
  /// and differ from it to first order.
  views(state, scene, waves, together) {
    const field = { x_mm: state.field_x_mm, y_mm: state.field_y_mm, size_mm: state.field_mm };
    const { scene: _, distance_mm, wavelength_nm, ...optical } = state;
    const key = (...more) => JSON.stringify([optical, ...more]);
    const { pupil_mm, accommodation_D, band, band_share } = state;
    const rays = (nm) => this.kept(JSON.stringify(["rays", nm, accommodation_D, band, band_share]), () => this.map.raysOf({ ...state, wavelength_nm: nm }));
    const bundle = (nm) => this.kept(JSON.stringify(["bundle", nm, pupil_mm, accommodation_D, band, band_share]), () => new Bundle(this.map, state, nm, rays(nm)));
    const beam = (nm) => this.kept(key("beam", nm), () => new Beam(this, state, nm, bundle(nm)));
    const tolerance_arcmin = together ? motionTolerance_arcmin : restTolerance_arcmin;
    const mesh = (nm) => this.kept(key("mesh", nm, tolerance_arcmin), () => beam(nm).mesh(field, state.accommodation_D, tolerance_arcmin));
    const entrance_mm = state.pupil_mm * this.entrance_pupil_magnification;
    const falloff = state.stiles_crawford_per_mm2 * Math.log2(10) * (entrance_mm / 2) ** 2;
    const drawn = (wave, difference) => ({ matrix: wave.matrix, difference,
      airy_angle: state.diffraction ? wave.nm * 1e-6 / (Math.PI * entrance_mm) : 0 });
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
  const channel = new MessageChannel();
  return () => new Promise((resolve) => { channel.port1.onmessage = resolve; channel.port2.postMessage(null); });
})();

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
    this.current = { ...Living.start, eye: this.eyes[0].id, pupil_mm: Math.min(this.eyes[0].iris_mm, this.eyes[0].map.pupil_mm) };
    this.opening = { ...this.current };
    this.counts = { frames_per_s: 0, rays_per_frame: 0, rays_per_s: 0, width: 0 };
    this.resting = 256;
    this.moving = { width: 256, samples: 16 };
    this.work = 0;
  }

  static start = { scene: "letters", distance_mm: 6000, field_mm: field_mm_of.chart, field_x_mm: 0, field_y_mm: 0, sphere_D: 0, cylinder_D: 0, axis_deg: 0,
    vertex_distance_mm: 12, prism_D: 0, prism_base_deg: 0, is_thick: false, base_D: 4, index: 1.5, accommodation_D: 0, band: 0, band_share: 0,
    gaze_deg: [0, 0], wavelength_nm: null, stiles_crawford_per_mm2: 0, diffraction: false };

  eyeOf(id) { return this.eyes.find((eye) => eye.id === id) ?? this.eyes[0]; }
  shownEyes() { return this.current.eye === "both" ? this.eyes : [this.eyeOf(this.current.eye)]; }

  /// Every value within what the eyes and the scene allow.
  set(change) {
    const next = { ...this.current, ...change };
    const unknown = Object.keys(change).filter((key) => !(key in this.current) && key !== "samples");
    if (unknown.length) throw new Error(`there is no ${unknown.join(", ")}`);
    if (next.eye !== "both" && !this.eyes.some((eye) => eye.id === next.eye)) throw new Error(`no eye is called ${next.eye}`);
    const scene = this.scenes.all.get(next.scene);
    if (!scene) throw new Error(`no scene is called ${next.scene}`);
    if (change.scene && change.scene !== this.current.scene) {
      if (change.distance_mm === undefined) next.distance_mm = scene.distance_mm;
      if (change.field_mm === undefined) next.field_mm = scene.field_mm;
    }
    const within = (value, low, high) => Math.min(high, Math.max(low, value));
    const eyes = next.eye === "both" ? this.eyes : [this.eyeOf(next.eye)];
    const least = (of) => Math.min(...eyes.map(of));
    next.pupil_mm = within(next.pupil_mm, 1, least((eye) => eye.map.pupil_mm));
    next.accommodation_D = within(next.accommodation_D, 0, least((eye) => eye.map.largest_accommodation_D));
    next.band_share = within(next.band_share, -1, 1);
    const room = least((eye) => eye.map.field_mm);
    next.field_mm = within(next.field_mm, 0.1, room);
    for (const key of ["field_x_mm", "field_y_mm"]) next[key] = within(next[key], (next.field_mm - room) / 2, (room - next.field_mm) / 2);
    if (next.samples) this.resting = next.samples;
    delete next.samples;
    this.current = next;
    this.draw();
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
    const state = this.current, scene = await this.scenes.at(state.scene, state.distance_mm);
    if (number !== this.work) return;
    const begun = performance.now(), { width, samples } = this.moving, eyes = this.shownEyes();
    const waves = wavesOf(state, this.world.wavelengths, 4);
    try {
      for (const eye of eyes) {
        const [view] = eye.views(state, scene, waves, true);
        eye.picture.begin(width);
        eye.picture.add(view, 0, samples / waves.length);
        eye.picture.show();
        eye.picture.finish();
      }
    } catch (fault) {
      this.says?.(fault.message);
      return;
    }
    const took_ms = performance.now() - begun, rays = eyes.length * width * width * samples;
    this.counts = { ...this.counts, frames_per_s: 1e3 / took_ms, rays_per_frame: rays, rays_per_s: rays / took_ms * 1e3, width };
    this.moving.width = took_ms < 14 ? 512 : took_ms > 60 ? 256 : width;
  }

  /// Rays in portions of a strip each, so that the page stays responsive; shown when all wavelengths have had their share.
  async fine(number, width = 512) {
    const state = this.current, scene = await this.scenes.at(state.scene, state.distance_mm), strips = 4;
    const begun = performance.now();
    for (const eye of this.shownEyes()) {
      const waves = wavesOf(state, this.world.wavelengths, 16), run = Math.ceil(this.resting / waves.length);
      let views;
      try {
        views = eye.views(state, scene, waves, false);
      } catch (fault) {
        this.says?.(fault.message);
        return;
      }
      const few = Math.min(run, Math.max(1, 64 / waves.length));
      for (const [done, portion] of run > few ? [[0, few], [few, run - few]] : [[0, run]]) {
        for (const [k, view] of views.entries())
          for (let strip = 0; strip < strips; ++strip) {
            if (number !== this.work) return;
            if (done === 0 && k === 0 && strip === 0) eye.picture.begin(width);
            eye.picture.add(view, k * run + done, portion, { from: strip / strips, to: (strip + 1) / strips });
            eye.picture.finish();
            await nextTask();
          }
        if (number !== this.work) return;
        eye.picture.show();
      }
    }
    this.counts.rest_ms = performance.now() - begun;
    this.panel.dataset.ready = number;
    this.finished?.();
  }

  /// The finished picture: ImageData, or linear light as { width, height, data } with three floats a pixel.
  async image({ eye = this.shownEyes()[0].id, linear = false, width = 512 } = {}) {
    clearTimeout(this.settle);
    cancelAnimationFrame(this.frame);
    const number = ++this.work;
    await this.fine(number, width);
    const { picture } = this.eyeOf(eye);
    const light = picture.linear();
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

  /// The blur of the middle of the field.
  quality(id = this.shownEyes()[0].id, change = {}) {
    const state = { ...this.current, ...change }, eye = this.eyeOf(id);
    const rays = spotOf(eye, state, state.wavelength_nm ?? eye.map.reference_nm);
    const blur_arcmin = blurOf(rays);
    return { blur_arcmin, logmar: acuityOf(blur_arcmin), sharpness: sharpnessOf(rays), rays };
  }
}
