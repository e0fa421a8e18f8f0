// Vectors of rays, OpenCL C 1.2. One source for every device:
//   VLN  lanes a work-item carries: 16 (CPU, explicit vectors) or 1 (GPU, a ray a work-item)
//   UN   independent batches in flight, which hide the latency of square roots and divisions
//   TILE 0: lanes are samples of one pixel, or the wavelengths of one. 1: lanes are 16 pixels four apart in a
//        block of 16 x 16, which take the same samples: their rays lie so close that most often one record of
//        a mesh serves all, while pixels side by side have samples of their own, so that noise stays
//        fine-grained
// Vector comparisons give -1 and 0, scalar ones 1 and 0: masks are only tested with ANY and used by select.

#define WAVE_LANES (VLN > 1 && !TILE)

// PoCL 3.1 leaves plain inline helpers as calls, so that vectors would travel through memory.
#define AI static inline __attribute__((always_inline))
// PoCL's any() is a chain of tests; clang's reduction is one instruction, which a simulator may not know (PLAIN_ANY).
#if defined(__has_builtin) && !defined(PLAIN_ANY)
#if __has_builtin(__builtin_reduce_or)
#define ANY(mask) (__builtin_reduce_or(mask) != 0)
#endif
#endif
#ifndef ANY
#define ANY any
#endif
#define UNROLL _Pragma("unroll")
// Every one of the UN rays that a work-item has in flight.
#define EACH_RAY(q) \
  UNROLL            \
  for (int q = 0; q < UN; q++)
#define RECIP(x) (1.0f / (x))

#if VLN == 1
typedef float vf;
typedef uint vu;
typedef int vi;
#define TO_VF convert_float
#define TO_VI convert_int
#define AS_VI as_int
#define LANES 0u
#define VLOAD(i, p) (p)[i]
#define VSTORE(v, i, p) (p)[i] = (v)
#define GATHER(T, p, offset, id) (p)[(id) + (offset)]
AI void gather_pair(global const ulong* p, vi id, vi* first, vi* second) {
  const ulong pair = p[id];
  *first = (int)(pair & 0xffffffff);
  *second = (int)(pair >> 32);
}
#undef ANY
#define ANY(mask) (mask)
#define SUM(v) (v)
#define COUNT(v) (v)
#define ONE_WHERE(mask) ((mask) ? 1 : 0)
#else
typedef float16 vf;
typedef uint16 vu;
typedef int16 vi;
#define TO_VF convert_float16
#define TO_VI convert_int16
#define AS_VI as_int16
#define LANES (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#define VLOAD vload16
#define VSTORE vstore16
#define EACH_LANE(m)                                                                                  \
  m(0, s0) m(1, s1) m(2, s2) m(3, s3) m(4, s4) m(5, s5) m(6, s6) m(7, s7) m(8, s8) m(9, s9) m(10, sa) \
      m(11, sb) m(12, sc) m(13, sd) m(14, se) m(15, sf)
#define GATHER(T, p, offset, id)                                                                  \
  (T)((p)[id.s0 + (offset)], (p)[id.s1 + (offset)], (p)[id.s2 + (offset)], (p)[id.s3 + (offset)], \
      (p)[id.s4 + (offset)], (p)[id.s5 + (offset)], (p)[id.s6 + (offset)], (p)[id.s7 + (offset)], \
      (p)[id.s8 + (offset)], (p)[id.s9 + (offset)], (p)[id.sa + (offset)], (p)[id.sb + (offset)], \
      (p)[id.sc + (offset)], (p)[id.sd + (offset)], (p)[id.se + (offset)], (p)[id.sf + (offset)])
// Two words side by side for every lane: half the reads.
AI void gather_pair(global const ulong* p, int16 id, int16* first, int16* second) {
  const int16 low =
      as_int16((ulong8)(p[id.s0], p[id.s1], p[id.s2], p[id.s3], p[id.s4], p[id.s5], p[id.s6], p[id.s7]));
  const int16 high =
      as_int16((ulong8)(p[id.s8], p[id.s9], p[id.sa], p[id.sb], p[id.sc], p[id.sd], p[id.se], p[id.sf]));
  *first = (int16)(low.even, high.even);
  *second = (int16)(low.odd, high.odd);
}
#define SAME(id) (!ANY((id) != (int16)((id).s0)))
#define LANE0(v) (v).s0
AI float sum16(float16 v) {
  const float8 a = v.lo + v.hi;
  const float4 b = a.lo + a.hi;
  return b.x + b.y + b.z + b.w;
}
AI int count16(int16 v) {
  const int8 a = v.lo + v.hi;
  const int4 b = a.lo + a.hi;
  return b.x + b.y + b.z + b.w;
}
#define SUM sum16
#define COUNT count16
#define ONE_WHERE(mask) (-(mask))
// Shuffles whose literals are one AVX-512 instruction each.
#define UL(a, b) \
  (float16)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5, a.s8, b.s8, a.s9, b.s9, a.sc, b.sc, a.sd, b.sd)
