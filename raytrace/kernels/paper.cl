// Sheets whose triangles are tested one by one or by a hierarchy of boxes, and the aim of Wei, Patkar and Pai
// (2014): random points of a cap over the posterior lens.

#if HAS_EVERY_TRIANGLE
// Two records a triangle: {plane n (3), n.p; barycentric u (3 + 1), v (3 + 1); corner a (3), 0} and {normals
// at a, b, c (9); edges b - a (3), c - a (3), 0}.
// p[4]: nodes of a hierarchy over them, 0 for none; p[11]: number of triangles; p[12], p[14]: first record
// and first node (int bits)
#define SHEET_TRIANGLE 32
// Low corner (3), next node where the box is missed; high corner (3), leaf: first triangle x 16 + count.
#define SHEET_NODE 8
// The part of the line inside a box: empty where enter > leave.
AI void cross_box(const ray* r, vf x, vf y, vf z, global const float* n, vf* enter, vf* leave) {
  const vf ix = RECIP(r->L), iy = RECIP(r->M), iz = RECIP(r->N);
  const vf ax = (n[0] - x) * ix, bx = (n[4] - x) * ix, ay = (n[1] - y) * iy, by = (n[5] - y) * iy,
           az = (n[2] - z) * iz, bz = (n[6] - z) * iz;
  *enter = max(max(min(ax, bx), min(ay, by)), min(az, bz));
  *leave = min(min(max(ax, bx), max(ay, by)), max(az, bz));
}

// The nearest triangle that a ray has met so far. The ray starts at (x, y, z) in the sheet's own frame.
typedef struct {
  vf x, y, z, nearest, u, v;
  vi triangle;
} sheet_hit;

AI void meet_sheet_triangle(const ray* r, sheet_hit* h, int k, global const float* restrict sheet) {
  global const float* f = sheet + k * SHEET_TRIANGLE;
  const vf t =
      (f[3] - f[0] * h->x - f[1] * h->y - f[2] * h->z) * RECIP(f[0] * r->L + f[1] * r->M + f[2] * r->N);
  const vf hx = h->x + t * r->L, hy = h->y + t * r->M, hz = h->z + t * r->N;
  const vf u = f[4] * hx + f[5] * hy + f[6] * hz + f[7], v = f[8] * hx + f[9] * hy + f[10] * hz + f[11];
  // a ray that starts on the sheet meets it
  const vi hit = (min(min(u, v), 1.f - u - v) >= -1e-5f) & (t > -1e-3f) & (t < h->nearest);
  h->nearest = select(h->nearest, t, hit);
  h->u = select(h->u, u, hit);
  h->v = select(h->v, v, hit);
  h->triangle = select(h->triangle, (vi)k, hit);
}

// Takes the ray to its hit and refracts it with the normal between those of the corners.
AI void refract_at_sheet(ray* r, const sheet_hit* h, global const float* restrict sheet, vf eta) {
  const vi lost = h->triangle < 0;
  record n;
  fetch(&n, sheet, max(h->triangle, (vi)0) * SHEET_TRIANGLE + 16);
  const vf u = h->u, v = h->v, w = 1.f - u - v;
  const vf nx = w * n.m[0] + u * n.m[3] + v * n.m[6], ny = w * n.m[1] + u * n.m[4] + v * n.m[7],
           nz = w * n.m[2] + u * n.m[5] + v * n.m[8];
  const vf t = select(h->nearest, (vf)0.f, lost);
  r->x += t * r->L;
  r->y += t * r->M;
  r->z += t * r->N;
  if (ANY(lost)) end(r, lost, MISSED_SURFACE);
  const vf nd = nx * r->L + ny * r->M + nz * r->N;
  refract(r, nx, ny, nz, nx * nx + ny * ny + nz * nz, nd, nd * nd, eta, (vf)1.f);
}

AI void every_triangle(ray* r, constant float* restrict p, global const float* restrict records, vf eta) {
  global const float* sheet = records + as_int(p[12]);
  const int count = as_int(p[11]);
  sheet_hit hits[UN];
  EACH_RAY (q) {
    hits[q].x = r[q].x - p[O_X];
    hits[q].y = r[q].y - p[O_Y];
    hits[q].z = r[q].z - p[O_Z];
    hits[q].nearest = INFINITY;
    hits[q].u = hits[q].v = 0.f;
    hits[q].triangle = -1;
  }
  const int node_count = (int)p[4];
  global const float* nodes = records + as_int(p[14]);
  for (int i = 0; i < max(node_count, 1); i++) {
    int first = 0, end_of_leaf = count;
    if (node_count > 0) {
      global const float* n = nodes + i * SHEET_NODE;
      int met = 0;
      EACH_RAY (q) {
        vf enter, leave;
        cross_box(r + q, hits[q].x, hits[q].y, hits[q].z, n, &enter, &leave);
        met |= ANY((enter <= leave) & (leave >= -1e-3f) & (enter < hits[q].nearest));
      }
      if (!met) {
        i = as_int(n[3]) - 1;
        continue;
      }
      const int leaf = as_int(n[7]);
      first = leaf >> 4;
      end_of_leaf = first + (leaf & 15);
    }
    for (int k = first; k < end_of_leaf; k++) {
      EACH_RAY (q) meet_sheet_triangle(r + q, hits + q, k, sheet);
    }
  }
  EACH_RAY (q) refract_at_sheet(r + q, hits + q, sheet, eta);
}
#endif

