// Operations of the optical system, in the order that a ray from the retina meets them: 16 floats each, a kind, and the ratio of
// indices (before over after) for every one of 16 wavelengths.
#define SPHERE 0
#define QUADRIC 1
#define BICONIC 2
#define PATCH 3
#define STOP 4
#define ROTATE 5
#define TRIANGLES 6

#define WAVELENGTHS 16
#define SYSTEM                                                                                              \
  constant int* restrict kinds, constant float* restrict operations, constant float* restrict ratios,       \
      global const float* restrict records
#define SYSTEM_ARGUMENTS kinds, operations, ratios, records

// Lanes are the wavelengths where a work-item carries 16 rays; else wavelengths come one after the other.
#define RATIO(k, wave) (VLN == 1 ? (vf)ratios[(k) * WAVELENGTHS + (wave)] : VLOAD(k, ratios))

AI void pass(ray* r, int k, int wave, SYSTEM) {
  const int kind = kinds[k];
  constant float* p = operations + k * PARAMETERS;
  const vf eta = RATIO(k, wave);
  switch (kind) {
#if HAS_SPHERE
    case SPHERE: UNROLL for (int q = 0; q < UN; q++) sphere(r + q, p, eta); break;
#endif
#if HAS_QUADRIC
    case QUADRIC: UNROLL for (int q = 0; q < UN; q++) quadric(r + q, p, eta); break;
#endif
#if HAS_BICONIC
    case BICONIC: UNROLL for (int q = 0; q < UN; q++) biconic(r + q, p, eta); break;
#endif
#if HAS_PATCH
    case PATCH: UNROLL for (int q = 0; q < UN; q++) patch(r + q, p, records, eta); break;
#endif
#if HAS_STOP
    case STOP: UNROLL for (int q = 0; q < UN; q++) stop(r + q, p); break;
#endif
#if HAS_ROTATE
    case ROTATE: UNROLL for (int q = 0; q < UN; q++) rotate_ray(r + q, p); break;
#endif
  }
}

// sin and cos of 2 pi (u - 1/2), u in 0..1: the disc's angle, 2e-5 is ample for where a sample lies.
AI void angle(vf u, vf* s, vf* c) {
  const vf x = u - 0.5f, x2 = x * x;
  *s = x * (6.283185307f + x2 * (-41.34170224f + x2 * (81.60524927f + x2 * (-76.70585975f + x2 * (42.05869394f + x2 * (-15.09464258f + x2 * 3.4f))))));
  *c = 1.f + x2 * (-19.73920880f + x2 * (64.93939402f + x2 * (-85.45681720f + x2 * (60.24464137f + x2 * (-26.42625678f + x2 * 7.9f)))));
}

// A pixel: retina point (3), aim's centre (2), matrix that takes the unit disc to the aim ellipse (4), surface normal (3).
#define PIXEL 12

// Sample n of a pixel: R2 lattice (Roberts 2018) with a shift of the pixel's own.
AI void start(ray* r, vu n, uint shift_1, uint shift_2, global const float* restrict pixel, float aim_z, vf* weight) {
  const vf u1 = unit_interval(n * 3242174889u + shift_1), u2 = unit_interval(n * 2447445414u + shift_2);
  vf s, c;
  angle(u2, &s, &c);
  const vf rho = sqrt(u1);
  s *= rho;
  c *= rho;
  const vf dx = pixel[3] + pixel[5] * c + pixel[6] * s - pixel[0];
  const vf dy = pixel[4] + pixel[7] * c + pixel[8] * s - pixel[1];
  const float dz = aim_z - pixel[2];
  const vf scale = rsqrt(dx * dx + dy * dy + dz * dz);
  r->x = pixel[0];
  r->y = pixel[1];
  r->z = pixel[2];
  r->L = dx * scale;
  r->M = dy * scale;
  r->N = dz * scale;
  r->state = 0;
#if ILLUMINANCE
  // solid angle of an area on the aim plane times the cosine at the retina, per mm^2
  *weight = (pixel[9] * r->L + pixel[10] * r->M + pixel[11] * r->N) * r->N * scale * scale;
#endif
}

#define OUTPUTS 4  // red, green, blue, mean weight
#define STATES 4   // vignetted, tir, missed_surface, missed_scene

