// Operations of the optical system, in the order that a ray from the retina meets them: 16 floats each, a kind, and the ratio of
// indices (before over after) for every one of 16 wavelengths.
#define WAVELENGTHS 16
#define SYSTEM                                                                                              \
  constant int* restrict kinds, constant float* restrict operations, constant float* restrict ratios,       \
      constant float* restrict gradients, global const float* restrict records
#define SYSTEM_ARGUMENTS kinds, operations, ratios, gradients, records

// Lanes are the wavelengths where a work-item carries 16 rays of a pixel; else wavelengths come one after the other.
#define RATIO(k, wave) (WAVE_LANES ? VLOAD(k, ratios) : (vf)ratios[(k) * WAVELENGTHS + (wave)])

#if HAS_GRADIENT
#define ETA (own_ratio ? r[q].eta : eta)
#else
#define ETA eta
#endif

// Kinds and flags of an eye of formulas are known when the kernel is compiled, a hexadecimal digit each from the lowest on: its
// loop is unrolled, and neither tests of kinds nor copies for bodies remain where there is nothing to choose.
#ifdef OPERATIONS
#define KIND(k) ((int)(KINDS >> 4 * (k)) & 15)
#define FLAGS_OF(k) ((int)(FLAGS >> 4 * (k)) & 15)
#define FORM_OF(k) ((int)(FORMS >> 4 * (k)) & 15)
#define EACH_OPERATION(k) UNROLL for (int k = 0; k < OPERATIONS; k++)
#else
#define KIND(k) kinds[k]
#define FLAGS_OF(k) (kinds[k] == ROTATE ? 0 : as_int(operations[(k) * PARAMETERS + O_FLAGS]))
#define FORM_OF(k) 0
#define EACH_OPERATION(k) for (int k = first_operation; k < operation_count; k++)
#endif

// Takes UN rays past operation k.
AI void pass(ray* r, int k, int wave, SYSTEM) {
  const int kind = KIND(k), form = FORM_OF(k);
  constant float* p = operations + k * PARAMETERS;
  const vf eta = RATIO(k, wave);
#if HAS_GRADIENT || HAS_BODY
  const int flags = FLAGS_OF(k);
#endif
#if HAS_GRADIENT
  const int own_ratio = flags & LOCAL_RATIO;
#endif
#if HAS_BODY
  ray before[UN];
  if (flags & (ENTERS_BODY | INSIDE_BODY)) UNROLL for (int q = 0; q < UN; q++) before[q] = r[q];
#endif
  switch (kind) {
#if HAS_SPHERE
    case SPHERE: UNROLL for (int q = 0; q < UN; q++) sphere(r + q, p, form, ETA); break;
#endif
#if HAS_QUADRIC
    case QUADRIC: UNROLL for (int q = 0; q < UN; q++) quadric(r + q, p, form, ETA); break;
#endif
#if HAS_BICONIC
    case BICONIC: UNROLL for (int q = 0; q < UN; q++) biconic(r + q, p, form, ETA); break;
#endif
#if HAS_PATCH
    case PATCH: UNROLL for (int q = 0; q < UN; q++) patch(r + q, p, records, ETA); break;
#endif
#if HAS_STOP
    case STOP: UNROLL for (int q = 0; q < UN; q++) stop(r + q, p, form); break;
#endif
#if HAS_ROTATE
    case ROTATE: UNROLL for (int q = 0; q < UN; q++) rotate_ray(r + q, p); break;
#endif
#if HAS_TRIANGLES
    case TRIANGLES: UNROLL for (int q = 0; q < UN; q++) triangles(r + q, p, records, ETA); break;
#endif
#if HAS_EVERY_TRIANGLE
    case EVERY_TRIANGLE: every_triangle(r, p, records, eta); break;
#endif
#if HAS_GRADIENT
    case GRADIENT: UNROLL for (int q = 0; q < UN; q++) gradient(r + q, p, gradients, eta, wave); break;
#endif
  }
#if HAS_BODY
  // A ray that misses the body's back, or meets it beyond the body's edge, goes on as it was and past the whole body.
  if (flags & (ENTERS_BODY | INSIDE_BODY)) UNROLL for (int q = 0; q < UN; q++) {
    if (flags & ENTERS_BODY) r[q].beside = (before[q].state == 0) & (r[q].state == MISSED_SURFACE);
    const vi b = VLN == 1 ? (r[q].beside ? -1 : 0) : r[q].beside;
    if (!ANY(b)) continue;
    r[q].x = select(r[q].x, before[q].x, b);
    r[q].y = select(r[q].y, before[q].y, b);
    r[q].z = select(r[q].z, before[q].z, b);
    r[q].L = select(r[q].L, before[q].L, b);
    r[q].M = select(r[q].M, before[q].M, b);
    r[q].N = select(r[q].N, before[q].N, b);
    r[q].state = select(r[q].state, before[q].state, b);
  }
#endif
}

