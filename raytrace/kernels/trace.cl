// Operations of the optical system, in the order that a ray from the retina meets them: 16 floats each, a
// kind, and the ratio of indices (before over after) for every one of 16 wavelengths.
#define WAVELENGTHS 16
#define SYSTEM                                                                                        \
  constant int* restrict kinds, constant float* restrict operations, constant float* restrict ratios, \
      constant float* restrict gradients, global const float* restrict records
#define SYSTEM_ARGUMENTS kinds, operations, ratios, gradients, records

// Lanes are the wavelengths where a work-item carries 16 rays of a pixel; else wavelengths come one after the
// other.
#define RATIO(k, wave) (WAVE_LANES ? VLOAD(k, ratios) : (vf)ratios[WAVELENGTHS * (k) + (wave)])

#if HAS_GRADIENT
#define ETA (own_ratio ? r[q].eta : eta)
#else
#define ETA eta
#endif

// Kinds and flags of an eye of formulas are known when the kernel is compiled, a hexadecimal digit each from
// the lowest on: its loop is unrolled, and neither tests of kinds nor copies for bodies remain where there is
// nothing to choose.
#ifdef OPERATIONS
#define KIND(k) ((int)(KINDS >> 4 * (k)) & 15)
#define FLAGS_OF(k) ((int)(FLAGS >> 4 * (k)) & 15)
#define FORM_OF(k) ((int)(FORMS >> 4 * (k)) & 15)
#define EACH_OPERATION(k) \
  UNROLL                  \
  for (int k = 0; k < OPERATIONS; k++)
#else
#define KIND(k) kinds[k]
#define FLAGS_OF(k) (kinds[k] == ROTATE ? 0 : as_int(operations[PARAMETERS * (k) + O_FLAGS]))
#define FORM_OF(k) 0
#define EACH_OPERATION(k) for (int k = first_operation; k < operation_count; k++)
#endif

#if HAS_BODY
// A ray that misses the body's back, or meets it beyond the body's edge, goes on as it was and past the whole
// body.
AI void pass_beside(ray* r, const ray* before, int flags) {
  if (flags & ENTERS_BODY) r->beside = (before->state == 0) & (r->state == MISSED_SURFACE);
  const vi b = VLN == 1 ? (r->beside ? -1 : 0) : r->beside;
  if (!ANY(b)) return;
  r->x = select(r->x, before->x, b);
  r->y = select(r->y, before->y, b);
  r->z = select(r->z, before->z, b);
  r->L = select(r->L, before->L, b);
  r->M = select(r->M, before->M, b);
  r->N = select(r->N, before->N, b);
  r->state = select(r->state, before->state, b);
}
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
  if (flags & (ENTERS_BODY | INSIDE_BODY)) {
    EACH_RAY (q) before[q] = r[q];
  }
#endif
  switch (kind) {
#if HAS_SPHERE
    case SPHERE:
      EACH_RAY (q) sphere(r + q, p, form, ETA);
      break;
#endif
#if HAS_QUADRIC
    case QUADRIC:
      EACH_RAY (q) quadric(r + q, p, form, ETA);
      break;
#endif
#if HAS_BICONIC
    case BICONIC:
      EACH_RAY (q) biconic(r + q, p, form, ETA);
      break;
#endif
#if HAS_PATCH
    case PATCH:
      EACH_RAY (q) patch(r + q, p, records, ETA);
      break;
#endif
#if HAS_STOP
    case STOP:
      EACH_RAY (q) stop(r + q, p, form);
      break;
#endif
#if HAS_ROTATE
    case ROTATE:
      EACH_RAY (q) rotate_ray(r + q, p);
      break;
#endif
#if HAS_TRIANGLES
    case TRIANGLES:
      EACH_RAY (q) triangles(r + q, p, records, ETA);
      break;
#endif
#if HAS_EVERY_TRIANGLE
    case EVERY_TRIANGLE:
      every_triangle(r, p, records, eta);
      break;
#endif
#if HAS_GRADIENT
    case GRADIENT:
      EACH_RAY (q) gradient(r + q, p, gradients, eta, wave);
      break;
#endif
  }
#if HAS_BODY
  if (flags & (ENTERS_BODY | INSIDE_BODY)) {
    EACH_RAY (q) pass_beside(r + q, before + q, flags);
  }
#endif
}

// A pixel: retina point (3), aim's centre (2), matrix that takes the unit disc to the aim ellipse (4),
// surface normal (3).
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

// Place of sample n in the unit disc that stands for the pupil: R2 lattice (Roberts 2018) with a shift of the
// pixel's own.
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

// What a picture asks for beyond geometrical rays through an optical system: arguments of the kernel.
#if RANDOM_CAP
#define CAP , constant float* restrict cap
#else
#define CAP
#endif
#if STILES_CRAWFORD
#define FALLOFF , float pupil_falloff
#else
#define FALLOFF
#endif
#if DIFFRACTION
#define AIRY , constant float* restrict airy
#else
#define AIRY
#endif
#if FAST
#define MAP                                                                                         \
  , int first_operation, int width, int height, float map_z, global const float *restrict map_rows, \
      global const float *restrict map_weights