kernel void trace_pixels(SYSTEM, int operation_count, global const float* restrict pixels, float aim_z, int first_pixel,
                         int pixel_count, int samples, uint seed, constant float* restrict planes, int plane_count,
                         global const uint* restrict texels, constant float* restrict background,
                         constant float* restrict colour, global float* restrict image,
                         global int* restrict states) {
  const int item = get_global_id(0);
  if (item >= pixel_count) return;
  const int index = first_pixel + item;
  global const float* pixel = pixels + index * PIXEL;
  const uint shift_1 = scramble((uint)index ^ seed), shift_2 = scramble(shift_1);
  float out[3] = {0.f, 0.f, 0.f}, weight_sum = 0.f;
  int counts[STATES] = {0, 0, 0, 0};

  for (int wave = 0; wave < WAVES; wave++) {
    vf sum[CHANNELS], weights = 0.f;
    UNROLL for (int c = 0; c < CHANNELS; c++) sum[c] = 0.f;
    for (int s = 0; s < samples; s += VLN * WAVES * UN) {
      ray r[UN];
      vf weight[UN];
      UNROLL for (int q = 0; q < UN; q++) {
        weight[q] = 1.f;
        const vu n = LANES + (vu)(uint)(s + (q * WAVES + wave) * VLN);
        start(&r[q], n, shift_1, shift_2, pixel, aim_z, &weight[q]);
      }
      for (int k = 0; k < operation_count; k++) pass(r, k, wave, SYSTEM_ARGUMENTS);
      UNROLL for (int q = 0; q < UN; q++) {
        view seen;
        look(&r[q], planes, plane_count, texels, background, &seen);
        if (ANY(r[q].state != 0)) {
          counts[0] += COUNT(r[q].state == VIGNETTED);
          counts[1] += COUNT(r[q].state == TIR);
          counts[2] += COUNT(r[q].state == MISSED_SURFACE);
          weight[q] = select(weight[q], (vf)0.f, r[q].state != 0);
          seen.missed &= (r[q].state == 0);
        }
        if (ANY(seen.missed)) counts[3] += COUNT(seen.missed);
        weights += weight[q];
        UNROLL for (int c = 0; c < CHANNELS; c++) sum[c] += weight[q] * seen.value[c];
      }
    }
    // A wavelength's mean, then its colour: a white scene stays white however the pupil cuts single wavelengths.
    const float total = SUM(weights);
    weight_sum += total;
    if (total > 0.f) {
#if SPECTRAL
      const vi some = weights > 0.f;
      const vf scale = RECIP(select((vf)1.f, weights, some));
      vf mean[3];
      UNROLL for (int c = 0; c < 3; c++) {
        const int channel = CHANNELS == 1 ? 0 : c;
        mean[c] = select((vf)(SUM(sum[channel]) / total), sum[channel] * scale, some);
      }
      // colour: 9 rows (to red, green, blue from red, green, blue) of 16 wavelengths
      UNROLL for (int c = 0; c < 3; c++) {
        vf light = 0.f;
        UNROLL for (int d = 0; d < 3; d++) light += (VLN == 1 ? (vf)colour[(3 * c + d) * WAVELENGTHS + wave] : VLOAD(3 * c + d, colour)) * mean[d];
        out[c] += SUM(light);
      }
#else
      UNROLL for (int c = 0; c < 3; c++) out[c] = SUM(sum[CHANNELS == 1 ? 0 : c]) / total;
#endif
    }
  }
  UNROLL for (int c = 0; c < 3; c++) image[index * OUTPUTS + c] = out[c];
  image[index * OUTPUTS + 3] = weight_sum / samples;
  UNROLL for (int c = 0; c < STATES; c++) states[index * STATES + c] = counts[c];
}

// Single rays through the system, for tests of accuracy: 6 floats in (position, direction), 7 out (and the state), in planes of
// `count` values; count is a multiple of 16.
kernel void trace_rays(SYSTEM, int operation_count, int count, int wave, global const float* restrict in,
                       global float* restrict out) {
  const int g = get_global_id(0);
  if (g * VLN >= count) return;
  ray r[UN];
  UNROLL for (int q = 0; q < UN; q++) {
    r[q].x = VLOAD(g, in);
    r[q].y = VLOAD(g, in + count);
    r[q].z = VLOAD(g, in + 2 * count);
    r[q].L = VLOAD(g, in + 3 * count);
    r[q].M = VLOAD(g, in + 4 * count);
    r[q].N = VLOAD(g, in + 5 * count);
    r[q].state = 0;
  }
  for (int k = 0; k < operation_count; k++) pass(r, k, wave, SYSTEM_ARGUMENTS);
  VSTORE(r[0].x, g, out);
  VSTORE(r[0].y, g, out + count);
  VSTORE(r[0].z, g, out + 2 * count);
  VSTORE(r[0].L, g, out + 3 * count);
  VSTORE(r[0].M, g, out + 4 * count);
  VSTORE(r[0].N, g, out + 5 * count);
  VSTORE(TO_VF(r[0].state), g, out + 6 * count);
}
