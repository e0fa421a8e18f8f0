// A ray and what surfaces do to it. Frame: the eye's, or that frame turned about its origin (ROTATE); mm. The
// ray runs outward, N > 0. A surface's depth is d(x, y), z = -d in its own frame, whose origin is (o[0],
// o[1], o[2]).
typedef struct {
  vf x, y, z, L, M, N;
  vi state;  // 0 while it lives; the first event is kept
#if HAS_GRADIENT
  vf eta;  // ratio of indices at the surface ahead, where one of its media is a gradient
#endif
#if HAS_BODY
  vi beside;  // passes beside the body whose surfaces come
#endif
} ray;

#define VIGNETTED 1
#define TIR 2
#define MISSED_SURFACE 3

// Kinds of operation.
#define SPHERE 0
#define QUADRIC 1
#define BICONIC 2
#define PATCH 3
#define STOP 4
#define ROTATE 5
#define TRIANGLES 6
#define GRADIENT 7
#define EVERY_TRIANGLE 8

#define PARAMETERS 16  // floats an operation has
#define O_X 0
#define O_Y 1
#define O_Z 2
#define O_LIMIT2 3     // square of the clear radius
#define O_FLAGS 15     // int bits
#define ENTERS_BODY 1  // back of a body that a ray may miss; its limit is the body's edge
#define INSIDE_BODY 2  // what only a ray in the body meets, its front included
#define LOCAL_RATIO 4  // the ratio of indices is the ray's own

AI void end(ray* r, vi event, int state) { r->state = select(r->state, (vi)state, event & (r->state == 0)); }

// Refraction with a normal of any length: d' = eta d + g n. Events are rare: one test for all lanes. q = n.n,
// nd = n.d, nd2 its square; e is negative where the ray missed the surface or passed outside its clear
// aperture.
AI void refract(ray* r, vf nx, vf ny, vf nz, vf q, vf nd, vf nd2, vf eta, vf e) {
  const vf s = q * (1.f - eta * eta) + (eta * eta) * nd2;
  if (ANY(min(e, s) < 0.f)) {
    end(r, e < 0.f, MISSED_SURFACE);
    end(r, s < 0.f, TIR);
  }
  const vf g = (sqrt(AT_LEAST(0.f, s)) - eta * nd) * RECIP(q);
  r->L = eta * r->L + g * nx;
  r->M = eta * r->M + g * ny;
  r->N = eta * r->N + g * nz;
}

// The ray's place in the frame of a surface, and back. What a kernel that is made for a sequence of surfaces
// knows of each:
#define CENTRED (form & 1)    // it stands on the axis
#define UNLIMITED (form & 2)  // it has no rim
#define ENTER_FRAME \
  vf x = CENTRED ? r->x : r->x - p[O_X], y = CENTRED ? r->y : r->y - p[O_Y], z = r->z - p[O_Z];
#define LEAVE_FRAME(at_z)          \
  r->x = CENTRED ? x : x + p[O_X]; \
  r->y = CENTRED ? y : y + p[O_Y]; \
  r->z = (at_z) + p[O_Z];
// Less than 0 outside the clear aperture.
#define INSIDE(x, y) (p[O_LIMIT2] - ((x) * (x) + (y) * (y)))

// c (x^2 + y^2 + z^2) + 2 z = 0 with c well off 0; vertex form.
// p[4] = c, p[5] = 1 / c
AI void sphere(ray* r, constant float* restrict p, int form, vf eta) {
  const float c = p[4];
  ENTER_FRAME
  const vf G = r->N + c * (x * r->L + y * r->M + z * r->N);
  const vf F = c * (x * x + y * y + z * z) + 2.f * z;
  const vf e = G * G - c * F;                        // squared cosine of incidence
  const vf k = (1.f - eta * eta) + (eta * eta) * e;  // and of refraction: both roots at the same time
  const vf nd = sqrt(AT_LEAST(0.f, e)), root = sqrt(AT_LEAST(0.f, k));
  const vf t = (nd - G) * p[5];  // what cancels here moves the point along the ray by nanometres
  x += t * r->L;
  y += t * r->M;
  z += t * r->N;
  LEAVE_FRAME(z)
  const vf inside = UNLIMITED ? e : min(e, INSIDE(x, y));
  if (ANY(min(inside, k) < 0.f)) {
    end(r, inside < 0.f, MISSED_SURFACE);
    end(r, k < 0.f, TIR);
  }
  const vf g = root - eta * nd;
  const vf gc = g * c;
  r->L = eta * r->L + gc * x;
  r->M = eta * r->M + gc * y;
  r->N = eta * r->N + (gc * z + g);
}

