"use strict";
// What the reader drags: made from tables, each control with its label, range and reading.

const signed = (value, digits = 2) => (value > 0 ? "+" : value < 0 ? "\u2212" : "") + Math.abs(value).toFixed(digits);
const distanceText = (mm) => (mm >= 1e6 ? "far" : mm >= 1000 ? `${(mm / 1000).toFixed(mm < 1e4 ? 1 : 0)} m` : `${Math.round(mm / 10)} cm`);
const notationOf = ({ sphere_D, cylinder_D, axis_deg }) =>
  `${signed(sphere_D)} DS${cylinder_D ? ` / ${signed(cylinder_D)} DC x ${String(Math.round(axis_deg) || 180).padStart(3, "0")}` : ""}`;

/// key, label, least, most, step, reading
const sliders = {
  lens: [["sphere_D", "Sphere", -15, 15, 0.25, (v) => `${signed(v)} D`], ["cylinder_D", "Cylinder", -8, 8, 0.25, (v) => `${signed(v)} D`],
    ["axis_deg", "Axis", 0, 179, 1, (v) => `${Math.round(v)}\u00b0`], ["vertex_distance_mm", "Vertex distance", 0, 20, 0.5, (v) => `${v} mm`],
    ["prism_D", "Prism", 0, 10, 0.25, (v) => `${v} \u0394`], ["prism_base_deg", "Base of the prism", 0, 360, 5, (v) => `${v}\u00b0`]],
  ground: [["base_D", "Front surface", 0, 10, 0.5, (v) => `${signed(v, 1)} D`], ["index", "Index of the glass", 1.49, 1.9, 0.01, (v) => v.toFixed(2)]],
  eye: [["pupil_mm", "Pupil (iris)", 1, 6, 0.1, (v) => `${v.toFixed(1)} mm`], ["accommodation_D", "Accommodation", 0, 8, 0.1, (v) => `${v.toFixed(1)} D`],
    ["gaze_h", "Gaze, patient\u2019s left", -30, 30, 0.5, (v) => `${v}\u00b0`], ["gaze_v", "Gaze, up", -30, 30, 0.5, (v) => `${v}\u00b0`]],
  band: [["band_share", "To the interval\u2019s ends", -1, 1, 0.05, (v) => (v ? `${Math.round(100 * v)} %` : "estimate")]],
  scene: [["log_distance", "Distance", 2.3, 6, 0.02, (v) => distanceText(v >= 6 ? far_mm : 10 ** v)], ["field_mm", "Width of the picture", 0.5, 6, 0.1, (v) => `${v.toFixed(1)} mm`],
    ["field_x_mm", "Off the axis, to the right", -2.7, 2.7, 0.1, (v) => `${v.toFixed(1)} mm`], ["field_up", "Off the axis, up", -2.7, 2.7, 0.1, (v) => `${v.toFixed(1)} mm`]],
  light: [["wavelength_nm", "Wavelength", 400, 700, 5, (v) => `${v} nm`]],
};

/// Sliders whose value is not the state's own.
const derived = {
  field_up: { get: (state) => -state.field_y_mm, set: (value) => ({ field_y_mm: -value }) },  // the retina below sees above
  gaze_h: { get: (state) => state.gaze_deg[0], set: (value, state) => ({ gaze_deg: [value, state.gaze_deg[1]] }) },
  gaze_v: { get: (state) => state.gaze_deg[1], set: (value, state) => ({ gaze_deg: [state.gaze_deg[0], value] }) },
  log_distance: { get: (state) => Math.min(6, Math.log10(state.distance_mm)), set: (value) => ({ distance_mm: value >= 6 ? far_mm : Math.round(10 ** value) }) },
  wavelength_nm: { get: (state) => state.wavelength_nm ?? 555, set: (value) => ({ wavelength_nm: value }) },
};

