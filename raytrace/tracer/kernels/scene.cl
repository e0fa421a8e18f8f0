// Textured planes. A plane is 20 floats: normal n (3), h; a (3), a0; b (3), b0; s; last texel in x and y, row length and first
// texel (int bits). It is met at t = (h - s n.p) / (n.d); texel coordinates are u = a.(s p + t d) + a0, v likewise, counted
// from the first texel's centre. s is 0 for a plane at infinity, else 1.
#define PLANE 20

AI void plane_coordinates(const ray* r, constant float* restrict p, vf t, vf* u, vf* v) {
  const vf x = p[12] * r->x + t * r->L, y = p[12] * r->y + t * r->M, z = p[12] * r->z + t * r->N;
  *u = p[4] * x + p[5] * y + p[6] * z + p[7];
  *v = p[8] * x + p[9] * y + p[10] * z + p[11];
}

// How far a hit on plane p counts: what is at infinity lies behind everything else.
#define DEPTH(p, t) ((p)[12] == 0.f ? (t) * 1e30f : (t))

// What the kernels take of a scene.
#define SCENE                                                                                              \
  constant float* restrict planes, int plane_count, global const uint* restrict texels, constant float* restrict background MESHES
#define SCENE_ARGUMENTS planes, plane_count, texels, background MESH_ARGUMENTS

#if TANGENTS
#define WITH_TANGENTS , const tangent* d
#else
#define WITH_TANGENTS
#endif

// What the ray sees; with TANGENTS the derivatives of that, d being those of the ray.
AI void look(const ray* r, SCENE WITH_TANGENTS, view* seen) {
  vf nearest = INFINITY;
  UNROLL for (int c = 0; c < CHANNELS; c++) seen->value[c] = background[c];
#if TANGENTS
  UNROLL for (int i = 0; i < TANGENTS * CHANNELS; i++) seen->change[i] = 0.f;
#endif
  seen->missed = (vi)(VLN == 1 ? 1 : -1);
  for (int j = 0; j < plane_count; j++) {
    constant float* p = planes + j * PLANE;
    const vf across = RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
    const vf t = (p[3] - p[12] * (p[0] * r->x + p[1] * r->y + p[2] * r->z)) * across, depth = DEPTH(p, t);
    vf u, v;
    plane_coordinates(r, p, t, &u, &v);
    const vi hit = (t > 0.f) & (depth < nearest) & (u >= -0.5f) & (v >= -0.5f) & (u <= p[13] + 0.5f) & (v <= p[14] + 0.5f);
    const vf cu = CLAMPED(u, 0.f, p[13] - 1e-3f), cv = CLAMPED(v, 0.f, p[14] - 1e-3f);
    const vi iu = TO_VI(cu), iv = TO_VI(cv);
    const int row = as_int(p[15]);
    const vi id = iv * row + iu;
    const look_up picture = texel(texels + as_int(p[16]), id, id + row, cu - TO_VF(iu), cv - TO_VF(iv));
    UNROLL for (int c = 0; c < CHANNELS; c++) seen->value[c] = select(seen->value[c], picture.value[c], hit);
#if TANGENTS
    UNROLL for (int j = 0; j < TANGENTS; j++) {
      const vf dt = -(p[12] * (p[0] * d[j].x + p[1] * d[j].y + p[2] * d[j].z) +
                      t * (p[0] * d[j].L + p[1] * d[j].M + p[2] * d[j].N)) * across;
      const vf x = p[12] * d[j].x + t * d[j].L + dt * r->L, y = p[12] * d[j].y + t * d[j].M + dt * r->M,
               z = p[12] * d[j].z + t * d[j].N + dt * r->N;
      const vf du = p[4] * x + p[5] * y + p[6] * z, dv = p[8] * x + p[9] * y + p[10] * z;
      UNROLL for (int c = 0; c < CHANNELS; c++)
        seen->change[j * CHANNELS + c] = select(seen->change[j * CHANNELS + c], picture.by_u[c] * du + picture.by_v[c] * dv, hit);
    }
#endif
    nearest = select(nearest, depth, hit);
    seen->missed = seen->missed & (VLN == 1 ? !hit : ~hit);
  }
#if HAS_MESHES
  look_at_meshes(r, nearest, seen, texels MESH_ARGUMENTS);
#endif
}
