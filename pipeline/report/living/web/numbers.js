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
    this.path = figure("The way of the light", "Vertical section of the eye, seen from its side, as it looks and accommodates now; rays from the middle of the picture through the pupil, out of the eye and through the lens.");
    this.path.parentElement.classList.add("wide");
    this.solid = this.canvasIn(figure("The eye in space", "Drag to turn. The retina out to 60 degrees of the visual field is coloured by the refraction of its place less that on the axis, at rest and without a lens: red more hyperopic, with the centre corrected the image there lies behind the retina; blue more myopic. Towards the rim a measured retina is extrapolated. Where it has no colour it sees nothing of the field. The dot is the middle of the picture."));
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
      const value = (power) => qualityOf(eye, { ...state, ...plain, ...fromPower(power) }).sharpness;
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
    const nm = state.wavelength_nm ?? eye.map.reference_nm, entrance_mm = state.pupil_mm * eye.entrance_pupil_magnification * new Beam(eye, state, nm).pupilMagnification(state.field_x_mm, state.field_y_mm);
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
      axes: [{ stroke: ink, grid, label: "cycles a degree", labelSize: 20 }, { stroke: ink, grid, size: 56 }],
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
    const turn = state.gaze_deg.some((angle) => angle) ? turnOf(state.gaze_deg) : null;
    const head = (at) => turn ? turned({ at, to: [0, 0, 1] }, turn, eye.rotation_centre_mm).at : at;
    const share = eye.map.largest_accommodation_D > 0 ? state.accommodation_D / eye.map.largest_accommodation_D : 0;
    for (const outline of eye.outlines) {
      const points = this.pointsOf(outline, share).map(head), line = [];
      for (let ring = outline.rings; ring > 0; --ring) line.push(points[ring * outline.spokes + 3 * outline.spokes / 4]);
      for (let ring = 0; ring <= outline.rings; ++ring) line.push(points[ring * outline.spokes + outline.spokes / 4]);
      svg.append(svgElement("polyline", { class: "s", points: line.filter((p) => p.every(Number.isFinite)).map(at).join(" ") }));
    }
    const front_lens = eye.outlines.find((one) => one.name === "lens_anterior");
    const forward_mm = front_lens ? this.pointsOf(front_lens, share)[0][2] - this.pointsOf(front_lens)[0][2] : 0;  // the lens takes the iris along
    for (const side of [-1, 1])  // the iris about the pupil
      svg.append(svgElement("polyline", { class: "s", points: [state.pupil_mm / 2, 5.5].map((y) => at(head([0, side * y, forward_mm - eye.stop_depth_mm]))).join(" ") }));
    const lens = lensOf(state);
    if (lens) svg.append(this.lensSection(lens, at));
    const beam = new Beam(eye, state, state.wavelength_nm ?? eye.map.reference_nm);
    for (let k = -3; k <= 3; ++k) {
      const p = k / 3;
      const inside = eye.map.path(state.accommodation_D, state.field_x_mm, state.field_y_mm, 0, p * beam.bundle.scale).filter((_, i) => eye.map.surfaces[i] !== "stop");
      const out = beam.ray(state.field_x_mm, state.field_y_mm, 0, p);
      if (!out) continue;
      const ahead = (front - out.at[2]) / out.to[2];
      const ways = [...[this.retinaAt(eye, state.field_x_mm, state.field_y_mm), ...inside].map(head), ...(lens ? out.hits : []), plus(out.at, out.to, ahead)];
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

  /// share: of the largest accommodation; the parabola through rest, half and all of it.
  pointsOf(outline, share = 0) {
    outline.decoded ??= [outline.points, ...(outline.changes ?? [])].map(floatsOf);
    const [rest, half, all] = outline.decoded;
    const at = (i) => share && half ? rest[i] + 4 * share * (1 - share) * half[i] + share * (2 * share - 1) * all[i] : rest[i];
    return Array.from({ length: rest.length / 3 }, (_, k) => [at(3 * k), at(3 * k + 1), at(3 * k + 2)]);
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

  /// The refraction of the retina as quadrangles between its rings: { corners, value_D }.
  coloursOf(eye) {
    if (eye.colours) return eye.colours;
    const { rings, spokes, places } = eye.retina, numbers = floatsOf(places);
    const place = (ring, spoke) => {
      const first = 4 * (ring ? 1 + (ring - 1) * spokes + spoke % spokes : 0);
      return Array.from(numbers.slice(first, first + 4));
    };
    eye.colours = [];
    for (let ring = 0; ring < rings; ++ring)
      for (let spoke = 0; spoke < spokes; ++spoke) {
        const corners = [place(ring, spoke), place(ring + 1, spoke), place(ring + 1, spoke + 1), place(ring, spoke + 1)];
        if (corners.flat().every(Number.isFinite)) eye.colours.push({ corners, value_D: corners.reduce((sum, c) => sum + c[3], 0) / 4 });
      }
    return eye.colours;
  }

  drawSolid() {
    const eye = this.living.shownEyes()[0], state = this.living.current, pen = this.solid.getContext("2d"), { width } = this.solid;
    const [a, b] = this.angles, middle = -eye.axial_length_mm / 2, scale = width / (1.25 * eye.axial_length_mm);
    const project = ([x, y, z]) => {
      const u = Math.cos(a) * (z - middle) - Math.sin(a) * x, w = Math.sin(a) * (z - middle) + Math.cos(a) * x;
      return [width / 2 - scale * u, width / 2 - scale * (Math.cos(b) * y - Math.sin(b) * w), Math.sin(b) * y + Math.cos(b) * w];
    };
    pen.clearRect(0, 0, width, width);
    pen.lineWidth = 1;
    const ink = getComputedStyle(this.solid).color, share = eye.map.largest_accommodation_D > 0 ? state.accommodation_D / eye.map.largest_accommodation_D : 0;
    const colours = this.coloursOf(eye), sizes = colours.map(({ value_D }) => Math.abs(value_D)).sort((p, q) => p - q), most = Math.max(0.5, sizes[Math.floor(0.9 * (sizes.length - 1))] ?? 0);  // the rim's last places shall not pale the rest
    const colour = (value) => {
      const pale = Math.round(255 * (1 - Math.min(1, Math.abs(value))));
      return value > 0 ? `rgb(255,${pale},${pale})` : `rgb(${pale},${pale},255)`;
    };
    pen.globalAlpha = 0.9;
    const far = colours.map(({ corners, value_D }) => {
      const points = corners.map(project);
      return { points, value_D, depth: points.reduce((sum, p) => sum + p[2], 0) };
    }).sort((one, other) => one.depth - other.depth);
    for (const { points, value_D } of far) {
      pen.fillStyle = pen.strokeStyle = colour(value_D / most);
      pen.beginPath();
      for (const p of points) pen.lineTo(p[0], p[1]);
      pen.closePath();
      pen.fill();
      pen.stroke();
    }
    for (const outline of eye.outlines) {
      const points = this.pointsOf(outline, share).map(project);
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
    pen.globalAlpha = 1;
    const dot = project(this.retinaAt(eye, state.field_x_mm, state.field_y_mm));
    pen.fillStyle = "#d08700";
    pen.beginPath();
    pen.arc(dot[0], dot[1], 6, 0, 7);
    pen.fill();
    this.drawScale(pen, width, most, colour, ink);
    this.solid.setAttribute("role", "img");
    this.solid.setAttribute("aria-label", `The eye's surfaces; refraction of the retina out to ${eye.retina.reach_deg} degrees, to ${most.toFixed(1)} D from that of its axis`);
  }

  drawScale(pen, width, most, colour, ink) {
    const bar = { x: 0.25 * width, y: width - 44, width: 0.5 * width, height: 14 }, steps = 40;
    for (let k = 0; k < steps; ++k) {
      pen.fillStyle = colour(2 * (k + 0.5) / steps - 1);
      pen.fillRect(bar.x + k / steps * bar.width, bar.y, bar.width / steps + 1, bar.height);
    }
    pen.fillStyle = ink;
    pen.font = "22px sans-serif";
    pen.textAlign = "center";
    for (const share of [-1, 0, 1]) pen.fillText(share ? `${signed(share * most, 1)} D` : "0", bar.x + (share + 1) / 2 * bar.width, width - 6);
  }
}