class Controls {
  constructor(living, panel) {
    this.living = living;
    this.panel = panel;
    this.inputs = new Map();
    panel.querySelector(".living-controls").append(this.lensGroup(), this.eyeGroup(), this.sceneGroup(), this.actions());
    this.overlays();
    living.changed = () => this.follow();
    living.says = (text) => { panel.querySelector(".living-status").textContent = text; };
    living.finished = () => this.told();
    window.addEventListener("hashchange", () => this.readLink());
    this.follow();
  }

  group(title, ...parts) {
    const set = document.createElement("fieldset");
    set.innerHTML = "<legend></legend>";
    set.querySelector("legend").textContent = title;
    set.append(...parts.flat());
    return set;
  }

  slider([key, label, least, most, step, reading]) {
    const row = document.createElement("label");
    row.className = "living-slider";
    row.innerHTML = `<span></span><input type="range" min="${least}" max="${most}" step="${step}"><output></output>`;
    row.firstChild.textContent = label;
    const input = row.querySelector("input"), output = row.querySelector("output");
    input.addEventListener("input", () => {
      const value = Number(input.value);
      this.set(derived[key] ? derived[key].set(value, this.living.current) : { [key]: value });
    });
    this.inputs.set(key, { row, follow: (state) => {
      const value = derived[key] ? derived[key].get(state) : state[key];
      if (document.activeElement !== input || Number(input.value) !== value) input.value = value;
      output.textContent = key === "prism_base_deg" ? `${value}\u00b0 ${this.baseText(value)}` : reading(value);
      input.setAttribute("aria-valuetext", output.textContent);
    }, input });
    return row;
  }

  choice(key, label, options, set = (value) => ({ [key]: value }), get = (state) => state[key]) {
    const row = document.createElement("label");
    row.className = "living-choice";
    row.innerHTML = "<span></span><select></select>";
    row.firstChild.textContent = label;
    const select = row.querySelector("select");
    for (const [value, text] of options) select.append(new Option(text, value));
    select.addEventListener("change", () => this.set(set(select.value)));
    this.inputs.set(key, { row, input: select, follow: (state) => { select.value = get(state); } });
    return row;
  }

  tick(key, label, set = (value) => ({ [key]: value }), get = (state) => state[key]) {
    const row = document.createElement("label");
    row.className = "living-tick";
    row.innerHTML = '<input type="checkbox"><span></span>';
    row.querySelector("span").textContent = label;
    const input = row.querySelector("input");
    input.addEventListener("change", () => this.set(set(input.checked)));
    this.inputs.set(key, { row, input, follow: (state) => { input.checked = get(state); } });
    return row;
  }