// A pixel: retina point (3), aim's centre (2), matrix that takes the unit disc to the aim ellipse (4), surface normal (3).
#define PIXEL 12
// What belongs to a pixel: a number, or with TILE one for each lane.
#if TILE
typedef vf per_pixel;
#define TOGETHER(v) (v)
#define COUNT_TOGETHER(v) (v)
#define STORE_PIXEL VSTORE
#else
typedef float per_pixel;
#define TOGETHER SUM
#define COUNT_TOGETHER COUNT
#define STORE_PIXEL(v, i, p) (p)[i] = (v)
#endif

// Place of sample n in the unit disc that stands for the pupil: R2 lattice (Roberts 2018) with a shift of the pixel's own.
AI void place_of(vu n, uint shift_1, uint shift_2, vf* x, vf* y) {
  vf s, c;
  angle(unit_interval(n * 2447445414u + shift_2), &s, &c);
  const vf rho = sqrt(unit_interval(n * 3242174889u + shift_1));
  *x = rho * c;
  *y = rho * s;
}

// The ray from the retina to a place of the disc.
AI void start(ray* r, vf at_x, vf at_y, const per_pixel* pixel, float aim_z, vf* weight) {
  const vf dx = pixel[3] + pixel[5] * at_x + pixel[6] * at_y - pixel[0];
  const vf dy = pixel[4] + pixel[7] * at_x + pixel[8] * at_y - pixel[1];
  const per_pixel dz = aim_z - pixel[2];
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

// Adds what a pixel's rays of one wavelength (of 16 with lanes) have gathered. A wavelength's mean first, then its colour: a
// white scene stays white however the pupil cuts single wavelengths. total > 0
AI void add_light(const vf* sum, vf weights, per_pixel total, constant float* restrict colour, int wave, per_pixel* out) {
#if SPECTRAL
  const vi some = weights > 0.f;
  const vf scale = RECIP(select((vf)1.f, weights, some));
  vf mean[3];
  UNROLL for (int c = 0; c < 3; c++) {
    const int channel = CHANNELS == 1 ? 0 : c;
    mean[c] = select((vf)(TOGETHER(sum[channel]) / total), sum[channel] * scale, some);
  }
  // colour: 9 rows (to red, green, blue from red, green, blue) of 16 wavelengths
  UNROLL for (int to = 0; to < 3; to++) {
    vf light = 0.f;
    UNROLL for (int from = 0; from < 3; from++) {
      const int row = 3 * to + from;
      light += (WAVE_LANES ? VLOAD(row, colour) : (vf)colour[row * WAVELENGTHS + wave]) * mean[from];
    }
    out[to] += TOGETHER(light);
  }
#else
  UNROLL for (int c = 0; c < 3; c++) out[c] = TOGETHER(sum[CHANNELS == 1 ? 0 : c]) / total;
#endif
}

kernel void trace_pixels(SYSTEM, int operation_count, global const float* restrict pixels, float aim_z, int first_pixel,
                         int pixel_count, int samples, uint first_sample, uint seed, SCENE, constant float* restrict colour, global float* restrict image,
                         global int* restrict states
#if RANDOM_CAP
                         , constant float* restrict cap
#endif
#if STILES_CRAWFORD
                         , float pupil_falloff
#endif
#if DIFFRACTION
                         , constant float* restrict airy
#endif
#if FAST
                         , int first_operation, int width, int height, float map_z, global const float* restrict map_rows,
                         global const float* restrict map_weights
#endif
#if TANGENTS
                         , global const float* restrict changes, int changes_a_pixel, constant float* restrict change_by_wave,
                         global float* restrict derivatives
#endif
                         ) {
  const int item = get_global_id(0);
  if (item >= pixel_count) return;
  const int index = first_pixel + item;
  per_pixel pixel[PIXEL];
#if TILE
  UNROLL for (int i = 0; i < PIXEL; i++) pixel[i] = VLOAD(index * PIXEL + i, pixels);
#else
  UNROLL for (int i = 0; i < PIXEL; i++) pixel[i] = pixels[index * PIXEL + i];
#endif
  const uint shift_1 = scramble((uint)index ^ seed), shift_2 = scramble(shift_1);
  per_pixel out[3] = {0.f, 0.f, 0.f}, weight_sum = 0.f;
#if TANGENTS
  per_pixel out_change[3 * TANGENTS];
  UNROLL for (int i = 0; i < 3 * TANGENTS; i++) out_change[i] = 0.f;
#endif
  vi counts[STATES] = {0, 0, 0, 0};

  for (int wave = 0; wave < WAVES; wave++) {
    vf sum[CHANNELS], weights = 0.f;
    UNROLL for (int c = 0; c < CHANNELS; c++) sum[c] = 0.f;
#if TANGENTS
    vf change_sum[TANGENTS * CHANNELS];
    UNROLL for (int i = 0; i < TANGENTS * CHANNELS; i++) change_sum[i] = 0.f;
#endif
#if FAST
    coefficient map[MAP_FLOATS];
    map_of_pixel(map, index / width, index % width, width, height, wave, map_rows, map_weights);
#else
    const int first_operation = 0;
#endif
    const int run = samples / ((TILE ? 1 : VLN) * WAVES);  // samples of a wavelength, or of a lane
    for (int s = 0; s < run; s += UN) {
      ray r[UN];
      vf weight[UN];
      // A wavelength takes a run of the lattice: every run is as even as the whole.
#if TILE
      const vu first_n = (vu)(first_sample + (uint)(wave * run + s));
#else
      const vu first_n = (LANES + (vu)(uint)(wave * VLN)) * (vu)(uint)run + (vu)(first_sample + (uint)s);
#endif
      vf at_x[UN], at_y[UN];
      UNROLL for (int q = 0; q < UN; q++) {
        weight[q] = 1.f;
        const vu n = first_n + (vu)(uint)q;
#if RANDOM_CAP
        start_at_cap(&r[q], n, shift_1, shift_2, pixel, cap, operations, records);
#else
        place_of(n, shift_1, shift_2, at_x + q, at_y + q);
#if !FAST || ILLUMINANCE
        start(&r[q], at_x[q], at_y[q], pixel, aim_z, &weight[q]);
#endif
#if FAST
        start_by_map(&r[q], at_x[q], at_y[q], map, map_z);
#endif
#endif
#if STILES_CRAWFORD
        weight[q] *= receptor_weight(n, shift_1, pupil_falloff);
#endif
      }
      EACH_OPERATION(k) pass(r, k, wave, SYSTEM_ARGUMENTS);
      UNROLL for (int q = 0; q < UN; q++) {
#if DIFFRACTION
        diffract(&r[q], first_n + (vu)(uint)q, scramble(shift_2), wave, airy);
#endif
        view seen;
#if TANGENTS
        const pupil_place at = {at_x[q], at_y[q], WAVE_LANES ? VLOAD(0, change_by_wave) : (vf)change_by_wave[wave],
                                changes + index * changes_a_pixel * (TILE ? VLN : 1)};
        look(&r[q], SCENE_ARGUMENTS, &at, &seen);
#else
        look(&r[q], SCENE_ARGUMENTS, &seen);
#endif
        // A ray in a hundred ends at the stop's rim, so that most batches have one: no branch could be foretold.
        const vi lost = r[q].state != 0;
        counts[0] += ONE_WHERE(r[q].state == VIGNETTED);
        weight[q] = select(weight[q], (vf)0.f, lost);
        seen.missed &= r[q].state == 0;
        if (ANY(r[q].state > VIGNETTED)) {
          counts[1] += ONE_WHERE(r[q].state == TIR);
          counts[2] += ONE_WHERE(r[q].state == MISSED_SURFACE);
        }
        if (ANY(seen.missed)) counts[3] += ONE_WHERE(seen.missed);
        weights += weight[q];
        UNROLL for (int c = 0; c < CHANNELS; c++) sum[c] += weight[q] * seen.value[c];
#if TANGENTS
        UNROLL for (int i = 0; i < TANGENTS * CHANNELS; i++)
          change_sum[i] += select((vf)0.f, weight[q] * seen.change[i], weight[q] > 0.f);
#endif
      }
    }
    per_pixel total = TOGETHER(weights);
    weight_sum += total;
#if TILE
    total = select((vf)1.f, total, total > 0.f);  // a pixel without light is black
#else
    if (total > 0.f)
#endif
    {
      add_light(sum, weights, total, colour, wave, out);
#if TANGENTS
      UNROLL for (int j = 0; j < TANGENTS; j++)
        add_light(change_sum + j * CHANNELS, weights, total, colour, wave, out_change + 3 * j);
#endif
    }
  }
  UNROLL for (int c = 0; c < 3; c++) STORE_PIXEL(out[c], index * OUTPUTS + c, image);
  STORE_PIXEL(weight_sum / samples, index * OUTPUTS + 3, image);
#if TANGENTS
  UNROLL for (int i = 0; i < 3 * TANGENTS; i++) STORE_PIXEL(out_change[i], index * 3 * TANGENTS + i, derivatives);
#endif
  UNROLL for (int c = 0; c < STATES; c++) STORE_PIXEL(COUNT_TOGETHER(counts[c]), index * STATES + c, states);
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