#define UH(a, b) \
  (float16)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7, a.sa, b.sa, a.sb, b.sb, a.se, b.se, a.sf, b.sf)
#define DL(a, b) (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd)
#define DH(a, b) (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef)
#define QE(a, b) (float16)(a.s0123, a.s89ab, b.s0123, b.s89ab)
#define QO(a, b) (float16)(a.s4567, a.scdef, b.s4567, b.scdef)
#endif

// The bound where v is not a number, which OpenCL's max and min leave open, so that an index made of it is
// valid: one instruction.
AI vf at_least(vf bound, vf v) { return select(bound, v, v > bound); }
AI vf at_most(vf bound, vf v) { return select(bound, v, v < bound); }
#define AT_LEAST(bound, v) at_least((vf)(bound), v)
#define AT_MOST(bound, v) at_most((vf)(bound), v)
#define CLAMPED(v, low, high) AT_MOST(high, AT_LEAST(low, v))

// A 64-byte record of 16 floats, 64 bytes aligned, for every lane, as 16 vectors. id: index of the record times 16.
typedef struct {
  vf m[16];
} record;
AI void fetch(record* r, global const float* restrict p, vi id) {
#if VLN == 1
  // Four wide loads: on a GPU a ray's record costs by the load.
  global const float4* quads = (global const float4*)(p + id);
  UNROLL
  for (int q = 0; q < 4; q++) {
    const float4 quad = quads[q];
    r->m[4 * q] = quad.x;
    r->m[4 * q + 1] = quad.y;
    r->m[4 * q + 2] = quad.z;
    r->m[4 * q + 3] = quad.w;
  }
#else
// One aligned load a lane and a 16 x 16 transposition in registers: faster than gathers.
#define LOAD_LANE(n, s) float16 r##n = vload16(0, p + id.s);
  EACH_LANE(LOAD_LANE)
#define PAIRS(i, j) float16 t##i = UL(r##i, r##j), t##j = UH(r##i, r##j)
  PAIRS(0, 1);
  PAIRS(2, 3);
  PAIRS(4, 5);
  PAIRS(6, 7);
  PAIRS(8, 9);
  PAIRS(10, 11);
  PAIRS(12, 13);
  PAIRS(14, 15);
#define FOURS(a, b, c, d) \
  float16 u##a = DL(t##a, t##c), u##b = DH(t##a, t##c), u##c = DL(t##b, t##d), u##d = DH(t##b, t##d)
  FOURS(0, 1, 2, 3);
  FOURS(4, 5, 6, 7);
  FOURS(8, 9, 10, 11);
  FOURS(12, 13, 14, 15);
#define COLUMNS(i, b, c, d)                                                                           \
  {                                                                                                   \
    const float16 a0 = QE(u##i, u##b), a4 = QO(u##i, u##b), a8 = QE(u##c, u##d), ac = QO(u##c, u##d); \
    r->m[i] = QE(a0, a8);                                                                             \
    r->m[8 + i] = QO(a0, a8);                                                                         \
    r->m[4 + i] = QE(a4, ac);                                                                         \
    r->m[12 + i] = QO(a4, ac);                                                                        \
  }
  COLUMNS(0, 4, 8, 12);
  COLUMNS(1, 5, 9, 13);
  COLUMNS(2, 6, 10, 14);
  COLUMNS(3, 7, 11, 15);
#endif
}

AI vf unit_interval(vu h) { return TO_VF(AS_VI(h >> 8)) * (1.f / 16777216.f); }
AI uint scramble(uint h) {  // PCG, O'Neill 2014
  h = h * 747796405u + 2891336453u;
  const uint w = ((h >> ((h >> 28) + 4)) ^ h) * 277803737u;
  return (w >> 22) ^ w;
}
// sin and cos of 2 pi (u - 1/2), u in 0..1: the disc's angle, 2e-5 is ample for where a sample lies.
AI void angle(vf u, vf* s, vf* c) {
  const vf x = u - 0.5f, x2 = x * x;
  *s = x * (6.283185307f +
            x2 * (-41.34170224f +
                  x2 * (81.60524927f +
                        x2 * (-76.70585975f + x2 * (42.05869394f + x2 * (-15.09464258f + x2 * 3.4f))))));
  *c = 1.f + x2 * (-19.73920880f +
                   x2 * (64.93939402f +
                         x2 * (-85.45681720f + x2 * (60.24464137f + x2 * (-26.42625678f + x2 * 7.9f)))));
}