  button(text, act, name) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.addEventListener("click", act);
    if (name) button.dataset.lens = name;
    return button;
  }

  lensGroup() {
    const buttons = document.createElement("p");
    buttons.className = "living-buttons";
    const none = { sphere_D: 0, cylinder_D: 0, axis_deg: 0, prism_D: 0, is_thick: false };
    buttons.append(this.button("No lens", () => this.set(none)));
    for (const [name, text] of [["best", "Best lens"], ["rounded", "Rounded lens"], ["known", "Known glasses"]])
      buttons.append(this.button(text, () => this.wear(name), name));
    const why = document.createElement("p");
    why.className = "note living-withheld";
    const ground = document.createElement("div");
    ground.className = "living-ground";
    ground.append(...sliders.ground.map((row) => this.slider(row)));
    return this.group("Spectacle lens", buttons, why, sliders.lens.map((row) => this.slider(row)),
      this.tick("is_thick", "As it is ground: a front surface, glass, an edge of 1 mm at least"), ground);
  }

  wear(name) {
    const eye = this.eye();
    let lens = eye.lenses.find((one) => one.name === name);
    // Of an eye without a prescription of its own (schematic, or other than corrected) what is sharpest at this distance is found here.
    if (!lens && name === "best") lens = { ...fromPower(this.numbers.bestFor(eye, this.living.current).power), vertex_distance_mm: this.living.current.vertex_distance_mm };
    if (this.living.shownEyes().every((one) => hasLens(one, name))) return this.set({ prism_D: 0, is_thick: false, worn: name });
    if (lens) this.set({ prism_D: 0, is_thick: false, sphere_D: lens.sphere_D, cylinder_D: lens.cylinder_D, axis_deg: lens.axis_deg, vertex_distance_mm: lens.vertex_distance_mm });
  }

  eye() { return this.living.shownEyes()[0]; }

  eyeGroup() {
    const { eyes } = this.living, parts = [];
    if (eyes.length > 1) parts.push(this.choice("eye", "Eye", [...eyes.map((eye) => [eye.id, eye.name]), ["both", "Both, side by side"]]));
    parts.push(...sliders.eye.map((row) => this.slider(row)));
    if (eyes.some((eye) => eye.bands.length)) {
      parts.push(this.choice("band", "Uncertainty of the geometry", [[0, ""], [1, ""], [2, ""]], (value) => ({ band: Number(value) })), this.slider(sliders.band[0]));
      const note = document.createElement("p");
      note.className = "note living-band";
      parts.push(note);
    }
    return this.group("Eye", parts);
  }

  sceneGroup() {
    const scenes = [...this.living.scenes.all].map(([name, scene]) => [name, scene.title]);
    const night = 0.05;  // /mm^2, Applegate and Lakshminarayanan 1993
    return this.group("What it looks at", this.choice("scene", "Scene", scenes), sliders.scene.map((row) => this.slider(row)),
      this.choice("light", "Light", [["white", "White"], ["one", "One wavelength"]], (value) => ({ wavelength_nm: value === "one" ? 555 : null }),
        (state) => (state.wavelength_nm ? "one" : "white")), this.slider(sliders.light[0]),
      this.choice("time", "Day or night", [["as", "As it is set"], ["day", "Day: 3 mm, Stiles-Crawford"], ["night", "Night: widest pupil, Stiles-Crawford"]],
        (value) => ({ stiles_crawford_per_mm2: value === "as" ? 0 : night, pupil_mm: value === "day" ? 3 : value === "night" ? 99 : this.living.opening.pupil_mm }),
        (state) => (!state.stiles_crawford_per_mm2 ? "as" : state.pupil_mm === 3 ? "day" : state.pupil_mm >= this.eye().map.pupil_mm ? "night" : "as")),
      this.tick("receptors", "Receptors look at the pupil\u2019s middle (Stiles-Crawford)", (on) => ({ stiles_crawford_per_mm2: on ? night : 0 }),
        (state) => state.stiles_crawford_per_mm2 > 0),
      this.tick("diffraction", "Diffraction"), this.tick("scene_follows_gaze", "The scene turns with the gaze"));
  }

  actions() {
    const row = document.createElement("p");
    row.className = "living-buttons living-actions";
    row.append(this.button("Hold this picture to compare", () => this.hold()), this.button("Save the picture", () => this.save()),
      this.button("Copy the values", () => this.copy(this.valuesText())), this.button("Copy a link to this state", () => this.copy(this.link())));
    return row;
  }

  set(change) {
    try {
      this.living.approach(change);
    } catch (fault) {
      this.living.says(fault.message);
    }
  }

  /// Controls as the state is.
  follow() {
    const state = this.living.current, eye = this.eye();
    this.inputs.get("pupil_mm").input.max = eye.map.pupil_mm;
    this.inputs.get("accommodation_D").input.max = eye.map.largest_accommodation_D;
    this.inputs.get("accommodation_D").row.hidden = !(eye.map.largest_accommodation_D > 0);
    this.inputs.get("wavelength_nm").row.hidden = !state.wavelength_nm;
    this.inputs.get("log_distance").row.hidden = !this.living.scenes.all.get(state.scene).far;
    this.panel.querySelector(".living-ground").hidden = !state.is_thick;
    const shown = this.living.shownEyes();
    for (const button of this.panel.querySelectorAll("[data-lens]"))
      button.disabled = !shown.every((one) => hasLens(one, button.dataset.lens) || (button.dataset.lens === "best" && shown.length === 1 && one.has_prescription));
    const withheld = this.panel.querySelector(".living-withheld"), without = shown.find((one) => one.withheld);
    withheld.textContent = without ? `No prescription, so no best lens to put on: ${without.withheld}` : "";
    withheld.hidden = !without;
    if (this.inputs.has("band")) {
      const select = this.inputs.get("band").input;
      eye.bands.forEach((band, k) => {
        const J = Math.hypot(band.J0_D, band.J45_D), mostly = Math.abs(band.M_D) > J ? `sphere \u00b1${Math.abs(band.M_D).toFixed(1)} D` : `cylinder \u00b1${(2 * J).toFixed(1)} D`;
        if (select.options[k]) select.options[k].text = `${["Widest", "Second", "Third"][k]} direction: ${mostly}`;
      });
      [...select.options].forEach((option, k) => { option.hidden = option.disabled = k >= eye.bands.length; });
      this.panel.querySelector(".living-band").textContent = state.band_share
        ? `An eye that the images allow as well: ${this.bandText(eye, state)}; the ends of this direction hold 95 %.` : "";
    }
    for (const { follow } of this.inputs.values()) follow(state);
    for (const one of this.living.eyes) one.figure.hidden = !shown.includes(one);
    this.panel.querySelector(".living-pictures").classList.toggle("two", shown.length > 1);
    for (const overlay of this.axes) overlay.follow(state);
    this.numbers?.follow();
  }

  /// Counter-clockwise as the examiner sees it: 0 is the patient's left, the nose's side of a right eye.
  baseText(base_deg) {
    const quarter = Math.round(base_deg / 90) % 4;
    if (base_deg % 90) return "";
    return ["", "(up)", "", "(down)"][quarter] || ((quarter === 0) === (this.eye().id !== "os") ? "(in)" : "(out)");
  }

  /// What lies at this share of the way to a direction's end.
  bandText(eye, state) {
    const band = eye.bands[state.band] ?? { M_D: 0, J0_D: 0, J45_D: 0 }, M = state.band_share * band.M_D;
    const J = Math.abs(state.band_share) * Math.hypot(band.J0_D, band.J45_D);
    return `${Math.abs(M).toFixed(1)} D more ${M < 0 ? "myopic" : "hyperopic"}${J > 0.05 ? `, ${(2 * J).toFixed(1)} D of cylinder more or less` : ""}`;
  }

  told() {
    const state = this.living.current, eye = this.eye();
    const text = this.living.current.eye === "both" && state.worn ? "Each eye through its own lens; figures are the right eye\u2019s." : `${eye.name}: ${this.living.scenes.all.get(state.scene).title.toLowerCase()} ${distanceText(state.distance_mm)} away, ${lensOf(state) ? `through ${notationOf(state)}` : "no lens"}, pupil ${state.pupil_mm.toFixed(1)} mm.`;
    if (this.panel.querySelector(".living-status").textContent !== text) this.living.says(text);
  }

  /// The cylinder's axis on the picture, to be turned by dragging.
  overlays() {
    this.axes = this.living.eyes.map((eye) => {
      const stage = document.createElement("div");
      stage.className = "living-stage";
      eye.canvas.before(stage);
      stage.append(eye.canvas);
      const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      svg.setAttribute("viewBox", "-100 -100 200 200");
      svg.setAttribute("aria-hidden", "true");
      svg.innerHTML = '<line class="halo"/><line class="halo"/><line/><line/><circle r="5"/><circle r="5"/>';
      stage.append(svg);
      const turn = (event) => {
        const box = svg.getBoundingClientRect();
        const x = event.clientX - box.left - box.width / 2, y = event.clientY - box.top - box.height / 2;
        // The examiner sees the patient's left on the right; the picture is the patient's own.
        const axis = Math.round(Math.atan2(-y, -x) / radian);
        this.set({ axis_deg: ((axis % 180) + 180) % 180 });
      };
      svg.addEventListener("pointerdown", (event) => { svg.setPointerCapture(event.pointerId); turn(event); });
      svg.addEventListener("pointermove", (event) => { if (svg.hasPointerCapture(event.pointerId)) turn(event); });
      return { follow: (state) => {
        svg.style.display = state.cylinder_D ? "" : "none";
        const x = -88 * Math.cos(state.axis_deg * radian), y = -88 * Math.sin(state.axis_deg * radian);
        // Marks at the rim, so that the picture stays free.
        svg.querySelectorAll("line").forEach((line, k) => {
          const way = k % 2 ? -1 : 1;
          for (const [name, value] of [["x1", way * x], ["y1", way * y], ["x2", way * 0.8 * x], ["y2", way * 0.8 * y]]) line.setAttribute(name, value);
        });
        svg.querySelectorAll("circle").forEach((circle, k) => { circle.setAttribute("cx", k ? -x : x); circle.setAttribute("cy", k ? -y : y); });
      } };
    });
  }

  /// The picture as it is now, under the living one, with a slider between them.
  hold() {
    for (const eye of this.living.shownEyes()) {
      const stage = eye.canvas.parentElement;
      stage.querySelector(".living-held")?.remove();
      eye.figure.querySelector(".living-split")?.remove();
      const held = document.createElement("img");
      held.className = "living-held";
      held.alt = `Held: ${notationOf(this.living.current)}`;
      held.src = eye.canvas.toDataURL();
      stage.append(held);
      const row = document.createElement("label");
      row.className = "living-split";
      row.innerHTML = `<span></span><input type="range" min="0" max="100" value="50"><button type="button">Let go</button>`;
      const state = stateOf(eye, this.living.current);
      row.firstChild.textContent = `Held (${this.living.scenes.all.get(state.scene).title.toLowerCase()}, ${lensOf(state) ? notationOf(state) : "no lens"}, pupil ${state.pupil_mm.toFixed(1)} mm) | now`;
      const range = row.querySelector("input"), show = () => { held.style.clipPath = `inset(0 ${100 - range.value}% 0 0)`; };
      range.addEventListener("input", show);
      row.querySelector("button").addEventListener("click", () => { held.remove(); row.remove(); });
      show();
      stage.after(row);
    }
  }

  save() {
    for (const eye of this.living.shownEyes()) {
      const link = document.createElement("a");
      link.download = `emmetrope-${eye.id}.png`;
      link.href = eye.canvas.toDataURL();
      link.click();
    }
  }

  async copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      this.living.says("Copied.");
    } catch {  // a page from a disk may not be allowed to
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      this.living.says(document.execCommand("copy") ? "Copied." : `To copy: ${text}`);
      area.remove();
    }
  }

  valuesText() {
    const state = this.living.state();
    return [...Object.entries(state).map(([key, value]) => `${key}\t${value}`), ...this.living.shownEyes().map((eye) => {
      const { blur_arcmin, logmar, sharpness } = this.living.quality(eye.id);
      return `${eye.id}\tblur_arcmin ${blur_arcmin.toFixed(2)}\tlogmar ${logmar.toFixed(2)}\tsharpness ${sharpness.toFixed(3)}`;
    })].join("\n");
  }

  /// What differs from how the page opens, in the address's fragment.
  link() {
    const changes = Object.fromEntries(Object.entries(this.living.current).filter(([key, value]) =>
      JSON.stringify(value) !== JSON.stringify(this.living.opening[key])));
    const address = `${location.href.split("#")[0]}#living=${encodeURIComponent(JSON.stringify(changes))}`;
    history.replaceState(null, "", address);
    return address;
  }

  readLink() {
    const match = location.hash.match(/^#living=(.*)$/);
    if (!match) return;
    try {
      const changes = JSON.parse(decodeURIComponent(match[1]));
      this.living.approach({ ...this.living.opening, ...changes });
      this.panel.scrollIntoView({ block: "start" });
    } catch (fault) {
      this.living.says(`The link's state cannot be read: ${fault.message}`);
    }
  }
}