#else
#define MAP
#endif
#if TANGENTS
#define CHANGES                                                                                         \
  , global const float *restrict changes, int changes_a_pixel, constant float *restrict change_by_wave, \
      global float *restrict derivatives
#else
#define CHANGES
#endif

// Where the rays of a pixel start and what they are aimed at.
typedef struct {
  per_pixel pixel[PIXEL];
  uint shift_1, shift_2;  // of the lattice of samples, the pixel's own
  float aim_z;
} aim;

AI aim aim_of(int index, uint seed, float aim_z, global const float* restrict pixels) {
  aim from;
#if TILE
  UNROLL
  for (int i = 0; i < PIXEL; i++) from.pixel[i] = VLOAD(index * PIXEL + i, pixels);
#else
  UNROLL
  for (int i = 0; i < PIXEL; i++) from.pixel[i] = pixels[index * PIXEL + i];
#endif
  from.shift_1 = scramble((uint)index ^ seed);
  from.shift_2 = scramble(from.shift_1);
  from.aim_z = aim_z;
  return from;
}

// The first of UN samples that follow one another, for every lane. A wavelength takes a run of the lattice:
// every run is as even as the whole.
AI vu first_sample_of(uint first_sample, int wave, int run, int s) {
#if TILE
  return (vu)(first_sample + (uint)(wave * run + s));
#else
  return (LANES + (vu)(uint)(wave * VLN)) * (vu)(uint)run + (vu)(first_sample + (uint)s);
#endif
}

#define OUTPUTS 4  // red, green, blue, mean weight
#define STATES 4   // vignetted, tir, missed_surface, missed_scene

// Sums over the rays of a wavelength, weighted.
typedef struct {
  vf light[CHANNELS], weights;
#if TANGENTS
  vf change[TANGENTS * CHANNELS];
#endif
} wave_sums;

AI wave_sums no_light(void) {
  wave_sums sums;
  sums.weights = 0.f;
  UNROLL
  for (int c = 0; c < CHANNELS; c++) sums.light[c] = 0.f;
#if TANGENTS
  UNROLL
  for (int i = 0; i < TANGENTS * CHANNELS; i++) sums.change[i] = 0.f;
#endif
  return sums;
}

// Adds what a ray has seen, or counts how it was lost.
AI void gather_light(const ray* r, view* seen, vf weight, wave_sums* sums, vi* counts) {
  // A ray in a hundred ends at the stop's rim, so that most batches have one: no branch could be foretold.
  const vi lost = r->state != 0;
  counts[0] += ONE_WHERE(r->state == VIGNETTED);
  weight = select(weight, (vf)0.f, lost);
  seen->missed &= r->state == 0;
  if (ANY(r->state > VIGNETTED)) {
    counts[1] += ONE_WHERE(r->state == TIR);
    counts[2] += ONE_WHERE(r->state == MISSED_SURFACE);
  }
  if (ANY(seen->missed)) counts[3] += ONE_WHERE(seen->missed);
  sums->weights += weight;
  UNROLL
  for (int c = 0; c < CHANNELS; c++) sums->light[c] += weight * seen->value[c];
#if TANGENTS
  UNROLL
  for (int i = 0; i < TANGENTS * CHANNELS; i++)
    sums->change[i] += select((vf)0.f, weight * seen->change[i], weight > 0.f);
#endif
}

// What a pixel has of all wavelengths.
typedef struct {
  per_pixel light[3], weight;
#if TANGENTS
  per_pixel change[3 * TANGENTS];
#endif
} pixel_sums;

AI pixel_sums black(void) {
  pixel_sums out = {{0.f, 0.f, 0.f}, 0.f};
#if TANGENTS
  UNROLL
  for (int i = 0; i < 3 * TANGENTS; i++) out.change[i] = 0.f;
#endif
  return out;
}

// Adds what a pixel's rays of one wavelength (of 16 with lanes) have gathered. A wavelength's mean first,
// then its colour: a white scene stays white however the pupil cuts single wavelengths. total > 0
AI void add_light(const vf* sum, vf weights, per_pixel total, constant float* restrict colour, int wave,
                  per_pixel* out) {
#if SPECTRAL
  const vi some = weights > 0.f;
  const vf scale = RECIP(select((vf)1.f, weights, some));
  vf mean[3];
  UNROLL
  for (int c = 0; c < 3; c++) {
    const int channel = CHANNELS == 1 ? 0 : c;
    mean[c] = select((vf)(TOGETHER(sum[channel]) / total), sum[channel] * scale, some);
  }
  // colour: 9 rows (to red, green, blue from red, green, blue) of 16 wavelengths
  UNROLL
  for (int to = 0; to < 3; to++) {
    vf light = 0.f;
    UNROLL
    for (int from = 0; from < 3; from++) {
      const int row = 3 * to + from;
      light += (WAVE_LANES ? VLOAD(row, colour) : (vf)colour[row * WAVELENGTHS + wave]) * mean[from];
    }
    out[to] += TOGETHER(light);
  }
#else
  UNROLL
  for (int c = 0; c < 3; c++) out[c] = TOGETHER(sum[CHANNELS == 1 ? 0 : c]) / total;
#endif
}

