"use strict";
// Eye, gaze and spectacle together: exact rays from points of the retina through the whole pupil, and the polynomials of
// the pupil that follow them, which the shader evaluates.

/// Solution X of A X = B by elimination with pivots.
function solved(a, b) {
  const rows = a.map((row, i) => [...row, ...b[i]]), n = a.length;
  for (let k = 0; k < n; ++k) {
    let pivot = k;
    for (let i = k + 1; i < n; ++i) if (Math.abs(rows[i][k]) > Math.abs(rows[pivot][k])) pivot = i;
    [rows[k], rows[pivot]] = [rows[pivot], rows[k]];
    for (let i = 0; i < n; ++i) {
      if (i === k) continue;
      const factor = rows[i][k] / rows[k][k];
      for (let j = k; j < rows[i].length; ++j) rows[i][j] -= factor * rows[k][j];
    }
  }
  return rows.map((row, k) => row.slice(n).map((value) => value / row[k]));
}

/// Places in the pupil, denser towards its rim, as raytrace/retina/pupil_polynomial.cpp has them.
const beamPlaces = (() => {
  const rings = 6, spokes = 14, places = [];
  for (let i = 0; i < rings; ++i)
    for (let j = 0; j < spokes; ++j) {
      const rho = Math.sin(Math.PI / 2 * (i + 0.5) / rings), angle = 2 * Math.PI * (j + 0.3 * i) / spokes;
      places.push([rho * Math.cos(angle), rho * Math.sin(angle)]);
    }
  return places;
})();
const powersByDegree = new Map();
function powersAt(degree) {
  if (!powersByDegree.has(degree)) powersByDegree.set(degree, beamPlaces.map(([x, y]) => exponents(degree).map(([m, n]) => x ** m * y ** n)));
  return powersByDegree.get(degree);
}

/// By degree: the matrix from values at the places to the coefficients of least squares.
const leastSquares = new Map();
function leastSquaresOf(degree) {
  if (!leastSquares.has(degree)) {
    const rows = powersAt(degree), columns = rows[0].map((_, t) => rows.map((row) => row[t]));
    leastSquares.set(degree, solved(columns.map((a) => columns.map((b) => a.reduce((sum, v, s) => sum + v * b[s], 0))), columns));
  }
  return leastSquares.get(degree);
}

/// How far (arcmin) polynomials may miss rays: at rest, and while something moves.
const restTolerance_arcmin = 0.01, motionTolerance_arcmin = 0.05;
const polynomials = { largestDegree: 6 };  // what the graphics can interpolate (picture.js)

/// Rays out of an eye in one state at one wavelength, before gaze and spectacle: the part that stays while a lens is
/// dragged.
class Bundle {
  constructor(map, state, wavelength_nm, rays = map.raysOf({ ...state, wavelength_nm })) {
    this.map = map;
    this.scale = state.pupil_mm / map.pupil_mm;
    this.rays = rays;
    this.powers = powersAt(map.pupil_degree);
    this.points = new Map();
  }

  polynomialAt(x_mm, y_mm) { return this.map.atField(this.rays, x_mm, y_mm, this.scale); }

  /// At a point of the retina: x, y on the plane of the corneal apex and slopes, for each of the places.
  at(x_mm, y_mm) {
    const key = `${x_mm},${y_mm}`;
    if (!this.points.has(key)) {
      const polynomial = this.polynomialAt(x_mm, y_mm), values = new Float64Array(4 * this.powers.length);
      this.powers.forEach((powers, s) => {
        for (let t = 0; t < powers.length; ++t) for (let c = 0; c < 4; ++c) values[4 * s + c] += polynomial[4 * t + c] * powers[t];
      });
      this.points.set(key, values);
    }
    return this.points.get(key);
  }
}

/// A bundle beyond the spectacle, in the head's frame.
class Beam {
  /// eye: { map, rotation_centre_mm }. Throws where rays do not pass the spectacle.
  constructor(eye, state, wavelength_nm, bundle = new Bundle(eye.map, state, wavelength_nm)) {
    this.map = eye.map;
    this.bundle = bundle;
    this.lens = lensOf(state);
    this.turn = state.gaze_deg.some((angle) => angle) ? turnOf(state.gaze_deg) : null;
    this.rotation_centre_mm = eye.rotation_centre_mm;
    this.plane_mm = this.lens ? this.lens.back_mm + this.lens.thickness_mm : 0;
  }

  /// A ray from the retina through a place of the pupil; null if it misses the spectacle.
  ray(x_mm, y_mm, px, py) {
    return this.beyond(this.map.ray(this.bundle.polynomialAt(x_mm, y_mm), px, py));
  }

  beyond(ray) {
    const head = this.turn ? turned(ray, this.turn, this.rotation_centre_mm) : ray;
    return this.lens ? this.lens.pass(head) : head;
  }

  /// By how much the spectacle enlarges the pupil that is seen through it: it narrows the angles between the lines of sight of
  /// neighbouring points of the retina as much (Lagrange's invariant). The mean of both directions.
  pupilMagnification(x_mm, y_mm) {
    if (!this.lens) return 1;
    const step_mm = 0.1, apart = (one, other) => Math.hypot(...unit(one.to).map((value, i) => value - unit(other.to)[i]));
    const bare = (x, y) => this.map.ray(this.bundle.polynomialAt(x, y), 0, 0), worn = (x, y) => this.ray(x, y, 0, 0);
    const along = (dx, dy) => {
      const ends = [[x_mm + dx, y_mm + dy], [x_mm - dx, y_mm - dy]], seen = ends.map((end) => worn(...end));
      return seen.every((ray) => ray) ? apart(...ends.map((end) => bare(...end))) / apart(...seen) : NaN;
    };
    return Math.sqrt(along(step_mm, 0) * along(0, step_mm)) || 1;  // 1 where the rim of the lens is in the way
  }

