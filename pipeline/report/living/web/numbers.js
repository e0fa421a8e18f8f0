"use strict";
// Beside the picture: what the blur is and costs, where a point's rays end up, contrast by frequency, the way of the light.

const svgElement = (name, attributes = {}) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};

/// The lens that makes the middle of the field sharpest, by its power vector: climbs from `start` along M, J0 and J45.
function sharpestLens(value, start, step = 0.5, least = 0.01) {
  let at = start, best = value(at);
  for (let size = step; size > least; size /= 2)
    for (let moved = true; moved;) {
      moved = false;
      for (let k = 0; k < 3; ++k)
        for (const way of [size, -size]) {
          const next = at.map((c, i) => (i === k ? c + way : c)), found = value(next);
          if (found > best) [at, best, moved] = [next, found, true];
        }
    }
  return { power: at, sharpness: best };
}

const fromPower = ([M, J0, J45]) => {
  const J = Math.hypot(J0, J45);
  return { sphere_D: M + J, cylinder_D: -2 * J, axis_deg: (Math.atan2(J45, J0) / 2 / radian + 180) % 180 };
};
const toPower = ({ sphere_D, cylinder_D, axis_deg }) =>
  [sphere_D + cylinder_D / 2, -cylinder_D / 2 * Math.cos(2 * axis_deg * radian), -cylinder_D / 2 * Math.sin(2 * axis_deg * radian)];

class Numbers {
  constructor(living, panel) {
    this.living = living;
    this.root = panel.querySelector(".living-numbers");
    this.bestOf = new Map();
    const figure = (title, note, root = this.root) => {
      const element = document.createElement("figure");
      element.innerHTML = '<div class="title"></div><div class="living-plot"></div><figcaption></figcaption>';
      element.querySelector(".title").textContent = title;
      element.querySelector("figcaption").textContent = note;
      root.append(element);
      return element.querySelector(".living-plot");
    };
    this.table = figure("The middle of the picture", "Geometrical blur of a point at the scene\u2019s distance, in light of 555 nm or the wavelength that is set, without diffraction. Coloured rims in white light are the eye\u2019s chromatic blur, of which the brain hides a part. A line of letters is 0.1 logMAR, 0.0 is 20/20; read by Smith\u2019s (1991) rule. Sharpness is that of the image of a chart full of edges, against the best lens for this pupil and distance.",
      panel.querySelector(".living-read"));
    this.spot = this.canvasIn(figure("Where the light of a point goes", "Rays through the whole pupil, as the patient sees them; the circle is 5 minutes of arc wide, the height of a letter of logMAR 0."));
    this.contrast = figure("Contrast by frequency", "Geometrical transfer function at one wavelength times that of diffraction: blue along the lens\u2019s axis, orange across it; the dashed line is diffraction alone.");
    this.path = figure("The way of the light", "Vertical section of the eye at rest, looking straight ahead; rays from the middle of the picture through the pupil, out of the eye and through the lens.");
    this.path.parentElement.classList.add("wide");
    this.solid = this.canvasIn(figure("The eye in space", "Drag to turn. The patch of the retina that the page knows, 6 mm or 20 degrees wide, is coloured by how much more myopic (red) or hyperopic (blue) it is than its middle; the dot is the middle of the picture."));
    this.turnSolid();
  }

