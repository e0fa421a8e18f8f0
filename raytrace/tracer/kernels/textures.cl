// Textures: bilinear look-ups of texel `id` (int index) and its neighbours; `below` is the texel of the next row.
// CHANNELS 1: a texel holds its own grey and its right neighbour's, 16 bits each, so that a bilinear look-up is two reads.
// CHANNELS 3: a texel holds linear red, green and blue in 11, 11 and 10 bits.
#if CHANNELS == 1
AI void texel(global const uint* restrict texels, vi id, vi below, vf fu, vf fv, vf* value) {
  const vi a = GATHER(vi, (global const int*)texels, 0, id), b = GATHER(vi, (global const int*)texels, 0, below);
  const vf a0 = TO_VF(a & 0xffff), a1 = TO_VF((a >> 16) & 0xffff), b0 = TO_VF(b & 0xffff), b1 = TO_VF((b >> 16) & 0xffff);
  const vf top = a0 + fu * (a1 - a0), low = b0 + fu * (b1 - b0);
  value[0] = (top + fv * (low - top)) * (1.f / 65535.f);
}
// Slopes of the same, per texel.
AI void texel_slopes(global const uint* restrict texels, vi id, vi below, vf fu, vf fv, vf* du, vf* dv) {
  const vi a = GATHER(vi, (global const int*)texels, 0, id), b = GATHER(vi, (global const int*)texels, 0, below);
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
  const vi a = GATHER(vi, p, 0, id), b = GATHER(vi, p, 1, id), c = GATHER(vi, p, 0, below),        \
           d = GATHER(vi, p, 1, below);
#define BILINEAR(get) (get(a) * w00 + get(b) * w10 + get(c) * w01 + get(d) * w11)
AI void texel(global const uint* restrict texels, vi id, vi below, vf fu, vf fv, vf* value) {
  CORNERS
  const vf w11 = fu * fv, w10 = fu - w11, w01 = fv - w11, w00 = 1.f - fu - w01;
  value[0] = BILINEAR(RED) * (1.f / 2047.f);
  value[1] = BILINEAR(GREEN) * (1.f / 2047.f);
  value[2] = BILINEAR(BLUE) * (1.f / 1023.f);
}
#define ALONG_U(get) ((get(b) - get(a)) * (1.f - fv) + (get(d) - get(c)) * fv)
#define ALONG_V(get) ((get(c) - get(a)) * (1.f - fu) + (get(d) - get(b)) * fu)
AI void texel_slopes(global const uint* restrict texels, vi id, vi below, vf fu, vf fv, vf* du, vf* dv) {
  CORNERS
  du[0] = ALONG_U(RED) * (1.f / 2047.f);
  du[1] = ALONG_U(GREEN) * (1.f / 2047.f);
  du[2] = ALONG_U(BLUE) * (1.f / 1023.f);
  dv[0] = ALONG_V(RED) * (1.f / 2047.f);
  dv[1] = ALONG_V(GREEN) * (1.f / 2047.f);
  dv[2] = ALONG_V(BLUE) * (1.f / 1023.f);
}
#endif

// What rays see.
typedef struct {
  vf value[CHANNELS];
  vi missed;
} view;
