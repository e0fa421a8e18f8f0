"use strict";
// How sharp the image of a point is: rays from the middle of the field through the whole pupil, by geometrical optics.

/// Places over the pupil of equal area.
const pupilPlaces = (() => {
  const rings = 7, places = [];
  for (let i = 0; i < rings; ++i)
    for (let k = 0; k < 4 * rings; ++k) {
      const rho = Math.sqrt((i + 0.5) / rings), angle = 2 * Math.PI * (k + 0.5 * (i % 2)) / (4 * rings);
      places.push([rho * Math.cos(angle), rho * Math.sin(angle)]);
    }
  return places;
})();

/// Where rays meet the plane across their mean at the scene's distance, as visual angles from it (mrad, patient's right and
/// up), and their share of the light; and how many of them the spectacle loses.
function spotOf(eye, state, wavelength_nm) {
  const { map } = eye, distance_mm = Math.min(far_mm, state.distance_mm);
  // What stays while only the lens changes.
  const key = JSON.stringify([wavelength_nm, state.stiles_crawford_per_mm2, state.pupil_mm, state.accommodation_D, state.band, state.band_share, state.field_x_mm, state.field_y_mm]);
  if (eye.bundleKey !== key) {
    const scale = state.pupil_mm / map.pupil_mm;
    const at = map.atField(map.raysOf({ ...state, wavelength_nm }), state.field_x_mm, state.field_y_mm, scale);
    const share = map.weightsOf(state.accommodation_D, scale)(state.field_x_mm, state.field_y_mm);
    const falloff = state.stiles_crawford_per_mm2 * (state.pupil_mm * eye.entrance_pupil_magnification / 2) ** 2;
    eye.bundle = pupilPlaces.map(([px, py]) => ({ ray: map.ray(at, px, py),
      weight: 10 ** (-falloff * (px * px + py * py)) * (share[0] + px * (share[1] + px * share[2] + py * share[4]) + py * (share[3] + py * share[5])) }));
    eye.bundleKey = key;
  }
  const lens = lensOf(state), turn = turnOf(state.gaze_deg), outside = [];
  for (const { ray, weight } of eye.bundle) {
    const head = turned(ray, turn, eye.rotation_centre_mm), out = lens ? lens.pass(head) : head;
    if (out) outside.push({ at: out.at, to: unit(out.to), weight });
  }
  if (outside.length === 0) throw new Error("no ray passes the spectacle");
  const average = (of) => outside.reduce((sum, ray) => plus(sum, of(ray), 1 / outside.length), [0, 0, 0]);
  const ahead = unit(average((ray) => ray.to)), target = plus(average((ray) => ray.at), ahead, distance_mm);
  const right = unit([-ahead[2], 0, ahead[0]]);  // the patient's, across the mean ray
  const down = [ahead[1] * right[2] - ahead[2] * right[1], ahead[2] * right[0] - ahead[0] * right[2], ahead[0] * right[1] - ahead[1] * right[0]];
  const rays = outside.map(({ at, to, weight }) => {
    const hit = plus(plus(at, to, dot(plus(target, at, -1), ahead) / dot(to, ahead)), target, -1);
    return { x: 1e3 * dot(hit, right) / distance_mm, y: -1e3 * dot(hit, down) / distance_mm, weight };
  });
  rays.lost = 1 - outside.length / eye.bundle.length;
  const light = rays.reduce((sum, ray) => sum + ray.weight, 0);
  for (const ray of rays) ray.weight /= light;
  const mean = (c) => rays.reduce((sum, ray) => sum + ray.weight * ray[c], 0), x = mean("x"), y = mean("y");
  for (const ray of rays) { ray.x -= x; ray.y -= y; }
  return rays;
}

/// Modulus of the optical transfer function at a frequency (cycles a degree) along a direction.
function transfer(rays, cpd, [ux, uy]) {
  const k = 2 * Math.PI * cpd / radian * 1e-3;
  let re = 0, im = 0;
  for (const ray of rays) {
    const phase = k * (ux * ray.x + uy * ray.y);
    re += ray.weight * Math.cos(phase);
    im += ray.weight * Math.sin(phase);
  }
  return Math.hypot(re, im);
}

/// Mean squared slope of the image of a chart whose power falls as f^-3 (0.2 to 30 cycles a degree), blurred by 1 arcmin
/// and as sharp as a pinhole's at 1: what `emmetrope correct` maximises on traced pictures.
function sharpnessOf(rays) {
  const frequencies = 60, directions = 16, coarsest = 0.2, finest = 30;
  let whole = 0, kept = 0;
  for (let k = 0; k < frequencies; ++k) {
    const cpd = coarsest * (finest / coarsest) ** ((k + 0.5) / frequencies), phase = 2 * Math.PI * cpd / 60;
    const weight = cpd * Math.exp(-phase * phase - 2 * (cpd / 30) ** 4);
    for (let d = 0; d < directions; ++d) {
      const turn = Math.PI * d / directions;
      whole += weight;
      kept += weight * transfer(rays, cpd, [Math.cos(turn), Math.sin(turn)]) ** 2;
    }
  }
  return kept / whole;
}

/// Root mean square radius of the blur, arcmin.
const blurOf = (rays) => Math.sqrt(rays.reduce((sum, ray) => sum + ray.weight * (ray.x ** 2 + ray.y ** 2), 0)) / 1e3 / radian * 60;

/// Letters that are just read, logMAR, where the blur alone limits: a detail of a fifth of the disc of blur's width, not
/// below a minute of arc (Smith, Optom. Vis. Sci. 68, 591, 1991: 0.65 arcmin for each dioptre and mm of pupil).
const acuityOf = (blur_arcmin) => Math.log10(Math.hypot(1, 0.65 / 3.438 * 2 * Math.SQRT2 * blur_arcmin));

/// The blur of the middle of the field, in an eye's own state.
function qualityOf(eye, state) {
  const rays = spotOf(eye, state, state.wavelength_nm ?? eye.map.reference_nm);
  const blur_arcmin = blurOf(rays);
  return { blur_arcmin, logmar: acuityOf(blur_arcmin), sharpness: sharpnessOf(rays), lost: rays.lost, rays };
}
