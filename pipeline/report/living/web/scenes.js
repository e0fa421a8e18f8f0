"use strict";
// What there is to look at. A plane is { picture, centre, right, up }: mm in the head's frame, half width and height as
// the patient sees them (right is the head's -x); a picture is { image, linear } or { image } in sRGB.

const far_mm = 1e9;
const field_mm_of = { chart: 1.4, page: 4.2, wide: 5.6 };

function drawnCanvas(width, height, draw) {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  draw(canvas.getContext("2d"), width, height);
  return canvas;
}

/// Always the same numbers of 0 to 1.
function evenRandom(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 4294967296;
  };
}

function polygon(pen, colour, corners) {
  pen.fillStyle = colour;
  pen.beginPath();
  for (const corner of corners) pen.lineTo(...corner);
  pen.fill();
}

function drawStreet(pen, width, height) {
  const random = evenRandom(7), horizon = 0.56 * height, middle = 0.52 * width;
  const sky = pen.createLinearGradient(0, 0, 0, horizon);
  sky.addColorStop(0, "#5e97d1");
  sky.addColorStop(1, "#dfeaf2");
  pen.fillStyle = sky;
  pen.fillRect(0, 0, width, horizon);
  pen.fillStyle = "rgba(255,255,255,.75)";
  for (const [x, y, r] of [[0.2, 0.12, 60], [0.25, 0.1, 80], [0.31, 0.13, 55], [0.72, 0.2, 50], [0.77, 0.18, 70]]) {
    pen.beginPath();
    pen.ellipse(x * width, y * height, r * 1.6, r * 0.55, 0, 0, 7);
    pen.fill();
  }
  pen.fillStyle = "#8d938c";
  pen.fillRect(0, horizon, width, height - horizon);
  // A road to the vanishing point, pavements, the middle line.
  const wedge = (left, right, colour, from = 0) => {
    polygon(pen, colour, [[middle + (left - middle) * from, horizon + (height - horizon) * from], [middle + (right - middle) * from, horizon + (height - horizon) * from], [right, height], [left, height]]);
  };
  wedge(-1.2 * width, 2.2 * width, "#a9a59c");
  wedge(0.02 * width, 0.98 * width, "#55585c");
  for (let k = 0; k < 9; ++k) {
    const near = 1 / (1 + 0.55 * k), far = 1 / (1 + 0.55 * k + 0.25), y = (s) => horizon + (height - horizon) * s;
    polygon(pen, "#f2f2ea", [[middle - 9 * near, y(near)], [middle + 9 * near, y(near)], [middle + 9 * far, y(far)], [middle - 9 * far, y(far)]]);
  }
  // Houses: fronts between depths, the far ones first.
  const names = ["BAKERY", "OPTICIAN", "CAFE ROMA", "BOOKS", "PHARMACY", "FLOWERS", "HOTEL LUX", "CINEMA"];
  for (let k = 7; k >= 0; --k)
    for (const side of [-1, 1]) {
      const near = 1 / (0.62 + 0.42 * k), far = 1 / (0.62 + 0.42 * (k + 1)), edge = 0.52 * width * side;
      const x = (s) => middle + edge * s, base = (s) => horizon + 0.34 * height * s, tall = 0.55 + 0.35 * random();
      const top = (s) => horizon - tall * height * s, colour = ["#b9846a", "#c9b18a", "#8f9aa3", "#a5675a", "#d8cdb8"][Math.floor(5 * random())];
      polygon(pen, colour, [[x(near), base(near)], [x(near), top(near)], [x(far), top(far)], [x(far), base(far)]]);
      pen.fillStyle = side < 0 ? "rgba(0,0,0,.08)" : "rgba(0,0,0,.22)";
      pen.fill();
      const storeys = 4, bays = 4;
      const depth = (share) => 1 / (1 / near + (1 / far - 1 / near) * share);
      for (let storey = 0; storey < storeys; ++storey)
        for (let bay = 0; bay < bays; ++bay) {
          const a = depth((bay + 0.25) / bays), b = depth((bay + 0.75) / bays);
          const level = (s, part) => top(s) + (base(s) - top(s)) * (0.06 + (storey + part) / (storeys + 1.2));
          polygon(pen, storey === storeys - 1 ? "#3c4a52" : random() < 0.2 ? "#ffe9a8" : "#44586a", [[x(a), level(a, 0.2)], [x(b), level(b, 0.2)], [x(b), level(b, 0.8)], [x(a), level(a, 0.8)]]);
        }
      // A sign over the shop, its letters squeezed with the front.
      const a = depth(0.08), b = depth(0.92), left = side < 0 ? a : b, right = side < 0 ? b : a;
      const line = (s, part) => base(s) - (base(s) - top(s)) * part;
      polygon(pen, ["#7a1f1f", "#1f4d3a", "#1d3557", "#5b3a1e"][Math.floor(4 * random())], [[x(left), line(left, 0.2)], [x(right), line(right, 0.2)], [x(right), line(right, 0.27)], [x(left), line(left, 0.27)]]);
      pen.save();
      const wide = x(right) - x(left), rise = line(right, 0.235) - line(left, 0.235), size = (base(left) - top(left) + base(right) - top(right)) * 0.026;
      pen.setTransform(1, rise / wide, 0, 1, x(left), line(left, 0.235));
      pen.fillStyle = "#fff";
      pen.font = `bold ${size}px sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(names[(k + (side < 0 ? 0 : 4)) % 8], wide / 2, 0, 0.9 * wide);
      pen.restore();
    }
  // A car, a traffic light, a sign for the road.
  const car = (x, y, s, colour) => {
    pen.fillStyle = "rgba(0,0,0,.35)";
    pen.fillRect(x - 1.05 * s, y - 0.05 * s, 2.1 * s, 0.14 * s);
    pen.fillStyle = colour;
    pen.beginPath();
    pen.roundRect(x - s, y - 0.75 * s, 2 * s, 0.7 * s, 0.15 * s);
    pen.roundRect(x - 0.75 * s, y - 1.25 * s, 1.5 * s, 0.6 * s, 0.2 * s);
    pen.fill();
    pen.fillStyle = "#26323b";
    pen.fillRect(x - 0.62 * s, y - 1.17 * s, 1.24 * s, 0.4 * s);
    pen.fillStyle = "#d11";
    pen.fillRect(x - 0.95 * s, y - 0.62 * s, 0.3 * s, 0.16 * s);
    pen.fillRect(x + 0.65 * s, y - 0.62 * s, 0.3 * s, 0.16 * s);
    pen.fillStyle = "#f4f4f4";
    pen.fillRect(x - 0.35 * s, y - 0.5 * s, 0.7 * s, 0.2 * s);
    pen.fillStyle = "#111";
    pen.font = `bold ${0.17 * s}px monospace`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText("EM 2014", x, y - 0.4 * s, 0.66 * s);
  };
  car(0.585 * width, 0.68 * height, 0.035 * width, "#b8352c");
  car(0.47 * width, 0.62 * height, 0.014 * width, "#39608f");
  const post = (x, foot, head) => { pen.fillStyle = "#4a4a4a"; pen.fillRect(x - 0.0022 * width, head, 0.0044 * width, foot - head); };
  post(0.70 * width, 0.72 * height, 0.36 * height);
  pen.fillStyle = "#222";
  pen.fillRect(0.689 * width, 0.27 * height, 0.022 * width, 0.11 * height);
  ["#ff3b30", "#5a4a10", "#124a1c"].forEach((colour, k) => {
    pen.fillStyle = colour;
    pen.beginPath();
    pen.arc(0.7 * width, (0.292 + 0.033 * k) * height, 0.0075 * width, 0, 7);
    pen.fill();
  });
  post(0.33 * width, 0.72 * height, 0.44 * height);
  pen.fillStyle = "#1858a8";
  pen.beginPath();
  pen.roundRect(0.285 * width, 0.38 * height, 0.09 * width, 0.1 * height, 6);
  pen.fill();
  pen.fillStyle = "#fff";
  pen.font = `bold ${0.03 * height}px sans-serif`;
  pen.textAlign = "center";
  pen.fillText("City  \u2191", 0.33 * width, 0.415 * height);
  pen.fillText("Airport  \u2192", 0.33 * width, 0.455 * height, 0.08 * width);
}

const readingText = ["The eye is no camera obscura with a perfect lens.", "Its cornea is steeper in one meridian than in another,",
  "its pupil is not quite round, and its lens grows every", "year of our lives. Yet it shows us a street at dusk and",
  "the small print of a contract, and we complain only", "when it no longer does.", "",
  "Light from each point of this page passes the whole", "pupil. Where the parts of the pupil do not agree, the",
  "point becomes a patch, and letters run into their", "neighbours. A spectacle lens adds what is missing:",
  "so many dioptres of sphere, so many of cylinder, along", "an axis. A lens for the street is not the lens for this",
  "page unless the eye can add the rest by itself."];

/// A page of an A6 book, 105 x 148 mm: text of 2.2, 1.6 and 1.1 mm height of small letters.
function drawPage(pen, width, height) {
  const mm = width / 105;
  pen.fillStyle = "#fbfaf5";
  pen.fillRect(0, 0, width, height);
  pen.fillStyle = "#111";
  pen.textBaseline = "alphabetic";
  pen.font = `bold ${5.2 * mm}px serif`;
  pen.fillText("How we see", 9 * mm, 16 * mm);
  let y = 26;
  for (const [size, lines] of [[4.3, 6], [3.2, 8]]) {
    pen.font = `${size * mm}px serif`;
    for (const line of lines === 6 ? readingText.slice(0, 6) : readingText.slice(7)) {
      pen.fillText(line, 9 * mm, y * mm, 88 * mm);
      y += 1.45 * size;
    }
    y += 4;
  }
  pen.font = `${2.3 * mm}px serif`;
  for (const line of ["Small print: this page is set in three sizes, 12, 9 and 6.5 points. Held at 40 cm its", "small letters are about 17, 13 and 9 minutes of arc high; an eye of logMAR 0 reads",
    "letters of 5 minutes. Research use only."]) {
    pen.fillText(line, 9 * mm, y * mm, 88 * mm);
    y += 3.5;
  }
}

function drawBoard(title, lines, colour) {
  return (pen, width, height) => {
    pen.fillStyle = colour;
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = "#fff";
    pen.fillRect(0.05 * width, 0.05 * height, 0.9 * width, 0.9 * height);
    pen.fillStyle = colour;
    pen.textAlign = "center";
    pen.font = `bold ${0.12 * height}px sans-serif`;
    pen.fillText(title, width / 2, 0.2 * height, 0.86 * width);
    pen.fillStyle = "#111";
    lines.forEach((line, k) => {
      pen.font = `bold ${(0.16 - 0.03 * k) * height}px sans-serif`;
      pen.fillText(line, width / 2, (0.42 + 0.16 * k) * height, 0.86 * width);
    });
  };
}

/// The scenes by name: title, whether the distance can be set, the field that shows it, and planes at a distance.
class Scenes {
  constructor(charts) {
    this.pictures = new Map();
    this.all = new Map();
    const tan = (deg) => Math.tan(deg / 2 * radian);
    const flat = (picture, distance, half_x, half_y, x = 0, y = 0) =>
      ({ picture, centre: [x, y, distance], right: [-half_x, 0, 0], up: [0, half_y, 0] });
    const titles = { letters: "Letter chart", dial: "Astigmatism dial", siemens: "Siemens star" };
    for (const chart of charts)
      this.all.set(chart.name, { title: titles[chart.name], far: true, distance_mm: 6000, field_mm: field_mm_of.chart, background: [1, 1, 1],
        load: () => this.decode(chart),
        planes: (distance) => { const half = distance * tan(chart.extent_deg); return [flat(this.pictures.get(chart.name), distance, half, half)]; } });
    this.all.set("street", { title: "Street", far: true, distance_mm: 20000, field_mm: field_mm_of.wide, background: [0.6, 0.7, 0.8],
      load: () => this.draw("street", 2048, 1152, drawStreet),
      planes: (distance) => [flat(this.pictures.get("street"), distance, distance * tan(42), distance * tan(42) * 1152 / 2048)] });
    this.all.set("page", { title: "Page to read", far: true, distance_mm: 400, field_mm: field_mm_of.page, background: [0.25, 0.22, 0.2],
      load: () => this.draw("page", 1680, 2368, drawPage),
      planes: (distance) => [flat(this.pictures.get("page"), distance, 52.5, 74, 0, -26)] });
    this.all.set("depth", { title: "Near, middle, far", far: false, distance_mm: 1500, field_mm: field_mm_of.wide, background: [0.6, 0.7, 0.8],
      load: () => { this.all.get("street").load(); this.draw("phone", 512, 900, drawBoard("40 cm", ["18:42", "E F P", "T O Z L"], "#1d3557"));
        this.draw("board", 1024, 800, drawBoard("1.5 m", ["MENU", "Soup 4.50", "Pasta 9.80"], "#7a1f1f")); },
      planes: () => [flat(this.pictures.get("phone"), 400, 21, 37, 30, -18), flat(this.pictures.get("board"), 1500, 130, 102, -105, -60),
        flat(this.pictures.get("street"), 20000, 20000 * tan(42), 20000 * tan(42) * 1152 / 2048)] });
  }

  async decode(chart) {
    if (this.pictures.has(chart.name)) return;
    const image = new Image();
    image.src = chart.linear_png;
    await image.decode();
    this.pictures.set(chart.name, { image, linear: true });
  }

  draw(name, width, height, how) {
    if (!this.pictures.has(name)) this.pictures.set(name, { image: drawnCanvas(width, height, how) });
  }

  /// As a state asks for it; turned with the gaze about the eye's centre of rotation where it is to stay before the eye.
  async at({ scene: name, distance_mm, gaze_deg, scene_follows_gaze }, rotation_centre_mm) {
    const scene = this.all.get(name);
    await scene.load();
    const planes = scene.planes(Math.min(far_mm, distance_mm));
    if (!scene_follows_gaze || !gaze_deg.some((angle) => angle)) return { planes, background: scene.background };
    const turn = turnOf(gaze_deg), centre = [0, 0, -rotation_centre_mm], rotate = (v) => turn.map((row) => dot(row, v));
    return { background: scene.background, planes: planes.map((plane) => ({ picture: plane.picture,
      centre: plus(rotate(plus(plane.centre, centre, -1)), centre), right: rotate(plane.right), up: rotate(plane.up) })) };
  }
}
