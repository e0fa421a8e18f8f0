// Forward derivatives of a ray with respect to TANGENTS parameters, each of which bends one BICONIC surface: 4 floats a
// parameter, the change of its curvature matrix over the surface's own x and y (xx, xy, yy) and its operation (int bits).
#if TANGENTS
#define SEED 4

typedef struct {
  vf x, y, z, L, M, N;  // derivative of the ray; of its position any part along the ray may be left out
} tangent;

typedef struct {
  vf x, y, z;
} vec;
AI vf dot3(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// What a biconic's normal (d_x, d_y, 1) and its derivatives are made of, at (x, y).
typedef struct {
  vf x, y, S, w, a, b;  // d = S a, a = 1 / (1 + w), b = S a^2 / w, so that d_i = a S_i + b T_i / 2
  float cx, cy, kx, ky, mx, my;  // curvatures, (1 + Q) c^2, (1 + Q) c
} biconic_point;

AI biconic_point at_biconic(vf x, vf y, constant float* restrict p) {
  biconic_point at;
  at.x = x;
  at.y = y;
  at.cx = p[4];
  at.cy = p[5];
  at.kx = p[6];
  at.ky = p[7];
  at.mx = p[10];
  at.my = p[11];
  at.S = at.cx * x * x + at.cy * y * y;
  at.w = sqrt(AT_LEAST(1e-3f, 1.f - (at.kx * x * x + at.ky * y * y)));
  at.a = RECIP(1.f + at.w);
  at.b = at.S * at.a * at.a * RECIP(at.w);
  return at;
}

// Change of depth at a fixed point by the change (exx, exy, eyy) of the curvature matrix.
AI vf depth_change(const biconic_point* at, float exx, float exy, float eyy) {
  const vf ex = exx * at->x + exy * at->y, ey = exy * at->x + eyy * at->y;
  return at->a * (at->x * ex + at->y * ey) + at->b * (at->mx * at->x * ex + at->my * at->y * ey);
}

// Change of the normal's x and y when the point moves by (dx, dy) and the matrix changes.
AI void normal_change(const biconic_point* at, vf dx, vf dy, float exx, float exy, float eyy, vf* nx, vf* ny) {
  const vf ex = exx * at->x + exy * at->y, ey = exy * at->x + eyy * at->y;
  const vf mx = at->mx * at->x, my = at->my * at->y;
  const vf Sx = 2.f * at->cx * at->x, Sy = 2.f * at->cy * at->y, Tx = 2.f * at->kx * at->x, Ty = 2.f * at->ky * at->y;
  const vf dS = Sx * dx + Sy * dy + at->x * ex + at->y * ey;
  const vf dT = Tx * dx + Ty * dy + 2.f * (mx * ex + my * ey);
  const vf dSx = 2.f * (at->cx * dx + ex), dSy = 2.f * (at->cy * dy + ey);
  const vf dTx = 2.f * (at->kx * dx + at->mx * ex + exx * mx + exy * my);
  const vf dTy = 2.f * (at->ky * dy + at->my * ey + exy * mx + eyy * my);
  const vf iw = RECIP(at->w), a2 = at->a * at->a, dw = -0.5f * iw * dT;
  const vf da = -a2 * dw, db = a2 * iw * (dS - at->S * (iw + 2.f * at->a) * dw);
  *nx = da * Sx + at->a * dSx + 0.5f * (db * Tx + at->b * dTx);
  *ny = da * Sy + at->a * dSy + 0.5f * (db * Ty + at->b * dTy);
}

// The derivatives of one ray through surface k, given the ray before and after it.
AI void pass_tangents(tangent* d, const ray* before, const ray* after, int k, int kind, constant float* restrict p, vf eta,
                      constant float* restrict seeds) {
#if HAS_ROTATE
  if (kind == ROTATE) {
    UNROLL for (int j = 0; j < TANGENTS; j++) {
      rotate_vector(&d[j].x, &d[j].y, &d[j].z, p);
      rotate_vector(&d[j].L, &d[j].M, &d[j].N, p);
    }
    return;
  }
#endif
  const vec dir = {before->L, before->M, before->N};
  const vec x = {after->x - p[O_X], after->y - p[O_Y], after->z - p[O_Z]};
  const vf t = (after->z - before->z) * RECIP(before->N);
  biconic_point at;
  vec n;
  float cx = 0.f, cy = 0.f, cz = 0.f;
  if (kind == BICONIC) {
    at = at_biconic(x.x, x.y, p);
    n = (vec){x.x * (2.f * at.cx * at.a + at.kx * at.b), x.y * (2.f * at.cy * at.a + at.ky * at.b), (vf)1.f};
  } else {
    cx = p[4];
    cy = kind == SPHERE ? cx : p[5];
    cz = kind == SPHERE ? cx : p[6];
    n = (vec){cx * x.x, cy * x.y, 1.f + cz * x.z};
  }
  const vf q = dot3(n, n), nd = dot3(n, dir), ind = RECIP(nd), iq = RECIP(q);
  const vf root = sqrt(AT_LEAST(1e-12f, q * (1.f - eta * eta) + eta * eta * nd * nd));
  const vf g = (root - eta * nd) * iq;
  UNROLL for (int j = 0; j < TANGENTS; j++) {
    const float here = as_int(seeds[j * SEED + 3]) == k ? 1.f : 0.f;
    const float exx = here * seeds[j * SEED], exy = here * seeds[j * SEED + 1], eyy = here * seeds[j * SEED + 2];
    vec e = {d[j].x + t * d[j].L, d[j].y + t * d[j].M, d[j].z + t * d[j].N};
    vf moved = dot3(n, e);
    if (kind == BICONIC) moved += depth_change(&at, exx, exy, eyy);
    const vf dt = -moved * ind;
    e.x += dt * dir.x;
    e.y += dt * dir.y;
    e.z += dt * dir.z;
    vec dn;
    if (kind == BICONIC) {
      normal_change(&at, e.x, e.y, exx, exy, eyy, &dn.x, &dn.y);
      dn.z = 0.f;
    } else {
      dn = (vec){cx * e.x, cy * e.y, cz * e.z};
    }
    const vec dd = {d[j].L, d[j].M, d[j].N};
    const vf dq = 2.f * dot3(n, dn), dnd = dot3(dn, dir) + dot3(n, dd);
    const vf dg = ((dq * (1.f - eta * eta) + 2.f * eta * eta * nd * dnd) * (0.5f * RECIP(root)) - eta * dnd - g * dq) * iq;
    d[j].x = e.x;
    d[j].y = e.y;
    d[j].z = e.z;
    d[j].L = eta * dd.x + g * dn.x + dg * n.x;
    d[j].M = eta * dd.y + g * dn.y + dg * n.y;
    d[j].N = eta * dd.z + g * dn.z + dg * n.z;
  }
}

// Derivatives of what a ray sees. The nearest plane is found as in look().
AI void look_tangents(const ray* r, const tangent* d, constant float* restrict planes, int count,
                      global const uint* restrict texels, vf* change) {
  vf nearest = INFINITY;
  UNROLL for (int i = 0; i < TANGENTS * CHANNELS; i++) change[i] = 0.f;
  for (int k = 0; k < count; k++) {
    constant float* p = planes + k * PLANE;
    const vf t = plane_distance(r, p), depth = DEPTH(p, t);
    vf u, v;
    plane_coordinates(r, p, t, &u, &v);
    const vi hit = (t > 0.f) & (depth < nearest) & (u >= -0.5f) & (v >= -0.5f) & (u <= p[13] + 0.5f) & (v <= p[14] + 0.5f);
    const vf cu = CLAMPED(u, 0.f, p[13] - 1e-3f), cv = CLAMPED(v, 0.f, p[14] - 1e-3f);
    const vi iu = TO_VI(cu), iv = TO_VI(cv);
    const int row = as_int(p[15]);
    vf su[CHANNELS], sv[CHANNELS];
    const vi id = iv * row + iu;
    texel_slopes(texels + as_int(p[16]), id, id + row, cu - TO_VF(iu), cv - TO_VF(iv), su, sv);
    const vf across = RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
    UNROLL for (int j = 0; j < TANGENTS; j++) {
      const vf dt = -(p[12] * (p[0] * d[j].x + p[1] * d[j].y + p[2] * d[j].z) +
                      t * (p[0] * d[j].L + p[1] * d[j].M + p[2] * d[j].N)) * across;
      const vf x = p[12] * d[j].x + t * d[j].L + dt * r->L, y = p[12] * d[j].y + t * d[j].M + dt * r->M,
               z = p[12] * d[j].z + t * d[j].N + dt * r->N;
      const vf du = p[4] * x + p[5] * y + p[6] * z, dv = p[8] * x + p[9] * y + p[10] * z;
      UNROLL for (int c = 0; c < CHANNELS; c++)
        change[j * CHANNELS + c] = select(change[j * CHANNELS + c], su[c] * du + sv[c] * dv, hit);
    }
    nearest = select(nearest, depth, hit);
  }
}
#endif
