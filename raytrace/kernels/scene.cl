// Textured planes. A plane is 20 floats: normal n (3), h; a (3), a0; b (3), b0; s; last texel in x and y, row
// length and first texel (int bits). It is met at t = (h - s n.p) / (n.d); texel coordinates are u = a.(s p +
// t d) + a0, v likewise, counted from the first texel's centre. s is 0 for a plane at infinity, else 1.
#define PLANE 20

AI void plane_coordinates(const ray* r, constant float* restrict p, vf t, vf* u, vf* v) {
  const vf x = p[12] * r->x + t * r->L, y = p[12] * r->y + t * r->M, z = p[12] * r->z + t * r->N;
  *u = p[4] * x + p[5] * y + p[6] * z + p[7];
  *v = p[8] * x + p[9] * y + p[10] * z + p[11];
}

// How far a hit on plane p counts: what is at infinity lies behind everything else, in the order of the scene.
#define DEPTH(p, t) ((p)[12] == 0.f ? (vf)(1e30f) : (t))

// What the kernels take of a scene.
#define SCENE                                                                           \
  constant float *restrict planes, int plane_count, global const uint *restrict texels, \
      constant float *restrict background MESHES
#define SCENE_ARGUMENTS planes, plane_count, texels, background MESH_ARGUMENTS

#if TANGENTS
// Where texture coordinates u and v move by one unit of each of TANGENTS parameters: polynomials of the place
// in the pupil, for every pixel, plane and parameter; with SPECTRAL a second one each, what is added per unit
// of a wavelength's own number. Made and checked in image_change.cpp.
#define CHANGE_TERMS ((CHANGE_DEGREE + 1) * (CHANGE_DEGREE + 2) / 2)
typedef struct {
  vf x, y, wave;
  global const float* polynomials;
} pupil_place;
AI vf change_polynomial(const pupil_place* at, int set) {
#define CHANGE_TERM(i) \
  (TILE ? VLOAD(set * CHANGE_TERMS + (i), at->polynomials) : (vf)at->polynomials[set * CHANGE_TERMS + (i)])
  vf value = 0.f;
  int first = CHANGE_TERMS;
  UNROLL
  for (int j = CHANGE_DEGREE; j >= 0; j--) {
    first -= CHANGE_DEGREE - j + 1;
    vf row = CHANGE_TERM(first + CHANGE_DEGREE - j);
    UNROLL
    for (int i = CHANGE_DEGREE - j - 1; i >= 0; i--) row = row * at->x + CHANGE_TERM(first + i);
    value = value * at->y + row;
  }
  return value;
}
AI vf change_of(const pupil_place* at, int coordinate) {
#if SPECTRAL
  return change_polynomial(at, 2 * coordinate) + at->wave * change_polynomial(at, 2 * coordinate + 1);
#else
  return change_polynomial(at, coordinate);
#endif
}
#define AT_PLACE , const pupil_place* at
#else
#define AT_PLACE
#endif

// What the ray sees; with TANGENTS the derivatives of that.
AI void look(const ray* r, SCENE AT_PLACE, view* seen) {
  vf nearest = INFINITY;
  UNROLL
  for (int c = 0; c < CHANNELS; c++) seen->value[c] = background[c];
#if TANGENTS
  UNROLL
  for (int i = 0; i < TANGENTS * CHANNELS; i++) seen->change[i] = 0.f;
#endif
  seen->missed = (vi)(VLN == 1 ? 1 : -1);
  for (int j = 0; j < plane_count; j++) {
    constant float* p = planes + j * PLANE;
    const vf across = RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
    const vf t = (p[3] - p[12] * (p[0] * r->x + p[1] * r->y + p[2] * r->z)) * across, depth = DEPTH(p, t);
    vf u, v;
    plane_coordinates(r, p, t, &u, &v);
    const vi hit = (t > 0.f) & (depth < nearest) & (u >= -0.5f) & (v >= -0.5f) & (u <= p[13] + 0.5f) &
                   (v <= p[14] + 0.5f);
    const vf cu = CLAMPED(u, 0.f, p[13] - 1e-3f), cv = CLAMPED(v, 0.f, p[14] - 1e-3f);
    const vi iu = TO_VI(cu), iv = TO_VI(cv);
    const int row = as_int(p[15]);
    const vi id = iv * row + iu;
    const look_up picture =
        texel(texels + as_int(p[16]) * TEXEL_WORDS, id, id + row, cu - TO_VF(iu), cv - TO_VF(iv));
    UNROLL
    for (int c = 0; c < CHANNELS; c++) seen->value[c] = select(seen->value[c], picture.value[c], hit);
#if TANGENTS
    UNROLL
    for (int i = 0; i < TANGENTS; i++) {
      const vf du = change_of(at, 2 * (j * TANGENTS + i)), dv = change_of(at, 2 * (j * TANGENTS + i) + 1);
      UNROLL
      for (int c = 0; c < CHANNELS; c++)
        seen->change[i * CHANNELS + c] =
            select(seen->change[i * CHANNELS + c], picture.by_u[c] * du + picture.by_v[c] * dv, hit);
    }
#endif
    nearest = select(nearest, depth, hit);
    seen->missed = seen->missed & (VLN == 1 ? !hit : ~hit);
  }
#if HAS_MESHES
  look_at_meshes(r, nearest, seen, texels MESH_ARGUMENTS);
#endif
}
