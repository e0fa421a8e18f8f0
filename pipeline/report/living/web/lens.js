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

  /// Depth of the back surface behind its vertex.
  backDepth(x, y) {
    const [c, s] = this.axis, along = c * x + s * y, across = c * y - s * x, [a, b] = this.back;
    return (a * along ** 2 + b * across ** 2) / (1 + Math.sqrt(1 - (a * along) ** 2 - (b * across) ** 2));
  }

  /// The ray beyond the lens and its hits on both surfaces; nothing where it misses one.
  pass({ at: [x, y, z], to }) {
    let [l, m, n] = unit(to), t = (this.back_mm - z) / n, slope_x = 0, slope_y = 0;
    const [c, s] = this.axis, [a, b] = this.back;
    for (let step = 0; step < 4; ++step) {
      const hit_x = x + t * l, hit_y = y + t * m, along = c * hit_x + s * hit_y, across = c * hit_y - s * hit_x;
      const bent_a = a * along, bent_b = b * across, root = Math.sqrt(1 - bent_a * bent_a - bent_b * bent_b);
      const bent = bent_a * along + bent_b * across, wide = 1 + root, share = 1 / (wide * wide);
      const u = (2 * bent_a * wide + bent * a * bent_a / root) * share, v = (2 * bent_b * wide + bent * b * bent_b / root) * share;
      slope_x = c * u - s * v;
      slope_y = s * u + c * v;
      t -= (z + t * n + bent / wide - this.back_mm) / (n + slope_x * l + slope_y * m);
    }
    const back = [x + t * l, y + t * m, z + t * n], steep = 1 / Math.sqrt(1 + slope_x * slope_x + slope_y * slope_y);
    [l, m, n] = refract(l, m, n, slope_x * steep, slope_y * steep, steep, 1 / this.index);
    const [fx, fy, fz] = this.front_normal, k = this.front, depth = back[2] - this.back_mm - this.thickness_mm;
    const along = k * (back[0] * l + back[1] * m + depth * n) + fx * l + fy * m + fz * n;
    const off = k * (back[0] * back[0] + back[1] * back[1] + depth * depth) + 2 * (fx * back[0] + fy * back[1] + fz * depth);
    const path = -off / (along + Math.sqrt(along * along - k * off));
    const front = [back[0] + path * l, back[1] + path * m, back[2] + path * n];
    [l, m, n] = refract(l, m, n, fx + k * front[0], fy + k * front[1], fz + k * (depth + path * n), this.index);
    return Number.isFinite(l + m + n + front[2]) ? { at: front, to: [l, m, n], hits: [back, front] } : null;
  }
}

/// Snell's law for a ray along the side of the unit normal (x, y, z); eta: index before over behind.
function refract(l, m, n, x, y, z, eta) {
  const cosine = l * x + m * y + n * z, bend = Math.sqrt(1 - eta * eta * (1 - cosine * cosine)) - eta * cosine;
  return [eta * l + bend * x, eta * m + bend * y, eta * n + bend * z];
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