// cx x^2 + cy y^2 + cz z^2 + 2 z = 0: conics, ellipsoids, cylinders, planes.
// p[4..6] = cx, cy, cz
AI void quadric(ray* r, constant float* restrict p, int form, vf eta) {
  const float cx = p[4], cy = p[5], cz = p[6];
  ENTER_FRAME
  const vf A = cx * r->L * r->L + cy * r->M * r->M + cz * r->N * r->N;
  const vf G = r->N + cx * x * r->L + cy * y * r->M + cz * z * r->N;
  const vf F = cx * x * x + cy * y * y + cz * z * z + 2.f * z;
  const vf e = G * G - A * F;
  const vf nd = sqrt(AT_LEAST(0.f, e));
  const vf t = -F * RECIP(G + nd);
  x += t * r->L;
  y += t * r->M;
  z += t * r->N;
  LEAVE_FRAME(z)
  const vf nx = cx * x, ny = cy * y, nz = 1.f + cz * z;
  refract(r, nx, ny, nz, nx * nx + ny * ny + nz * nz, nd, e, eta, UNLIMITED ? e : min(e, INSIDE(x, y)));
}

// Distance to the conic c (x^2 + y^2 + (1 + q) z^2) + 2 z = 0 with k = c (1 + q): where Newton starts.
AI vf base_distance(const ray* r, vf x, vf y, vf z, float c, float k) {
  const vf A = c * (r->L * r->L + r->M * r->M) + k * r->N * r->N;
  const vf G = r->N + c * (x * r->L + y * r->M) + k * z * r->N;
  const vf F = c * (x * x + y * y) + k * z * z + 2.f * z;
  return -F * RECIP(G + sqrt(AT_LEAST(0.f, G * G - A * F)));
}

// The slopes are those of the last step's start: quadratic convergence has brought it within nanometres of
// the hit.
#define NEWTON_STEPS 2
// Less than 0 where the last step was so long that the ray may pass the surface by: close to a steep body,
// say.
#define SETTLED(last) (1e-2f - (last) * (last))

#if HAS_BICONIC
// d = S / (1 + w), S = cx x^2 + cy y^2, w = sqrt(1 - T), T = kx x^2 + ky y^2 with k = (1 + Q) c^2.
// p[4..7] = cx, cy, kx, ky; p[8], p[9]: base conic
AI void biconic(ray* r, constant float* restrict p, int form, vf eta) {
  const float cx = p[4], cy = p[5], kx = p[6], ky = p[7];
  ENTER_FRAME
  const vf x0 = x, y0 = y;
  vf t = base_distance(r, x, y, z, p[8], p[9]), gx, gy, inside, slope, last;
  UNROLL
  for (int step = 0; step < NEWTON_STEPS; step++) {
    x = x0 + t * r->L;
    y = y0 + t * r->M;
    const vf S = cx * x * x + cy * y * y;
    inside = 1.f - (kx * x * x + ky * y * y);
    const vf w = sqrt(AT_LEAST(1e-3f, inside)), a = RECIP(1.f + w), iw = RECIP(w), b = S * a * a * iw;
    gx = x * (2.f * cx * a + kx * b);
    gy = y * (2.f * cy * a + ky * b);
    if (step == 0) slope = RECIP(r->N + gx * r->L + gy * r->M);
    last = (z + t * r->N + S * a) * slope;
    t -= last;
  }
  x = x0 + t * r->L;
  y = y0 + t * r->M;
  z += t * r->N;
  LEAVE_FRAME(z)
  const vf nd = gx * r->L + gy * r->M + r->N, beyond = min(inside - 1e-3f, SETTLED(last));
  refract(r, gx, gy, (vf)1.f, 1.f + gx * gx + gy * gy, nd, nd * nd, eta,
          UNLIMITED ? beyond : min(beyond, INSIDE(x, y)));
}
#endif

// A value of a record: fetched for every lane, or one that all lanes share.
#define VECTOR_COEFFICIENT(j) cell.m[j]
#define SCALAR_COEFFICIENT(j) one[j]

