// Textures: bilinear look-ups of texel `id` (int index) and its neighbours, with the slopes per texel;
// `below` is the texel of the next row. CHANNELS 1: a texel is two words: its own grey and its right
// neighbour's, 16 bits each, and those of the row below, so that a bilinear look-up is one read. CHANNELS 3:
// a texel holds linear red, green and blue in 11, 11 and 10 bits.
#define TEXEL_WORDS (CHANNELS == 1 ? 2 : 1)
typedef struct {
  vf value[CHANNELS], by_u[CHANNELS], by_v[CHANNELS];
} look_up;
AI void interpolate(look_up* t, int c, vf a, vf b, vf below_a, vf below_b, vf fu, vf fv, float scale) {
  const vf along = b - a, along_below = below_b - below_a, top = a + fu * along,
           low = below_a + fu * along_below;
  t->value[c] = (top + fv * (low - top)) * scale;
  t->by_u[c] = (along + fv * (along_below - along)) * scale;
  t->by_v[c] = (low - top) * scale;
}
AI look_up texel(global const uint* restrict texels, vi id, vi below, vf fu, vf fv) {
  look_up t;
#if CHANNELS == 1
  vi a, b;
  gather_pair((global const ulong*)texels, id, &a, &b);
#define OWN(q) TO_VF((q)&0xffff)
#define RIGHT(q) TO_VF(((q) >> 16) & 0xffff)
  interpolate(&t, 0, OWN(a), RIGHT(a), OWN(b), RIGHT(b), fu, fv, 1.f / 65535.f);
#else
  global const int* p = (global const int*)texels;
  const vi a = GATHER(vi, p, 0, id), b = GATHER(vi, p, 1, id), c = GATHER(vi, p, 0, below),
           d = GATHER(vi, p, 1, below);
#define RED(q) TO_VF((q)&2047)
#define GREEN(q) TO_VF(((q) >> 11) & 2047)
#define BLUE(q) TO_VF(((q) >> 22) & 1023)
  interpolate(&t, 0, RED(a), RED(b), RED(c), RED(d), fu, fv, 1.f / 2047.f);
  interpolate(&t, 1, GREEN(a), GREEN(b), GREEN(c), GREEN(d), fu, fv, 1.f / 2047.f);
  interpolate(&t, 2, BLUE(a), BLUE(b), BLUE(c), BLUE(d), fu, fv, 1.f / 1023.f);
#endif
  return t;
}

// What rays see.
typedef struct {
  vf value[CHANNELS];
#if TANGENTS
  vf change[TANGENTS * CHANNELS];
#endif
  vi missed;
} view;
