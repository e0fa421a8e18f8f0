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
const powersAt = (degree) => beamPlaces.map(([x, y]) => exponents(degree).map(([m, n]) => x ** m * y ** n));

/// By degree: the matrix from values at the places to the coefficients of least squares.
const leastSquares = new Map();
function leastSquaresOf(degree) {
  if (!leastSquares.has(degree)) {
    const rows = powersAt(degree), columns = rows[0].map((_, t) => rows.map((row) => row[t]));
    leastSquares.set(degree, solved(columns.map((a) => columns.map((b) => a.reduce((sum, v, s) => sum + v * b[s], 0))), columns));
  }
  return leastSquares.get(degree);
}

/// Misses by more than this (arcmin) are not allowed where there is a polynomial that does better.
const beamTolerance_arcmin = 0.01;
const largestDegree = 6;

/// The rays of one state and wavelength before eye and spectacle.
class Beam {
  /// eye: { map, rotation_centre_mm }. Throws where rays do not pass the spectacle.
  constructor(eye, state, wavelength_nm) {
    this.map = eye.map;
    this.rays = eye.map.raysOf({ ...state, wavelength_nm });
    this.scale = state.pupil_mm / eye.map.pupil_mm;
    this.lens = lensOf(state);
    this.turn = state.gaze_deg.some((angle) => angle) ? turnOf(state.gaze_deg) : null;
    this.rotation_centre_mm = eye.rotation_centre_mm;
    this.plane_mm = this.lens ? this.lens.back_mm + this.lens.thickness_mm : 0;
    this.powers = powersAt(this.map.pupil_degree);
  }

  /// A ray from the retina through a place of the pupil, in the head's frame beyond the spectacle; null if it misses that.
  ray(x_mm, y_mm, px, py) {
    return this.beyond(this.map.ray(this.map.atField(this.rays, x_mm, y_mm, this.scale), px, py));
  }

  beyond(ray) {
    const head = this.turn ? turned(ray, this.turn, this.rotation_centre_mm) : ray;
    return this.lens ? this.lens.pass(head) : head;
  }

  /// At a point of the retina: x, y on the plane, slopes, for each of the places, one row each.
  values(x_mm, y_mm) {
    const at = this.map.atField(this.rays, x_mm, y_mm, this.scale), terms = this.map.pupilTerms.length;
    return this.powers.map((powers) => {
      const value = [0, 0, 0, 0];
      for (let t = 0; t < terms; ++t) for (let c = 0; c < 4; ++c) value[c] += at[4 * t + c] * powers[t];
      const ray = this.beyond({ at: [value[0], value[1], 0], to: [value[2], value[3], 1] });
      if (!ray || !(ray.to[2] > 0)) throw new Error("through this spectacle and in this direction of gaze rays do not leave the lens");
      const l = ray.to[0] / ray.to[2], m = ray.to[1] / ray.to[2], ahead = this.plane_mm - ray.at[2];
      return [ray.at[0] + ahead * l, ray.at[1] + ahead * m, l, m];
    });
  }

  /// Coefficients of a degree at a point of the retina: [term][x, y, L/N, M/N].
  polynomial(x_mm, y_mm, degree, values = this.values(x_mm, y_mm)) {
    return leastSquaresOf(degree).map((row) => [0, 1, 2, 3].map((c) => row.reduce((sum, weight, s) => sum + weight * values[s][c], 0)));
  }

  /// The least degree that follows the rays, and how far it misses them (arcmin).
  degreeAt(x_mm, y_mm) {
    const values = this.values(x_mm, y_mm);
    for (let degree = 3; ; ++degree) {
      const found = this.polynomial(x_mm, y_mm, degree, values);
      let most = 0;
      powersAt(degree).forEach((powers, s) => {
        for (const c of [2, 3]) most = Math.max(most, Math.abs(found.reduce((sum, term, t) => sum + term[c] * powers[t], 0) - values[s][c]));
      });
      const misses_arcmin = most / radian * 60;
      if (misses_arcmin < beamTolerance_arcmin || degree === largestDegree) return { degree, misses_arcmin };
    }
  }

  /// What a field is drawn with: coefficients at the corners of a mesh over it (picture.js), each corner's terms and then
  /// the six of the share of light. field: { x_mm, y_mm, size_mm }
  mesh(field, accommodation_D) {
    const { degree } = this.degreeAt(field.x_mm, field.y_mm), terms = exponents(degree).length, count = 4 * terms;
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
      const row = Array.from({ length: nodes }, (__, p) => this.polynomial(field.x_mm + half * node(p), field.y_mm + half * node(q), degree).flat());
      return corners.map((weights) => {
        const sum = new Float64Array(count);
        weights.forEach((weight, p) => { for (let k = 0; k < count; ++k) sum[k] += weight * row[p][k]; });
        return sum;
      });
    });
    const place = (k) => half * (2 * k / meshCells - 1);
    for (let j = 0; j < side; ++j)
      for (let i = 0; i < side; ++i) {
        const first = 4 * rowTexels * (j * side + i);
        for (let q = 0; q < nodes; ++q) {
          const weight = corners[j][q], sum = columns[q][i];
          for (let k = 0; k < count; ++k) values[first + k] += weight * sum[k];
        }
        values.set(this.map.weightsAt(accommodation_D, field.x_mm + place(i), field.y_mm + place(j), this.scale), first + count);
      }
    return { degree, values, rowTexels, plane_mm: this.plane_mm };
  }

  /// How another wavelength's rays differ from this one's, to first order in pupil and field: three terms of the pupil, the
  /// first with its slopes over the field (per half of it), four numbers each.
  differenceFrom(beam, field) {
    const change = (dx, dy) => {
      const at = [field.x_mm + dx * field.size_mm / 2, field.y_mm + dy * field.size_mm / 2];
      const own = this.polynomial(...at, 3), other = beam.polynomial(...at, 3);
      return own.map((term, t) => term.map((value, c) => value - other[t][c]));
    };
    // Terms of degree 3 are numbered 1, x, x^2, x^3, y, ...
    const middle = change(0, 0), slope = (a, b) => a[0].map((value, c) => (value - b[0][c]) / 2);
    return [middle[0], middle[1], middle[4], slope(change(1, 0), change(-1, 0)), slope(change(0, 1), change(0, -1))].flat();
  }
}