#if HAS_PATCH
// Bicubic patches: a record of 16 coefficients a cell, a[4 j + i] u^i v^j with u, v in 0..1.
// p[4], p[5]: base conic; p[6], p[7]: grid origin; p[8]: cells per mm; p[9], p[10]: last cell in x and y;
// p[11], p[12]: cells in a row and the first record (as int bits); p[13]: offset of the base conic
#define PATCH_NEWTON(C)                                                                                      \
  UNROLL                                                                                                     \
  for (int step = 0; step < NEWTON_STEPS; step++) {                                                          \
    const vf u = (x0 + t * r->L - p[6]) * h - u0, v = (y0 + t * r->M - p[7]) * h - v0;                       \
    const vf a0 = ((C(3) * u + C(2)) * u + C(1)) * u + C(0), a1 = ((C(7) * u + C(6)) * u + C(5)) * u + C(4), \
             a2 = ((C(11) * u + C(10)) * u + C(9)) * u + C(8),                                               \
             a3 = ((C(15) * u + C(14)) * u + C(13)) * u + C(12);                                             \
    const vf d0 = (3.f * C(3) * u + 2.f * C(2)) * u + C(1), d1 = (3.f * C(7) * u + 2.f * C(6)) * u + C(5),   \
             d2 = (3.f * C(11) * u + 2.f * C(10)) * u + C(9),                                                \
             d3 = (3.f * C(15) * u + 2.f * C(14)) * u + C(13);                                               \
    const vf depth = ((a3 * v + a2) * v + a1) * v + a0;                                                      \
    gy = ((3.f * a3 * v + 2.f * a2) * v + a1) * h;                                                           \
    gx = (((d3 * v + d2) * v + d1) * v + d0) * h;                                                            \
    if (step == 0) slope = RECIP(r->N + gx * r->L + gy * r->M);                                              \
    last = (z0 + t * r->N + depth) * slope;                                                                  \
    t -= last;                                                                                               \
  }
AI void patch(ray* r, constant float* restrict p, global const float* restrict records, vf eta) {
  const float h = p[8];
  const vf x0 = r->x - p[O_X], y0 = r->y - p[O_Y], z0 = r->z - p[O_Z];
  vf t = base_distance(r, x0, y0, z0 + p[13], p[4], p[5]);
  const vi column = TO_VI(CLAMPED((x0 + t * r->L - p[6]) * h, 0.f, p[9]));
  const vi row = TO_VI(CLAMPED((y0 + t * r->M - p[7]) * h, 0.f, p[10]));
  const vf u0 = TO_VF(column), v0 = TO_VF(row);
  const vi id = (row * as_int(p[11]) + column) * 16;
  global const float* cells = records + as_int(p[12]);
  vf gx, gy, slope, last;
#if TILE
  if (SAME(id)) {
    global const float* one = cells + LANE0(id);
    PATCH_NEWTON(SCALAR_COEFFICIENT)
  } else
#endif
  {
    record cell;
    fetch(&cell, cells, id);
    PATCH_NEWTON(VECTOR_COEFFICIENT)
  }
  const vf x = x0 + t * r->L, y = y0 + t * r->M;
  r->x = x + p[O_X];
  r->y = y + p[O_Y];
  r->z = z0 + t * r->N + p[O_Z];
  const vf nd = gx * r->L + gy * r->M + r->N;
  refract(r, gx, gy, (vf)1.f, 1.f + gx * gx + gy * gy, nd, nd * nd, eta, min(INSIDE(x, y), SETTLED(last)));
}
#endif

#if HAS_TRIANGLES
// Exact hits on an irregular sheet: a grid gives a triangle near the hit, then the ray walks across edges to
// the one it goes through. A record a triangle: depth and barycentric u, v as functions of x and y {z, z_x,
// z_y; u, u_x, u_y; v, v_x, v_y}, neighbours across u, v, w (int bits), normal's x and y at the corner w, and
// what is added to x and to y at the corners u and v, two 16-bit numbers each in units of p[7]. Normals are
// as long as the base conic's gradient (c x, c y, sqrt(1 - c k r^2)), whose x and y are linear: interpolation
// costs only what the sheet departs from that conic.
// p[4], p[5]: base conic c, k; p[6]: grid origin in x and y; p[8]: cells per mm; p[9]: last cell in x and y;
// p[11]: cells in a row; p[12], p[14]: first record and first cell of the grid in `records` (int bits);
// p[13]: offset of the base conic
#define EDGE_TOLERANCE 2e-5f  // barycentric, against slips between neighbours in float32
#define LEAST_GRADIENT 0.05f  // where the sheet goes on beyond the conic's equator
#define LONGEST_WALK 512      // steps; beyond it a ray is lost, never accepted
typedef struct {
  vf t, x, y;     // distance, and place in the sheet's frame
  vf u, v;        // barycentric
  vf nx, ny;      // normal at the corner w
  vi by_x, by_y;  // what is added to them towards u and v
  vi lost;        // beyond the sheet
} walk_end;

