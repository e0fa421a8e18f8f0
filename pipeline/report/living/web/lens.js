"use strict";
// Spectacle lenses before the eye, the same surfaces as raytrace/spectacle: a biconic back, a plane or spherical front
// that a prism tilts. Frame: the eye's, looking straight ahead (x to the patient's left, y up, z out of the eye, mm).

const radian = Math.PI / 180;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a, b, times = 1) => [a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]];
const unit = (a) => { const length = Math.hypot(...a); return a.map((c) => c / length); };

/// What bends light: curvatures in 1/mm along the axis (x') and across it.
class Lens {
  constructor({ sphere_D, cylinder_D, axis_deg, vertex_distance_mm, prism_D, prism_base_deg, is_thick, base_D, index }) {
    this.index = is_thick ? index : 1.5;
    this.back_mm = vertex_distance_mm;
    this.axis = [Math.cos(axis_deg * radian), Math.sin(axis_deg * radian)];
    const deviation = Math.atan(prism_D / 100);
    const tilt = Math.atan2(Math.sin(deviation), this.index - Math.cos(deviation)), base = prism_base_deg * radian;
    this.front_normal = [-Math.sin(tilt) * Math.cos(base), -Math.sin(tilt) * Math.sin(base), Math.cos(tilt)];
    const curvature = (power_D) => power_D * 1e-3 / (1 - this.index);
    if (!is_thick) {
      this.front = 0;
      this.back = [curvature(sphere_D), curvature(sphere_D + cylinder_D)];
      this.thickness_mm = 4 + 12 * Math.tan(tilt);
      return;
    }
    this.front = base_D * 1e-3 / (this.index - 1);
    const backOf = (thickness) => {
      const fromFront = base_D / (1 - 1e-3 * thickness / this.index * base_D);
      return [curvature(sphere_D - fromFront), curvature(sphere_D + cylinder_D - fromFront)];
    };
    const rim_mm = 30, edge_mm = 1;
    const sag = (c) => c * rim_mm ** 2 / (1 + Math.sqrt(Math.max(0, 1 - (c * rim_mm) ** 2)));
    this.thickness_mm = 2;
    for (let round = 0; round < 8; ++round) {
      const least = Math.min(this.thickness_mm, ...backOf(this.thickness_mm).map((c) => this.thickness_mm + sag(c) - sag(this.front)));
      this.thickness_mm = Math.max(2, this.thickness_mm + edge_mm - (least - Math.tan(tilt) * rim_mm));
    }
    this.back = backOf(this.thickness_mm);
  }

  /// Depth of the back surface behind its vertex, and its slopes.
  backAt(x, y) {
    const [c, s] = this.axis, along = c * x + s * y, across = c * y - s * x, [a, b] = this.back;
    const bent = a * along ** 2 + b * across ** 2, root = Math.sqrt(1 - (a * along) ** 2 - (b * across) ** 2);
    const slope = (k, at) => (2 * k * at * (1 + root) + bent * k * k * at / root) / (1 + root) ** 2;
    const u = slope(a, along), v = slope(b, across);
    return { depth: bent / (1 + root), slopes: [c * u - s * v, s * u + c * v] };
  }

  /// The ray beyond the lens and its hits on both surfaces; nothing where it misses one.
  pass(ray) {
    const to = unit(ray.to);
    let t = (this.back_mm - ray.at[2]) / to[2], at, surface;
    for (let step = 0; step < 6; ++step) {
      at = plus(ray.at, to, t);
      surface = this.backAt(at[0], at[1]);
      t -= (at[2] + surface.depth - this.back_mm) / (to[2] + surface.slopes[0] * to[0] + surface.slopes[1] * to[1]);
    }
    at = plus(ray.at, to, t);
    const inside = refract(to, unit([...this.backAt(at[0], at[1]).slopes, 1]), 1 / this.index);
    const from = plus(at, [0, 0, -this.back_mm - this.thickness_mm]);
    const b = this.front * dot(from, inside) + dot(this.front_normal, inside);
    const f = this.front * dot(from, from) + 2 * dot(this.front_normal, from);
    const path = -f / (b + Math.sqrt(b * b - this.front * f));
    const end = plus(at, inside, path);
    if (!end.every(Number.isFinite)) return null;
    const normal = plus(this.front_normal, plus(from, inside, path), this.front);
    return { at: end, to: refract(inside, unit(normal), this.index), hits: [at, end] };
  }
}

/// Snell's law for a ray along the normal's side; eta: index before over behind.
function refract(to, normal, eta) {
  const cosine = dot(normal, to);
  return plus(to.map((c) => eta * c), normal, Math.sqrt(1 - eta * eta * (1 - cosine * cosine)) - eta * cosine);
}

/// The turn of the eye from straight ahead by Listing's law: rows of the matrix head from eye.
function turnOf([horizontal_deg, vertical_deg]) {
  const [x, y, z] = unit([Math.tan(horizontal_deg * radian), Math.tan(vertical_deg * radian), 1]);
  // takes +z to (x, y, z) about an axis across both
  return [[1 - x * x / (1 + z), -x * y / (1 + z), x], [-x * y / (1 + z), 1 - y * y / (1 + z), y], [-x, -y, z]];
}

/// A ray of the turned eye in the head's frame.
function turned(ray, turn, rotation_centre_mm) {
  const centre = [0, 0, -rotation_centre_mm];
  const rotate = (v) => turn.map((row) => dot(row, v));
  return { at: plus(rotate(plus(ray.at, centre, -1)), centre), to: rotate(ray.to) };
}