  canvasIn(place) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 560;
    canvas.style.width = "100%";
    canvas.style.maxWidth = "20rem";
    place.append(canvas);
    return canvas;
  }

  /// Not while the picture moves fast: what is read may come a moment later.
  follow() {
    clearTimeout(this.later);
    this.later = setTimeout(() => this.draw(), 60);
  }

  draw() {
    const { living } = this, eye = living.shownEyes()[0], state = stateOf(eye, living.current);
    let quality;
    try {
      quality = living.quality(eye.id);
    } catch (fault) {
      this.table.textContent = `No figures: ${fault.message}.`;
      return;
    }
    this.drawTable(eye, state, quality);
    this.drawSpot(quality.rays);
    this.drawContrast(eye, state, quality.rays);
    this.drawPath(eye, state);
    this.drawSolid();
    clearTimeout(this.search);
    this.search = setTimeout(() => { try { this.findBest(eye, state); } catch { /* said by draw() */ } }, 700);
  }

  bestKey(eye, state) {
    return JSON.stringify([eye.id, state.pupil_mm, state.accommodation_D, state.distance_mm, state.band, state.band_share, state.wavelength_nm,
      state.stiles_crawford_per_mm2, state.vertex_distance_mm, state.field_x_mm, state.field_y_mm, state.gaze_deg]);
  }

  bestFor(eye, state) {
    const key = this.bestKey(eye, state);
    if (!this.bestOf.has(key)) {
      const known = eye.lenses.find((lens) => lens.name === "best");
      const plain = { prism_D: 0, is_thick: false };
      const value = (power) => this.living.quality(eye.id, { ...state, ...plain, ...fromPower(power) }).sharpness;
      this.bestOf.set(key, sharpestLens(value, known ? toPower(known) : [0, 0, 0], 1));
    }
    return this.bestOf.get(key);
  }

  findBest(eye, state) {
    this.bestFor(eye, state);
    if (stateOf(eye, this.living.current) === state || JSON.stringify(stateOf(eye, this.living.current)) === JSON.stringify(state)) this.drawTable(eye, state, this.living.quality(eye.id));
  }

  drawTable(eye, state, { blur_arcmin, logmar, sharpness, lost }) {
    const best = this.bestOf.get(this.bestKey(eye, state));
    const rows = [["Eye", eye.name], ["Lens", lensOf(state) ? `${notationOf(state)}${state.prism_D ? `, prism ${state.prism_D} \u0394 base ${state.prism_base_deg}\u00b0` : ""}` : "none"],
      ["Blur (root mean square radius)", `${blur_arcmin.toFixed(2)} minutes of arc`],
      ["Smallest letters read", `logMAR ${logmar.toFixed(2)}, ${logmar < 0.05 ? "no line lost" : `${(10 * logmar).toFixed(0)} ${Math.round(10 * logmar) === 1 ? "line" : "lines"} worse than 20/20`}`],
      ["Sharpness of the image", `${(100 * sharpness).toFixed(0)} % of a pinhole\u2019s${best ? `, ${(100 * Math.min(1, sharpness / best.sharpness)).toFixed(0)} % of the best lens\u2019s` : ""}`]];
    // What has the form of a prescription only where the report gives one, and with its interval where that is wide.
    const half_D = eye.half_width_D;
    if (best && eye.has_prescription)
      rows.push(["Sharpest here, now", half_D > 1 ? `SE ${signed(best.power[0], 1)} \u00b1 ${half_D.toFixed(1)} D` : notationOf(fromPower(best.power))]);
    if (lost > 0.005) rows.push(["Rays that miss the lens", `${(100 * lost).toFixed(0)} %: the blur is that of the rest`]);
    if (state.band_share) rows.push(["Eye", `${Math.round(100 * state.band_share)} % along an interval of the geometry`]);
    const table = document.createElement("table");
    for (const [name, value] of rows) {
      const row = table.insertRow();
      const head = document.createElement("th");
      head.scope = "row";
      head.textContent = name;
      row.append(head);
      row.insertCell().textContent = value;
    }
    this.table.replaceChildren(table);
  }

  drawSpot(rays) {
    const pen = this.spot.getContext("2d"), { width } = this.spot, style = getComputedStyle(this.spot);
    pen.clearRect(0, 0, width, width);
    const minutes = (mrad) => mrad / 1e3 / radian * 60;
    const reach = Math.max(4, ...rays.map((ray) => 1.15 * minutes(Math.hypot(ray.x, ray.y)))), scale = width / 2 / reach;
    pen.fillStyle = style.color;
    pen.globalAlpha = 0.75;
    for (const ray of rays) {
      pen.beginPath();
      // What one point of the retina sees is a point's image turned about its middle.
      pen.arc(width / 2 - scale * minutes(ray.x), width / 2 + scale * minutes(ray.y), 4, 0, 7);
      pen.fill();
    }
    pen.globalAlpha = 1;
    pen.strokeStyle = "#d08700";
    pen.lineWidth = 3;
    pen.beginPath();
    pen.arc(width / 2, width / 2, 2.5 * scale, 0, 7);
    pen.stroke();
    this.spot.setAttribute("role", "img");
    this.spot.setAttribute("aria-label", `Spot diagram, ${reach.toFixed(0)} minutes of arc from its middle to the edge`);
  }

  drawContrast(eye, state, rays) {
    const finest = 60, cpd = Array.from({ length: 61 }, (_, k) => k * finest / 60);
    const nm = state.wavelength_nm ?? eye.map.reference_nm, entrance_mm = state.pupil_mm * eye.entrance_pupil_magnification;
    const cutoff = entrance_mm * 1e-3 / (nm * 1e-9) * radian;
    const diffraction = cpd.map((f) => { const s = Math.min(1, f / cutoff); return 2 / Math.PI * (Math.acos(s) - s * Math.sqrt(1 - s * s)); });
    const along = (turn) => cpd.map((f, k) => diffraction[k] * transfer(rays, f, [-Math.cos(turn), Math.sin(turn)]));
    const axis = state.axis_deg * radian;
    const data = [cpd, along(axis), along(axis + Math.PI / 2), diffraction];
    this.contrast.dataset.values = JSON.stringify([data[1][10], data[2][10]]);
    if (!window.uPlot) {
      this.contrast.textContent = `At 10 cycles a degree: ${data[1][10].toFixed(2)} and ${data[2][10].toFixed(2)}.`;
      return;
    }
    if (this.plot) {
      this.plot.series[1].label = `${state.axis_deg}\u00b0`;
      this.plot.setData(data);
      return;
    }
    const ink = getComputedStyle(this.root).color, grid = { stroke: "rgba(128,128,128,.3)" };
    this.plot = new uPlot({ width: 300, height: 230, cursor: { show: false }, legend: { show: false },
      scales: { x: { time: false }, y: { range: [0, 1] } },
      axes: [{ stroke: ink, grid, label: "cycles a degree", labelSize: 20 }, { stroke: ink, grid, size: 40 }],
      series: [{}, { stroke: "#1f77d0", width: 2 }, { stroke: "#d0651f", width: 2 }, { stroke: ink, width: 1, dash: [5, 4] }] }, data, this.contrast);
    this.contrast.setAttribute("role", "img");
    this.contrast.setAttribute("aria-label", "Modulation transfer function along and across the lens's axis to 60 cycles a degree");
  }

  drawPath(eye, state) {
    const front = 46, back = eye.axial_length_mm + 2, half = 15, scale = 10;
    const svg = svgElement("svg", { viewBox: `${-front * scale} ${-half * scale} ${(front + back) * scale} ${2 * half * scale}`, role: "img",
      "aria-label": "Vertical section: scene on the left, retina on the right" });
    const style = svgElement("style");
    style.textContent = ".s{fill:none;stroke:currentColor;stroke-width:2.5} .r{fill:none;stroke:#d08700;stroke-width:1.6} .l{fill:#7cc0ff55;stroke:#2f7fd0;stroke-width:2}";
    svg.append(style);
    const at = ([, y, z]) => `${(-z * scale).toFixed(1)},${(-y * scale).toFixed(1)}`;
    for (const outline of eye.outlines) {
      const points = this.pointsOf(outline), line = [];
      for (let ring = outline.rings; ring > 0; --ring) line.push(points[ring * outline.spokes + 3 * outline.spokes / 4]);
      for (let ring = 0; ring <= outline.rings; ++ring) line.push(points[ring * outline.spokes + outline.spokes / 4]);
      svg.append(svgElement("polyline", { class: "s", points: line.filter((p) => p.every(Number.isFinite)).map(at).join(" ") }));
    }
    for (const side of [-1, 1])  // the iris about the pupil
      svg.append(svgElement("line", { class: "s", x1: eye.stop_depth_mm * scale, x2: eye.stop_depth_mm * scale, y1: side * state.pupil_mm / 2 * scale, y2: side * 5.5 * scale }));
    const lens = lensOf(state);
    if (lens) svg.append(this.lensSection(lens, at));
    const beam = new Beam(eye, { ...state, gaze_deg: [0, 0] }, state.wavelength_nm ?? eye.map.reference_nm);
    for (let k = -3; k <= 3; ++k) {
      const p = k / 3, bare = eye.map.ray(beam.bundle.polynomialAt(state.field_x_mm, state.field_y_mm), 0, p);
      const inside = eye.map.path(state.accommodation_D, state.field_x_mm, state.field_y_mm, 0, p * beam.bundle.scale).filter((_, i) => eye.map.surfaces[i] !== "stop");
      const out = lens ? lens.pass(bare) : bare;
      if (!out) continue;
      const ahead = (front - out.at[2]) / out.to[2];
      const ways = [this.retinaAt(eye, state.field_x_mm, state.field_y_mm), ...inside, ...(lens ? out.hits : []), plus(out.at, out.to, ahead)];
      svg.append(svgElement("polyline", { class: "r", points: ways.map(at).join(" ") }));
    }
    this.path.replaceChildren(svg);
  }

  lensSection(lens, at) {
    const half = 11, points = [];
    for (let y = -half; y <= half; y += 1) points.push([0, y, lens.back_mm - lens.backDepth(0, y)]);
    for (let y = half; y >= -half; y -= 1) {
      const bend = lens.front * y * y / (1 + Math.sqrt(Math.max(0, 1 - (lens.front * y) ** 2)));
      points.push([0, y, lens.back_mm + lens.thickness_mm - bend - y * lens.front_normal[1] / lens.front_normal[2]]);
    }
    return svgElement("polygon", { class: "l", points: points.filter((p) => p.every(Number.isFinite)).map(at).join(" ") });
  }

  pointsOf(outline) {
    outline.decoded ??= floatsOf(outline.points);
    return Array.from({ length: outline.decoded.length / 3 }, (_, k) => Array.from(outline.decoded.slice(3 * k, 3 * k + 3)));
  }

  /// The retina's depth between the rings of its outline.
  retinaAt(eye, x, y) {
    const outline = eye.outlines.find((one) => one.name === "retina"), points = this.pointsOf(outline), r = Math.hypot(x, y);
    let ring = 1;
    while (ring < outline.rings && Math.hypot(points[ring * outline.spokes][0], points[ring * outline.spokes][1]) < r) ++ring;
    const spoke = Math.round((Math.atan2(y, x) / (2 * Math.PI) + 1) * outline.spokes) % outline.spokes;
    const inner = points[(ring - 1) * outline.spokes + spoke], outer = points[ring * outline.spokes + spoke];
    const from = Math.hypot(inner[0], inner[1]), to = Math.hypot(outer[0], outer[1]), share = to > from ? (r - from) / (to - from) : 0;
    return [x, y, inner[2] + share * (outer[2] - inner[2])];
  }

  turnSolid() {
    this.angles = [0.7, 0.35];
    this.solid.tabIndex = 0;
    this.solid.style.touchAction = "none";
    let from = null;
    this.solid.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; this.solid.setPointerCapture(event.pointerId); });
    this.solid.addEventListener("pointerup", () => { from = null; });
    this.solid.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.turnBy((event.clientX - from[0]) / 90, (event.clientY - from[1]) / 90);
      from = [event.clientX, event.clientY];
    });
    this.solid.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] }[event.key];
      if (!way) return;
      event.preventDefault();
      this.turnBy(...way);
    });
  }

  turnBy(dx, dy) {
    this.angles = [this.angles[0] + dx, Math.max(-1.5, Math.min(1.5, this.angles[1] + dy))];
    this.drawSolid();
  }

  /// Mean power of the wavefront that leaves a point of the retina (D, what a lens before the eye would have to be).
  defocusAt(eye, bundle, x, y) {
    const at = bundle.polynomialAt(x, y);
    const own = pupilPlaces.map(([px, py]) => eye.map.ray(at, px, py));
    const mean = (of) => own.reduce((sum, ray) => sum + of(ray), 0) / own.length;
    const mx = mean((r) => r.at[0]), my = mean((r) => r.at[1]), ml = mean((r) => r.to[0]), mm = mean((r) => r.to[1]);
    const slope = mean((r) => (r.to[0] - ml) * (r.at[0] - mx) + (r.to[1] - mm) * (r.at[1] - my));
    return 1e3 * slope / mean((r) => (r.at[0] - mx) ** 2 + (r.at[1] - my) ** 2);
  }

  drawSolid() {
    const eye = this.living.shownEyes()[0], state = this.living.current, pen = this.solid.getContext("2d"), { width } = this.solid;
    const [a, b] = this.angles, middle = -eye.axial_length_mm / 2, scale = width / (1.25 * eye.axial_length_mm);
    const project = ([x, y, z]) => {
      const u = Math.cos(a) * (z - middle) - Math.sin(a) * x, w = Math.sin(a) * (z - middle) + Math.cos(a) * x;
      return [width / 2 - scale * u, width / 2 - scale * (Math.cos(b) * y - Math.sin(b) * w), Math.sin(b) * y + Math.cos(b) * w];
    };
    const key = JSON.stringify([eye.id, state.accommodation_D, state.pupil_mm, state.band, state.band_share, state.wavelength_nm]);
    if (this.defocusKey !== key) {
      this.defocusKey = key;
      const reach = eye.map.field_mm / 2, steps = 8;
      this.defocus = [];
      const bundle = new Bundle(eye.map, state, state.wavelength_nm ?? eye.map.reference_nm);
      for (let j = 0; j <= steps; ++j)
        for (let i = 0; i <= steps; ++i) this.defocus.push(this.defocusAt(eye, bundle, reach * (2 * i / steps - 1), reach * (2 * j / steps - 1)));
      const zero = this.defocus[(steps / 2) * (steps + 1) + steps / 2];
      this.defocus = this.defocus.map((value) => value - zero);
      this.defocusSteps = steps;
    }
    pen.clearRect(0, 0, width, width);
    pen.lineWidth = 1;
    const ink = getComputedStyle(this.solid).color;
    for (const outline of eye.outlines) {
      const points = this.pointsOf(outline).map(project);
      pen.strokeStyle = ink;
      pen.globalAlpha = outline.name === "retina" ? 0.25 : 0.45;
      for (let ring = 0; ring < outline.rings; ++ring)
        for (let spoke = 0; spoke < outline.spokes; ++spoke) {
          const p = points[ring * outline.spokes + spoke], q = points[(ring + 1) * outline.spokes + spoke], r = points[(ring + 1) * outline.spokes + (spoke + 1) % outline.spokes];
          if (![...p, ...q, ...r].every(Number.isFinite)) continue;
          pen.beginPath();
          if (spoke % 2 === 0) { pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]); } else pen.moveTo(q[0], q[1]);
          if (ring % 2 === 1) { pen.moveTo(q[0], q[1]); pen.lineTo(r[0], r[1]); }
          pen.stroke();
        }
    }
    pen.globalAlpha = 0.9;
    const steps = this.defocusSteps, reach = eye.map.field_mm / 2, most = Math.max(0.5, ...this.defocus.map(Math.abs));
    for (let j = 0; j < steps; ++j)
      for (let i = 0; i < steps; ++i) {
        const corner = (k, l) => project(this.retinaAt(eye, reach * (2 * (i + k) / steps - 1), reach * (2 * (j + l) / steps - 1)));
        const value = [0, 1].flatMap((l) => [0, 1].map((k) => this.defocus[(j + l) * (steps + 1) + i + k])).reduce((sum, v) => sum + v, 0) / 4 / most;
        pen.fillStyle = value < 0 ? `rgb(255,${Math.round(255 * (1 + value))},${Math.round(255 * (1 + value))})` : `rgb(${Math.round(255 * (1 - value))},${Math.round(255 * (1 - value))},255)`;
        pen.beginPath();
        for (const [k, l] of [[0, 0], [1, 0], [1, 1], [0, 1]]) pen.lineTo(...corner(k, l).slice(0, 2));
        pen.fill();
      }
    pen.globalAlpha = 1;
    const dot = project(this.retinaAt(eye, state.field_x_mm, state.field_y_mm));
    pen.fillStyle = "#d08700";
    pen.beginPath();
    pen.arc(dot[0], dot[1], 6, 0, 7);
    pen.fill();
    pen.fillStyle = ink;
    pen.font = "24px sans-serif";
    pen.fillText(`\u00b1${most.toFixed(1)} D`, 10, width - 12);
    this.solid.setAttribute("role", "img");
    this.solid.setAttribute("aria-label", `The eye's surfaces; refraction of the retina within ${(2 * reach).toFixed(0)} mm, to ${most.toFixed(1)} D from its middle`);
  }
}