// From triangle `id` (times 16) across edges to the one that the ray goes through.
AI walk_end walk_to_triangle(const ray* r, vf x0, vf y0, vf z0, vi id, global const float* restrict sheet) {
  vf t, x, y, u, v, nx, ny;
  vi by_x, by_y, lost = 0;
#define MEET_TRIANGLE(F)                                                             \
  t = (F(0) + F(1) * x0 + F(2) * y0 - z0) * RECIP(r->N - F(1) * r->L - F(2) * r->M); \
  x = x0 + t * r->L;                                                                 \
  y = y0 + t * r->M;                                                                 \
  u = F(3) + F(4) * x + F(5) * y;                                                    \
  v = F(6) + F(7) * x + F(8) * y;                                                    \
  nx = F(12);                                                                        \
  ny = F(13);
  for (int step = 0;; step++) {
    vi beyond_u, beyond_v, beyond_w;
#if TILE
    if (SAME(id)) {
      global const float* one = sheet + LANE0(id);
      MEET_TRIANGLE(SCALAR_COEFFICIENT)
      beyond_u = as_int(one[9]);
      beyond_v = as_int(one[10]);
      beyond_w = as_int(one[11]);
      by_x = as_int(one[14]);
      by_y = as_int(one[15]);
    } else
#endif
    {
      record cell;
      fetch(&cell, sheet, id);
      MEET_TRIANGLE(VECTOR_COEFFICIENT)
      beyond_u = AS_VI(cell.m[9]);
      beyond_v = AS_VI(cell.m[10]);
      beyond_w = AS_VI(cell.m[11]);
      by_x = AS_VI(cell.m[14]);
      by_y = AS_VI(cell.m[15]);
    }
    const vf w = 1.f - u - v, least = min(min(u, v), w);
    vi go = least < -EDGE_TOLERANCE;
    if (!ANY(go)) break;
    const vi next = select(select(beyond_w, beyond_v, v == least), beyond_u, u == least);
    lost |= go & (next < 0);
    go &= (next >= 0);
    if (!ANY(go)) break;
    if (step >= LONGEST_WALK) {
      lost |= go;
      break;
    }
    id = select(id, next, VLN == 1 ? (go ? -1 : 0) : go);
  }
  return (walk_end){t, x, y, u, v, nx, ny, by_x, by_y, lost};
}

AI void triangles(ray* r, constant float* restrict p, global const float* restrict records, vf eta) {
  const float h = p[8];
  const vf x0 = r->x - p[O_X], y0 = r->y - p[O_Y], z0 = r->z - p[O_Z];
  const vf near = base_distance(r, x0, y0, z0 + p[13], p[4], p[5]);
  const vi column = TO_VI(CLAMPED((x0 + near * r->L - p[6]) * h, 0.f, p[9]));
  const vi row = TO_VI(CLAMPED((y0 + near * r->M - p[6]) * h, 0.f, p[9]));
  const vi cell = row * as_int(p[11]) + column;
  global const int* seeds = (global const int*)records + as_int(p[14]);
  const walk_end at = walk_to_triangle(r, x0, y0, z0, GATHER(vi, seeds, 0, cell), records + as_int(p[12]));
  const vf u = at.u * p[7], v = at.v * p[7];
  vf nx = at.nx, ny = at.ny;
  nx += u * TO_VF((at.by_x << 16) >> 16) + v * TO_VF(at.by_x >> 16);
  ny += u * TO_VF((at.by_y << 16) >> 16) + v * TO_VF(at.by_y >> 16);
  const vf r2 = at.x * at.x + at.y * at.y,
           nz2 = AT_LEAST(LEAST_GRADIENT * LEAST_GRADIENT, 1.f - p[4] * p[5] * r2), nz = sqrt(nz2);
  r->x = at.x + p[O_X];
  r->y = at.y + p[O_Y];
  r->z = z0 + at.t * r->N + p[O_Z];
  if (ANY(at.lost)) end(r, at.lost, MISSED_SURFACE);
  const vf nd = nx * r->L + ny * r->M + nz * r->N;
  refract(r, nx, ny, nz, nx * nx + ny * ny + nz2, nd, nd * nd, eta, p[O_LIMIT2] - r2);
}
#endif