#if RANDOM_CAP
AI vu scramble_lanes(vu h) {
  h = h * 747796405u + 2891336453u;
  const vu w = ((h >> ((h >> 28) + 4)) ^ h) * 277803737u;
  return (w >> 22) ^ w;
}

#if HAS_EVERY_TRIANGLE
// The share of the way from the origin along e that is nearest to d, and the square of the distance left.
AI vf along_edge(vf dx, vf dy, vf dz, float ex, float ey, float ez, vf* square) {
  const vf s = CLAMPED((dx * ex + dy * ey + dz * ez) * RECIP(ex * ex + ey * ey + ez * ez), 0.f, 1.f);
  const vf x = dx - s * ex, y = dy - s * ey, z = dz - s * ez;
  *square = x * x + y * y + z * z;
  return s;
}

// Moves (x, y, z) to the nearest point of the sheet.
AI void to_nearest_point(vf* x, vf* y, vf* z, constant float* restrict p,
                         global const float* restrict records) {
  global const float* sheet = records + as_int(p[12]);
  const int count = as_int(p[11]);
  const vf px = *x - p[O_X], py = *y - p[O_Y], pz = *z - p[O_Z];
  vf least = INFINITY, best_x = px, best_y = py, best_z = pz;
  for (int k = 0; k < count; k++) {
    global const float* f = sheet + k * SHEET_TRIANGLE;
    global const float* b = f + 16 + 9;
    global const float* c = b + 3;
    const vf dx = px - f[12], dy = py - f[13], dz = pz - f[14];
    vf u = f[4] * px + f[5] * py + f[6] * pz + f[7], v = f[8] * px + f[9] * py + f[10] * pz + f[11],
       from_plane, on_b, on_c, on_bc;
    const vi over = min(min(u, v), 1.f - u - v) >= 0.f;
    from_plane = f[0] * px + f[1] * py + f[2] * pz - f[3];
    from_plane = select((vf)INFINITY, from_plane * from_plane, over);
    const vf s = along_edge(dx, dy, dz, b[0], b[1], b[2], &on_b),
             t = along_edge(dx, dy, dz, c[0], c[1], c[2], &on_c),
             w = along_edge(dx - b[0], dy - b[1], dz - b[2], c[0] - b[0], c[1] - b[1], c[2] - b[2], &on_bc);
    const vf square = min(min(from_plane, on_b), min(on_c, on_bc));
    const vi outside = square < from_plane, at_b = outside & (square == on_b),
             at_c = outside & (square == on_c) & (on_c < on_b),
             at_bc = outside & (square == on_bc) & (on_bc < min(on_b, on_c));
    u = select(select(select(u, s, at_b), (vf)0.f, at_c), 1.f - w, at_bc);
    v = select(select(select(v, (vf)0.f, at_b), t, at_c), w, at_bc);
    const vi nearer = square < least;
    least = select(least, square, nearer);
    best_x = select(best_x, f[12] + u * b[0] + v * c[0], nearer);
    best_y = select(best_y, f[13] + u * b[1] + v * c[1], nearer);
    best_z = select(best_z, f[14] + u * b[2] + v * c[2], nearer);
  }
  *x = best_x + p[O_X];
  *y = best_y + p[O_Y];
  *z = best_z + p[O_Z];
}
#endif

// A ray from the retina to a random point of the cap, evenly by area. cap: its vertex (3), signed radius
// and depth, operation of its surface (int bits).
AI void start_at_cap(ray* r, vu n, uint shift_1, uint shift_2, const float* pixel,
                     constant float* restrict cap, constant float* restrict operations,
                     global const float* restrict records) {
  const vf u1 = unit_interval(scramble_lanes(n ^ shift_1)), u2 = unit_interval(scramble_lanes(n ^ shift_2));
  vf s, c;
  angle(u2, &s, &c);
  const vf depth = u1 * cap[4], rho = sqrt(AT_LEAST(0.f, (2.f * cap[3] - depth) * depth));
  vf x = cap[0] + rho * c, y = cap[1] + rho * s, z = cap[2] - depth;
#if HAS_EVERY_TRIANGLE
  to_nearest_point(&x, &y, &z, operations + as_int(cap[5]) * PARAMETERS, records);
#endif
  const vf dx = x - pixel[0], dy = y - pixel[1], dz = z - pixel[2],
           scale = rsqrt(dx * dx + dy * dy + dz * dz);
  r->x = pixel[0];
  r->y = pixel[1];
  r->z = pixel[2];
  r->L = dx * scale;
  r->M = dy * scale;
  r->N = dz * scale;
  r->state = 0;
}
#endif