  /// At a point of the retina: x, y on the plane, slopes, for each of the places.
  values(x_mm, y_mm) {
    const bare = this.bundle.at(x_mm, y_mm);
    if (!this.turn && !this.lens) return bare;
    const values = new Float64Array(bare.length);
    for (let first = 0; first < bare.length; first += 4) {
      const ray = this.beyond({ at: [bare[first], bare[first + 1], 0], to: [bare[first + 2], bare[first + 3], 1] });
      if (!ray || !(ray.to[2] > 0)) throw new Error("through this spectacle and in this direction of gaze rays do not leave the lens");
      const l = ray.to[0] / ray.to[2], m = ray.to[1] / ray.to[2], ahead = this.plane_mm - ray.at[2];
      values[first] = ray.at[0] + ahead * l;
      values[first + 1] = ray.at[1] + ahead * m;
      values[first + 2] = l;
      values[first + 3] = m;
    }
    return values;
  }

  /// Coefficients of a degree at a point of the retina: [term][x, y, L/N, M/N].
  polynomial(x_mm, y_mm, degree, values = this.values(x_mm, y_mm)) {
    const rows = leastSquaresOf(degree), out = new Float64Array(4 * rows.length);
    for (let t = 0; t < rows.length; ++t) {
      const row = rows[t];
      for (let s = 0; s < row.length; ++s) for (let c = 0; c < 4; ++c) out[4 * t + c] += row[s] * values[4 * s + c];
    }
    return out;
  }

  /// The least degree that follows the rays, and how far it misses them (arcmin).
  degreeAt(x_mm, y_mm, tolerance_arcmin) {
    const values = this.values(x_mm, y_mm);
    for (let degree = 3; ; ++degree) {
      const found = this.polynomial(x_mm, y_mm, degree, values);
      let most = 0;
      powersAt(degree).forEach((powers, s) => {
        for (const c of [2, 3]) {
          let value = 0;
          for (let t = 0; t < powers.length; ++t) value += found[4 * t + c] * powers[t];
          most = Math.max(most, Math.abs(value - values[4 * s + c]));
        }
      });
      const misses_arcmin = most / radian * 60;
      if (misses_arcmin < tolerance_arcmin || degree >= polynomials.largestDegree) return { degree, misses_arcmin };
    }
  }

  /// What a field is drawn with: coefficients at the corners of a mesh over it (picture.js), each corner's terms and then
  /// the six of the share of light. field: { x_mm, y_mm, size_mm }
  mesh(field, accommodation_D, tolerance_arcmin = restTolerance_arcmin) {
    const { degree } = this.degreeAt(field.x_mm, field.y_mm, tolerance_arcmin), terms = exponents(degree).length, count = 4 * terms;
    const nodes = field.size_mm > 2 ? 7 : 5, side = meshCells + 1;
    const node = (i) => Math.cos(Math.PI * (i + 0.5) / nodes);
    // Chebyshev coefficients over the field from values at its nodes, then values at the corners: one matrix for both.
    const corners = Array.from({ length: side }, (_, k) => {
      const at = chebyshev(2 * k / meshCells - 1, nodes);
      return Array.from({ length: nodes }, (__, i) => {
        const own = chebyshev(node(i), nodes);
        return at.reduce((sum, value, q) => sum + (q ? 2 : 1) / nodes * value * own[q], 0);
      });
    });
    const half = field.size_mm / 2, rowTexels = terms + 2;
    const values = new Float32Array(4 * rowTexels * side * side);
    const columns = Array.from({ length: nodes }, (_, q) => {
      const row = Array.from({ length: nodes }, (__, p) => this.polynomial(field.x_mm + half * node(p), field.y_mm + half * node(q), degree));
      return corners.map((weights) => {
        const sum = new Float64Array(count);
        weights.forEach((weight, p) => { for (let k = 0; k < count; ++k) sum[k] += weight * row[p][k]; });
        return sum;
      });
    });
    const weights = this.map.weightsOf(accommodation_D, this.bundle.scale);
    const place = (k) => half * (2 * k / meshCells - 1);
    for (let j = 0; j < side; ++j)
      for (let i = 0; i < side; ++i) {
        const first = 4 * rowTexels * (j * side + i);
        for (let q = 0; q < nodes; ++q) {
          const weight = corners[j][q], sum = columns[q][i];
          for (let k = 0; k < count; ++k) values[first + k] += weight * sum[k];
        }
        values.set(weights(field.x_mm + place(i), field.y_mm + place(j)), first + count);
      }
    return { degree, values, rowTexels, plane_mm: this.plane_mm };
  }

  /// How another wavelength's rays differ from this one's, to first order in pupil and field: three terms of the pupil
  /// (1, x, y), then the first one's slopes over the field (per half of it), four numbers each.
  differenceFrom(beam, field) {
    const change = (dx, dy) => {
      const at = [field.x_mm + dx * field.size_mm / 2, field.y_mm + dy * field.size_mm / 2];
      const own = this.polynomial(...at, 3), other = beam.polynomial(...at, 3);
      return own.map((value, k) => value - other[k]);
    };
    const middle = change(0, 0), sides = [[1, 0], [0, 1]].map(([x, y]) => {
      const ahead = change(x, y), behind = change(-x, -y);
      return [0, 1, 2, 3].map((c) => (ahead[c] - behind[c]) / 2);
    });
    // Terms of degree 3 are numbered 1, x, x^2, x^3, y, ...
    return [0, 1, 4].flatMap((t) => [...middle.slice(4 * t, 4 * t + 4)]).concat(...sides);
  }
}