#if HAS_GRADIENT
// A gradient medium is GRADIENT_FLOATS floats: 12 coefficients c[3 i + j] of t^i w^j, t = depth behind its
// origin, w = squared distance from its axis; the origin; a spare; the shift of the index at each of 16
// wavelengths; and, row after row, the matrix that turns the present frame into the medium's own.
#define GRADIENT_TURN 32
#define GRADIENT_STEPS 12

AI void turn_into(vf* x, vf* y, vf* z, constant float* restrict m) {
  const vf a = *x, b = *y, c = *z;
  *x = m[0] * a + m[1] * b + m[2] * c;
  *y = m[3] * a + m[4] * b + m[5] * c;
  *z = m[6] * a + m[7] * b + m[8] * c;
}
AI void turn_back(vf* x, vf* y, vf* z, constant float* restrict m) {
  const vf a = *x, b = *y, c = *z;
  *x = m[0] * a + m[3] * b + m[6] * c;
  *y = m[1] * a + m[4] * b + m[7] * c;
  *z = m[2] * a + m[5] * b + m[8] * c;
}
// A ray's place and direction in the frame of a gradient, and back.
AI void enter_gradient(ray* own, const ray* r, constant float* restrict g) {
  own->x = r->x - g[12];
  own->y = r->y - g[13];
  own->z = r->z - g[14];
  own->L = r->L;
  own->M = r->M;
  own->N = r->N;
  turn_into(&own->x, &own->y, &own->z, g + GRADIENT_TURN);
  turn_into(&own->L, &own->M, &own->N, g + GRADIENT_TURN);
}
AI void leave_gradient(ray* r, const ray* own, constant float* restrict g) {
  r->x = own->x;
  r->y = own->y;
  r->z = own->z;
  r->L = own->L;
  r->M = own->M;
  r->N = own->N;
  turn_back(&r->x, &r->y, &r->z, g + GRADIENT_TURN);
  turn_back(&r->L, &r->M, &r->N, g + GRADIENT_TURN);
  r->x += g[12];
  r->y += g[13];
  r->z += g[14];
}

// n and dn/dw in the gradient's frame; dn/dt is not needed: z is the independent variable.
AI vf gradient_index(vf x, vf y, vf z, constant float* restrict g, vf shift, vf* by_w) {
  const vf t = -z, w = x * x + y * y;
  const vf n0 = ((g[9] * t + g[6]) * t + g[3]) * t + g[0], n1 = ((g[10] * t + g[7]) * t + g[4]) * t + g[1],
           n2 = ((g[11] * t + g[8]) * t + g[5]) * t + g[2];
  *by_w = n1 + 2.f * n2 * w;
  return n0 + (n1 + n2 * w) * w + shift;
}

typedef struct {
  vf x, y, p, q;  // position and optical direction n L, n M
} slope4;
// Hamilton's equations with z as the independent variable.
AI slope4 gradient_slopes(vf x, vf y, vf z, vf p, vf q, constant float* restrict g, vf shift) {
  vf by_w;
  const vf n = gradient_index(x, y, z, g, shift, &by_w);
  const vf i = rsqrt(AT_LEAST(1e-6f, n * n - p * p - q * q));
  const vf bend = 2.f * n * by_w * i;
  return (slope4){p * i, q * i, bend * x, bend * y};
}
AI void gradient_step(vf* x, vf* y, vf z, vf* p, vf* q, vf h, constant float* restrict g, vf shift) {
  const vf m = 0.5f * h;
  const slope4 a = gradient_slopes(*x, *y, z, *p, *q, g, shift);
  const slope4 b = gradient_slopes(*x + m * a.x, *y + m * a.y, z + m, *p + m * a.p, *q + m * a.q, g, shift);
  const slope4 c = gradient_slopes(*x + m * b.x, *y + m * b.y, z + m, *p + m * b.p, *q + m * b.q, g, shift);
  const slope4 d = gradient_slopes(*x + h * c.x, *y + h * c.y, z + h, *p + h * c.p, *q + h * c.q, g, shift);
  const vf s = h * (1.f / 6.f);
  *x += s * (a.x + 2.f * (b.x + c.x) + d.x);
  *y += s * (a.y + 2.f * (b.y + c.y) + d.y);
  *p += s * (a.p + 2.f * (b.p + c.p) + d.p);
  *q += s * (a.q + 2.f * (b.q + c.q) + d.q);
}

