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
  vf x, y, S, a, iw, b;  // d = S a, a = 1 / (1 + w), b = S a^2 / w, so that d_i = a S_i + b T_i / 2
  float cx, cy, kx, ky, mx, my;  // curvatures, (1 + Q) c^2, (1 + Q) c
} biconic_point;

AI biconic_point at_biconic(vf x, vf y, const crossing* met, constant float* restrict p) {
  return (biconic_point){x, y, met->S, met->a, met->iw, met->S * met->a * met->a * met->iw, p[4], p[5], p[6], p[7], p[10], p[11]};
}

// Change of depth at a fixed point by the change of the curvature matrix, whose product with (x, y) is (ex, ey).
AI vf depth_change(const biconic_point* at, vf ex, vf ey) {
  return at->a * (at->x * ex + at->y * ey) + at->b * (at->mx * at->x * ex + at->my * at->y * ey);
}

// Change of the normal's x and y when the point moves by (dx, dy) and the matrix changes.
AI void normal_change(const biconic_point* at, vf dx, vf dy, float exx, float exy, float eyy, vf ex, vf ey, vf* nx, vf* ny) {
  const vf mx = at->mx * at->x, my = at->my * at->y;
  const vf Sx = 2.f * at->cx * at->x, Sy = 2.f * at->cy * at->y, Tx = 2.f * at->kx * at->x, Ty = 2.f * at->ky * at->y;
  const vf dS = Sx * dx + Sy * dy + at->x * ex + at->y * ey;
  const vf dT = Tx * dx + Ty * dy + 2.f * (mx * ex + my * ey);
  const vf dSx = 2.f * (at->cx * dx + ex), dSy = 2.f * (at->cy * dy + ey);
  const vf dTx = 2.f * (at->kx * dx + at->mx * ex + exx * mx + exy * my);
  const vf dTy = 2.f * (at->ky * dy + at->my * ey + exy * mx + eyy * my);
  const vf a2 = at->a * at->a, dw = -0.5f * at->iw * dT;
  const vf da = -a2 * dw, db = a2 * at->iw * (dS - at->S * (at->iw + 2.f * at->a) * dw);
  *nx = da * Sx + at->a * dSx + 0.5f * (db * Tx + at->b * dTx);
  *ny = da * Sy + at->a * dSy + 0.5f * (db * Ty + at->b * dTy);
}

// The derivatives of one ray through surface k, which it met with direction `dir` and has left.
AI void pass_tangents(tangent* d, vec dir, const crossing* met, const ray* after, int k, int kind, constant float* restrict p,
                      vf eta, constant float* restrict seeds) {
#if HAS_ROTATE
  if (kind == ROTATE) {
    UNROLL for (int j = 0; j < TANGENTS; j++) {
      rotate_vector(&d[j].x, &d[j].y, &d[j].z, p);
      rotate_vector(&d[j].L, &d[j].M, &d[j].N, p);
    }
    return;
  }
#endif
  const vec n = {met->nx, met->ny, met->nz};
  const vf t = met->t, iq = met->iq, nd = met->nd, ind = RECIP(nd), i_root = RECIP(AT_LEAST(1e-6f, met->root));
  const vf g = (met->root - eta * nd) * iq;
  biconic_point at;
  float cx = 0.f, cy = 0.f, cz = 0.f;
  if (kind == BICONIC) {
    at = at_biconic(after->x - p[O_X], after->y - p[O_Y], met, p);
  } else {
    cx = p[4];
    cy = kind == SPHERE ? cx : p[5];
    cz = kind == SPHERE ? cx : p[6];
  }
  UNROLL for (int j = 0; j < TANGENTS; j++) {
    vec e = {d[j].x + t * d[j].L, d[j].y + t * d[j].M, d[j].z + t * d[j].N}, dn;
    vf moved = dot3(n, e);
    if (kind == BICONIC) {
      const float here = as_int(seeds[j * SEED + 3]) == k ? 1.f : 0.f;
      const float exx = here * seeds[j * SEED], exy = here * seeds[j * SEED + 1], eyy = here * seeds[j * SEED + 2];
      const vf ex = exx * at.x + exy * at.y, ey = exy * at.x + eyy * at.y;
      const vf dt = -(moved + depth_change(&at, ex, ey)) * ind;
      e = (vec){e.x + dt * dir.x, e.y + dt * dir.y, e.z + dt * dir.z};
      normal_change(&at, e.x, e.y, exx, exy, eyy, ex, ey, &dn.x, &dn.y);
      dn.z = 0.f;
    } else {
      const vf dt = -moved * ind;
      e = (vec){e.x + dt * dir.x, e.y + dt * dir.y, e.z + dt * dir.z};
      dn = (vec){cx * e.x, cy * e.y, cz * e.z};
    }
    const vec dd = {d[j].L, d[j].M, d[j].N};
    const vf dq = 2.f * dot3(n, dn), dnd = dot3(dn, dir) + dot3(n, dd);
    const vf dg = ((0.5f * dq * (1.f - eta * eta) + eta * eta * nd * dnd) * i_root - eta * dnd - g * dq) * iq;
    d[j] = (tangent){e.x, e.y, e.z, eta * dd.x + g * dn.x + dg * n.x, eta * dd.y + g * dn.y + dg * n.y, eta * dd.z + g * dn.z + dg * n.z};
  }
}
#endif