AI void add_wave(const wave_sums* sums, constant float* restrict colour, int wave, pixel_sums* out) {
  per_pixel total = TOGETHER(sums->weights);
  out->weight += total;
#if TILE
  total = select((vf)1.f, total, total > 0.f);  // a pixel without light is black
#else
  if (total > 0.f)
#endif
  {
    add_light(sums->light, sums->weights, total, colour, wave, out->light);
#if TANGENTS
    UNROLL
    for (int j = 0; j < TANGENTS; j++)
      add_light(sums->change + j * CHANNELS, sums->weights, total, colour, wave, out->change + 3 * j);
#endif
  }
}

kernel void trace_pixels(SYSTEM, int operation_count, global const float* restrict pixels, float aim_z,
                         int first_pixel, int pixel_count, int samples, uint first_sample, uint seed, SCENE,
                         constant float* restrict colour, global float* restrict image,
                         global int* restrict states CAP FALLOFF AIRY MAP CHANGES) {
  const int item = get_global_id(0);
  if (item >= pixel_count) return;
  const int index = first_pixel + item;
  const aim from = aim_of(index, seed, aim_z, pixels);
  pixel_sums out = black();
  vi counts[STATES] = {0, 0, 0, 0};

  for (int wave = 0; wave < WAVES; wave++) {
    wave_sums sums = no_light();
#if FAST
    coefficient map[MAP_FLOATS];
    map_of_pixel(map, index / width, index % width, width, height, wave, map_rows, map_weights);
#else
    const int first_operation = 0;
#endif
    const int run = samples / ((TILE ? 1 : VLN) * WAVES);  // samples of a wavelength, or of a lane
    for (int s = 0; s < run; s += UN) {
      ray r[UN];
      vf weight[UN], at_x[UN], at_y[UN];
      const vu first_n = first_sample_of(first_sample, wave, run, s);
      EACH_RAY (q) {
        weight[q] = 1.f;
        const vu n = first_n + (vu)(uint)q;
#if RANDOM_CAP
        start_at_cap(r + q, n, from.shift_1, from.shift_2, from.pixel, cap, operations, records);
#else
        place_of(n, from.shift_1, from.shift_2, at_x + q, at_y + q);
#if !FAST || ILLUMINANCE
        start(r + q, at_x[q], at_y[q], from.pixel, from.aim_z, weight + q);
#endif
#if FAST
        start_by_map(r + q, at_x[q], at_y[q], map, map_z);
#endif
#endif
#if STILES_CRAWFORD
        weight[q] *= receptor_weight(n, from.shift_1, pupil_falloff);
#endif
      }
      EACH_OPERATION (k) pass(r, k, wave, SYSTEM_ARGUMENTS);
      EACH_RAY (q) {
#if DIFFRACTION
        diffract(r + q, first_n + (vu)(uint)q, scramble(from.shift_2), wave, airy);
#endif
        view seen;
#if TANGENTS
        const pupil_place at = {at_x[q], at_y[q],
                                WAVE_LANES ? VLOAD(0, change_by_wave) : (vf)change_by_wave[wave],
                                changes + index * changes_a_pixel * (TILE ? VLN : 1)};
        look(r + q, SCENE_ARGUMENTS, &at, &seen);
#else
        look(r + q, SCENE_ARGUMENTS, &seen);
#endif
        gather_light(r + q, &seen, weight[q], &sums, counts);
      }
    }
    add_wave(&sums, colour, wave, &out);
  }
  UNROLL
  for (int c = 0; c < 3; c++) STORE_PIXEL(out.light[c], index * OUTPUTS + c, image);
  STORE_PIXEL(out.weight / samples, index * OUTPUTS + 3, image);
#if TANGENTS
  UNROLL
  for (int i = 0; i < 3 * TANGENTS; i++) STORE_PIXEL(out.change[i], index * 3 * TANGENTS + i, derivatives);
#endif
  UNROLL
  for (int c = 0; c < STATES; c++) STORE_PIXEL(COUNT_TOGETHER(counts[c]), index * STATES + c, states);
}

// Single rays through the system, for tests of accuracy: 6 floats in (position, direction), 7 out (and the
// state), in planes of `count` values; count is a multiple of 16.
kernel void trace_rays(SYSTEM, int operation_count, int count, int wave, global const float* restrict in,
                       global float* restrict out) {
  const int g = get_global_id(0);
  if (g * VLN >= count) return;
  ray r[UN];
  EACH_RAY (q) {
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