// Distance to the surface that ends a gradient: its conic p[4], p[5], and where it departs from that (p[14],
// int bits) by (p[8] + p[11] r^2) x^2 + (p[9] + p[12] r^2) x y + (p[10] + p[13] r^2) y^2, a Newton step on.
AI vf end_distance(const ray* r, constant float* restrict p) {
  const vf x0 = r->x - p[O_X], y0 = r->y - p[O_Y], z0 = r->z - p[O_Z];
  vf t = base_distance(r, x0, y0, z0, p[4], p[5]);
  if (as_int(p[14])) {
    const vf x = x0 + t * r->L, y = y0 + t * r->M, r2 = x * x + y * y;
    const vf departure =
        (p[8] + p[11] * r2) * x * x + (p[9] + p[12] * r2) * x * y + (p[10] + p[13] * r2) * y * y;
    const vf slope = p[4] * RECIP(1.f + p[5] * (z0 + t * r->N));
    t -= departure * RECIP(r->N + slope * (x * r->L + y * r->M));
  }
  return t;
}

// Takes the ray to the surface ahead and leaves the ratio of indices there: p[0..2] the surface's origin,
// p[4], p[5], p[8..14] its form, p[6], p[7] the gradients behind and in front (int bits, -1: homogeneous), eta
// the ratio of the homogeneous parts.
AI void gradient(ray* r, constant float* restrict p, constant float* restrict gradients, vf eta, int wave) {
  const int behind = as_int(p[6]), front = as_int(p[7]);
  vf by_w, n_behind = 1.f, n_front = 1.f;
  if (behind >= 0) {
    constant float* g = gradients + behind * GRADIENT_FLOATS;
    const vf shift = WAVE_LANES ? VLOAD(1, g) : (vf)g[16 + wave];
    ray own;
    enter_gradient(&own, r, g);
    vf n = gradient_index(own.x, own.y, own.z, g, shift, &by_w);
    vf P = n * own.L, Q = n * own.M;
    UNROLL
    for (int part = 0; part < 2;
         part++) {  // to where a straight ray would meet the surface, then what is left
      const vf t = end_distance(r, p);
      const int steps = part == 0 ? GRADIENT_STEPS : 1;
      const vf h = t * own.N * (1.f / steps);
      for (int i = 0; i < steps; i++) {
        gradient_step(&own.x, &own.y, own.z, &P, &Q, h, g, shift);
        own.z += h;
      }
      n = gradient_index(own.x, own.y, own.z, g, shift, &by_w);
      const vf scale = RECIP(n);
      own.L = P * scale;
      own.M = Q * scale;
      own.N = sqrt(AT_LEAST(0.f, 1.f - own.L * own.L - own.M * own.M));
      leave_gradient(r, &own, g);
    }
    n_behind = n;
  }
  if (front >= 0) {
    constant float* g = gradients + front * GRADIENT_FLOATS;
    const vf shift = WAVE_LANES ? VLOAD(1, g) : (vf)g[16 + wave];
    const vf t = end_distance(r, p);
    vf x = r->x + t * r->L - g[12], y = r->y + t * r->M - g[13], z = r->z + t * r->N - g[14];
    turn_into(&x, &y, &z, g + GRADIENT_TURN);
    n_front = gradient_index(x, y, z, g, shift, &by_w);
  }
  r->eta = eta * n_behind * RECIP(n_front);
}
#endif

AI void stop(ray* r, constant float* restrict p, int form) {
  ENTER_FRAME
  const vf t = -z * RECIP(r->N);
  x += t * r->L;
  y += t * r->M;
  LEAVE_FRAME(0.f)
  end(r, INSIDE(x, y) < 0.f, VIGNETTED);
}

#if HAS_ROTATE
AI void rotate_vector(vf* x, vf* y, vf* z, constant float* restrict p) {
  const vf a = *x, b = *y, c = *z;
  *x = p[0] * a + p[1] * b + p[2] * c;
  *y = p[3] * a + p[4] * b + p[5] * c;
  *z = p[6] * a + p[7] * b + p[8] * c;
}
AI void rotate_ray(ray* r, constant float* restrict p) {
  rotate_vector(&r->x, &r->y, &r->z, p);
  rotate_vector(&r->L, &r->M, &r->N, p);
}
#endif
