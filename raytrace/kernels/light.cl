// What the wave nature of light and the direction of receptors add to geometrical rays; off unless asked for.
#if STILES_CRAWFORD
// Weight of sample n: 2^(-falloff rho^2), rho its place in the pupil over the rim's.
AI vf receptor_weight(vu n, uint shift_1, float falloff) {
  return exp2(-falloff * unit_interval(n * 3242174889u + shift_1));
}
#endif

#if DIFFRACTION
// 16 angles wavelength / (pi pupil), then a table over w = 0..1 of v (1 - w^2), where w^2 is the share of
// light within v of the Airy disc (kept finite to its far rings).
#define AIRY_STEPS 1024
AI void diffract(ray* r, vu n, uint shift, int wave, constant float* restrict airy) {
  const vf share = AT_MOST(1.f - 1.f / 4096.f, unit_interval(n * 1779033704u + shift));
  const vf at = sqrt(share) * (float)AIRY_STEPS;
  const vi step = TO_VI(AT_MOST((float)AIRY_STEPS - 1.f, at));
  const vf part = at - TO_VF(step);
  const vf g = (1.f - part) * GATHER(vf, airy, 16, step) + part * GATHER(vf, airy, 17, step);
  vf s, c;
  angle(unit_interval(n * 3144134277u + scramble(shift)), &s, &c);
  const vf theta = (WAVE_LANES ? VLOAD(0, airy) : (vf)airy[wave]) * g * RECIP(1.f - share);
  s *= theta;
  c *= theta;
  // an orthonormal frame about the ray (Frisvad 2012)
  const vf a = RECIP(1.f + r->N), b = r->L * r->M * a, L = r->L, M = r->M;
  r->L += c * (1.f - L * L * a) - s * b;
  r->M += s * (1.f - M * M * a) - c * b;
  r->N -= c * L + s * M;
}
#endif
