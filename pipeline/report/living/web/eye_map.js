"use strict";
// The eye as polynomials (raytrace/eye_map/eye_map.hpp says in which coordinates): from a point of the retina and a
// point of the stop to the ray before the cornea.

const floatsOf = (base64) => new Float32Array(Uint8Array.from(atob(base64), (c) => c.charCodeAt(0)).buffer);

/// T_0(x) ... T_(count - 1)(x)
function chebyshev(x, count) {
  const values = [1, x];
  for (let i = 2; i < count; ++i) values.push(2 * x * values[i - 1] - values[i - 2]);
  return values.slice(0, count);
}

/// [i, j] with i + j <= degree, i rising, for j = 0 ... degree
const exponentsByDegree = new Map();
function exponents(degree) {
  if (!exponentsByDegree.has(degree)) {
    const pairs = [];
    for (let j = 0; j <= degree; ++j) for (let i = 0; i <= degree - j; ++i) pairs.push([i, j]);
    exponentsByDegree.set(degree, pairs);
  }
  return exponentsByDegree.get(degree);
}

/// Values of the products of Chebyshev polynomials over the field.
function fieldTerms(u, v, degree) {
  const inU = chebyshev(u, degree + 1), inV = chebyshev(v, degree + 1);
  return exponents(degree).map(([i, j]) => inU[i] * inV[j]);
}

class EyeMap {
  constructor(json, bands) {
    Object.assign(this, json);
    for (const part of ["rays", "weights", "paths"]) this[part] = floatsOf(json[part]);
    this.bands = bands.map((band) => ({ ...band, upper: floatsOf(band.upper), lower: floatsOf(band.lower) }));
    this.pupilTerms = exponents(this.pupil_degree);
    this.aTerm = this.rays.length / this.terms.length;  // numbers of a term of wavelength and accommodation
  }

  accommodationTerms(accommodation_D) {
    const a = this.largest_accommodation_D > 0 ? 2 * accommodation_D / this.largest_accommodation_D - 1 : 0;
    return chebyshev(a, this.accommodations);
  }

  /// Coefficients [field term][pupil term][x, y, L/N, M/N] of one state.
  raysOf({ accommodation_D, wavelength_nm, band, band_share }) {
    const low = this.longest_nm ** -2, high = this.shortest_nm ** -2;
    const nm = Math.min(this.longest_nm, Math.max(this.shortest_nm, wavelength_nm));
    const inW = chebyshev(2 * (nm ** -2 - low) / (high - low) - 1, 1 + Math.max(...this.terms.map((term) => term[1])));
    const inA = this.accommodationTerms(accommodation_D);
    const sum = new Float64Array(this.aTerm);
    this.terms.forEach(([l, k], term) => {
      const weight = inA[l] * inW[k], first = term * this.aTerm;
      for (let i = 0; i < sum.length; ++i) sum[i] += weight * this.rays[first + i];
    });
    const ends = this.bands[band];
    if (ends && band_share)
      for (let i = 0; i < sum.length; ++i)
        sum[i] += band_share * ((ends.upper[i] - ends.lower[i]) / 2 + band_share * (ends.upper[i] + ends.lower[i]) / 2);
    return sum;
  }

  /// Coefficients over the pupil at a point of the retina (mm from its pole): [pupil term][x, y, L/N, M/N].
  /// scale: the pupil over the widest one; places in the pupil are then -1 to 1 of the pupil itself.
  atField(rays, x_mm, y_mm, scale) {
    const terms = fieldTerms(2 * x_mm / this.field_mm, 2 * y_mm / this.field_mm, this.field_degree);
    const count = 4 * this.pupilTerms.length, out = new Float64Array(count);
    for (let f = 0, first = 0; f < terms.length; ++f, first += count) {
      const weight = terms[f];
      for (let i = 0; i < count; ++i) out[i] += weight * rays[first + i];
    }
    this.pupilTerms.forEach(([m, n], t) => {
      const power = scale ** (m + n);
      for (let c = 0; c < 4; ++c) out[4 * t + c] *= power;
    });
    return out;
  }

  /// The ray from a place in the pupil: where it meets the plane of the corneal apex, and its direction (not normed).
  ray(atField, px, py) {
    const value = [0, 0, 0, 0];
    this.pupilTerms.forEach(([m, n], t) => {
      const power = px ** m * py ** n;
      for (let c = 0; c < 4; ++c) value[c] += atField[4 * t + c] * power;
    });
    return { at: [value[0], value[1], 0], to: [value[2], value[3], 1] };
  }


  /// The share of light of places in the pupil, as a function of the point of the retina (mm): coefficients of a polynomial.
  weightsOf(accommodation_D, scale) {
    const pupil = exponents(this.weight_pupil_degree), field = exponents(this.weight_field_degree).length;
    const inA = this.accommodationTerms(accommodation_D), sum = new Float64Array(field * pupil.length);
    inA.forEach((weight, l) => { for (let k = 0; k < sum.length; ++k) sum[k] += weight * this.weights[l * sum.length + k]; });
    return (x_mm, y_mm) => {
      const inField = fieldTerms(2 * x_mm / this.field_mm, 2 * y_mm / this.field_mm, this.weight_field_degree);
      return pupil.map(([m, n], t) => {
        let value = 0;
        for (let f = 0; f < field; ++f) value += inField[f] * sum[f * pupil.length + t];
        return value * scale ** (m + n);
      });
    };
  }

  /// Where a ray meets the eye's surfaces, the retina's side first: points [x, y, z], mm, eye frame.
  path(accommodation_D, x_mm, y_mm, px, py) {
    const powers = exponents(this.path_degree).map(([m, n]) => px ** m * py ** n);
    const terms = powers.length, field = exponents(this.path_degree).length, surfaces = this.surfaces.length;
    const inField = fieldTerms(2 * x_mm / this.field_mm, 2 * y_mm / this.field_mm, this.path_degree);
    const inA = this.accommodationTerms(accommodation_D);
    const points = this.surfaces.map(() => [0, 0, 0]);
    for (let l = 0; l < inA.length; ++l)
      for (let k = 0; k < surfaces; ++k)
        for (let f = 0; f < field; ++f)
          for (let t = 0; t < terms; ++t) {
            const first = (((l * surfaces + k) * field + f) * terms + t) * 3;
            const weight = inA[l] * inField[f] * powers[t];
            for (let c = 0; c < 3; ++c) points[k][c] += weight * this.paths[first + c];
          }
    return points;
  }
}
