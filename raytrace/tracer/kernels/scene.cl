// Textured planes. A plane is 20 floats: normal n (3), h; a (3), a0; b (3), b0; s; last texel in x and y, row length and first
// texel (int bits). It is met at t = (h - s n.p) / (n.d); texel coordinates are u = a.(s p + t d) + a0, v likewise, counted
// from the first texel's centre. s is 0 for a plane at infinity, else 1.
#define PLANE 20

// CHANNELS 1: a texel holds its own grey and its right neighbour's, 16 bits each, so that a bilinear look-up is two reads.
// CHANNELS 3: a texel holds linear red, green and blue in 11, 11 and 10 bits.
#if CHANNELS == 1
AI void texel(global const uint* restrict texels, vi id, int row, vf fu, vf fv, vf* value) {
  const vi a = GATHER(vi, (global const int*)texels, 0, id), b = GATHER(vi, (global const int*)texels, row, id);
  const vf a0 = TO_VF(a & 0xffff), a1 = TO_VF((a >> 16) & 0xffff), b0 = TO_VF(b & 0xffff), b1 = TO_VF((b >> 16) & 0xffff);
  const vf top = a0 + fu * (a1 - a0), low = b0 + fu * (b1 - b0);
  value[0] = (top + fv * (low - top)) * (1.f / 65535.f);
}
// Slopes of the same, per texel.
AI void texel_slopes(global const uint* restrict texels, vi id, int row, vf fu, vf fv, vf* du, vf* dv) {
  const vi a = GATHER(vi, (global const int*)texels, 0, id), b = GATHER(vi, (global const int*)texels, row, id);
  const vf a0 = TO_VF(a & 0xffff), a1 = TO_VF((a >> 16) & 0xffff), b0 = TO_VF(b & 0xffff), b1 = TO_VF((b >> 16) & 0xffff);
  du[0] = ((a1 - a0) + fv * ((b1 - b0) - (a1 - a0))) * (1.f / 65535.f);
  dv[0] = ((b0 - a0) + fu * ((b1 - b0) - (a1 - a0))) * (1.f / 65535.f);
}
#else
#define RED(q) TO_VF((q) & 2047)
#define GREEN(q) TO_VF(((q) >> 11) & 2047)
#define BLUE(q) TO_VF(((q) >> 22) & 1023)
#define CORNERS                                                                                    \
  global const int* p = (global const int*)texels;                                                 \
  const vi a = GATHER(vi, p, 0, id), b = GATHER(vi, p, 1, id), c = GATHER(vi, p, row, id),         \
           d = GATHER(vi, p, row + 1, id);
#define BILINEAR(get) (get(a) * w00 + get(b) * w10 + get(c) * w01 + get(d) * w11)
AI void texel(global const uint* restrict texels, vi id, int row, vf fu, vf fv, vf* value) {
  CORNERS
  const vf w11 = fu * fv, w10 = fu - w11, w01 = fv - w11, w00 = 1.f - fu - w01;
  value[0] = BILINEAR(RED) * (1.f / 2047.f);
  value[1] = BILINEAR(GREEN) * (1.f / 2047.f);
  value[2] = BILINEAR(BLUE) * (1.f / 1023.f);
}
#define ALONG_U(get) ((get(b) - get(a)) * (1.f - fv) + (get(d) - get(c)) * fv)
#define ALONG_V(get) ((get(c) - get(a)) * (1.f - fu) + (get(d) - get(b)) * fu)
AI void texel_slopes(global const uint* restrict texels, vi id, int row, vf fu, vf fv, vf* du, vf* dv) {
  CORNERS
  du[0] = ALONG_U(RED) * (1.f / 2047.f);
  du[1] = ALONG_U(GREEN) * (1.f / 2047.f);
  du[2] = ALONG_U(BLUE) * (1.f / 1023.f);
  dv[0] = ALONG_V(RED) * (1.f / 2047.f);
  dv[1] = ALONG_V(GREEN) * (1.f / 2047.f);
  dv[2] = ALONG_V(BLUE) * (1.f / 1023.f);
}
#endif

typedef struct {
  vf value[CHANNELS];
  vi missed;
} view;

AI vf plane_distance(const ray* r, constant float* restrict p) {
  return (p[3] - p[12] * (p[0] * r->x + p[1] * r->y + p[2] * r->z)) * RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
}
AI void plane_coordinates(const ray* r, constant float* restrict p, vf t, vf* u, vf* v) {
  const vf x = p[12] * r->x + t * r->L, y = p[12] * r->y + t * r->M, z = p[12] * r->z + t * r->N;
  *u = p[4] * x + p[5] * y + p[6] * z + p[7];
  *v = p[8] * x + p[9] * y + p[10] * z + p[11];
}

AI void look(const ray* r, constant float* restrict planes, int count, global const uint* restrict texels,
             constant float* restrict background, view* seen) {
  vf nearest = INFINITY;
  UNROLL for (int c = 0; c < CHANNELS; c++) seen->value[c] = background[c];
  seen->missed = (vi)(VLN == 1 ? 1 : -1);
  for (int j = 0; j < count; j++) {
    constant float* p = planes + j * PLANE;
    const vf t = plane_distance(r, p);
    vf u, v;
    plane_coordinates(r, p, t, &u, &v);
    const vi hit = (t > 0.f) & (t < nearest) & (u >= -0.5f) & (v >= -0.5f) & (u <= p[13] + 0.5f) & (v <= p[14] + 0.5f);
    const vf cu = CLAMPED(u, 0.f, p[13] - 1e-3f), cv = CLAMPED(v, 0.f, p[14] - 1e-3f);
    const vi iu = TO_VI(cu), iv = TO_VI(cv);
    const int row = as_int(p[15]);
    vf value[CHANNELS];
    texel(texels + as_int(p[16]), iv * row + iu, row, cu - TO_VF(iu), cv - TO_VF(iv), value);
    UNROLL for (int c = 0; c < CHANNELS; c++) seen->value[c] = select(seen->value[c], value[c], hit);
    nearest = select(nearest, t, hit);
    seen->missed = seen->missed & (VLN == 1 ? !hit : ~hit);
  }
}
