// Triangle meshes under lights. All lanes of a batch walk the hierarchy together: their rays come from one pixel and lie close.
#if !HAS_MESHES
#define MESHES
#define MESH_ARGUMENTS
#else
#define NODE 8         // low corner (3), next node where the box is missed; high corner (3), leaf: first triangle x 16 + count
#define TRIANGLE 16    // unit normal n (3), n.p; a (3), a0; b (3), b0: weights of the 2nd and 3rd corner a.p + a0, b.p + b0; slack
#define ATTRIBUTES 32  // normals (9) and colours (9) of the corners, texture coordinates (6), material
#define MATERIAL 12    // colour (3), specular, shininess, texture's width and height; row length and first texel (int bits)
#define LIGHT 8        // place or direction (3), squared reference distance (0: a direction), colour (3)
#define AMBIENT 4      // in front of the lights: light from everywhere
#define MESHES                                                                                                    \
  , global const float *restrict nodes, int node_count, global const float *restrict triangles,                   \
      global const float *restrict attributes, global const float *restrict materials, constant float *restrict lights, \
      int light_count
#define MESH_ARGUMENTS , nodes, node_count, triangles, attributes, materials, lights, light_count

typedef struct {
  vf x, y, z, L, M, N;
} line;

typedef struct {
  vf far, u, v;  // distance of the nearest hit so far, weights of the triangle's 2nd and 3rd corner
  vi id, hit;
} mesh_hit;

// Finds the nearest hit closer than h->far, or any where ANY_HIT is set: then lanes with a hit look no further.
AI void meet_meshes(const line* r, int any_hit, mesh_hit* h, global const float* restrict nodes, int node_count,
                    global const float* restrict triangles) {
  const vf ix = RECIP(r->L), iy = RECIP(r->M), iz = RECIP(r->N);
  for (int i = 0; i < node_count;) {
    global const float* n = nodes + i * NODE;
    const vf ax = (n[0] - r->x) * ix, bx = (n[4] - r->x) * ix, ay = (n[1] - r->y) * iy, by = (n[5] - r->y) * iy,
             az = (n[2] - r->z) * iz, bz = (n[6] - r->z) * iz;
    const vf enter = max(max(min(ax, bx), min(ay, by)), min(az, bz));
    const vf leave = min(min(max(ax, bx), max(ay, by)), max(az, bz));
    if (!ANY((enter <= leave) & (leave >= 0.f) & (enter < h->far))) {
      i = as_int(n[3]);
      continue;
    }
    const int leaf = as_int(n[7]);
    for (int k = leaf >> 4; k < (leaf >> 4) + (leaf & 15); k++) {
      global const float* p = triangles + k * TRIANGLE;
      const vf t = (p[3] - (p[0] * r->x + p[1] * r->y + p[2] * r->z)) * RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
      const vf x = r->x + t * r->L, y = r->y + t * r->M, z = r->z + t * r->N;
      const vf u = p[4] * x + p[5] * y + p[6] * z + p[7], v = p[8] * x + p[9] * y + p[10] * z + p[11];
      const float slack = p[12];
      const vi hit = (t > 0.f) & (t < h->far) & (u >= -slack) & (v >= -slack) & (u + v <= 1.f + slack);
      if (!ANY(hit)) continue;
      h->hit |= hit;
      h->far = select(h->far, any_hit ? (vf)(-1.f) : t, hit);
      h->u = select(h->u, u, hit);
      h->v = select(h->v, v, hit);
      h->id = select(h->id, (vi)k, hit);
    }
    i++;
  }
}

#define CORNERS_AT(p, offset, id) \
  (w * GATHER(vf, p, offset, id) + u * GATHER(vf, p, (offset) + 3, id) + v * GATHER(vf, p, (offset) + 6, id))

AI void look_at_meshes(const ray* r, vf nearest, view* seen, global const uint* restrict texels MESHES) {
  const line eye = {r->x, r->y, r->z, r->L, r->M, r->N};
  mesh_hit h = {select(nearest, (vf)(-1.f), r->state != 0), (vf)0.f, (vf)0.f, (vi)0, (vi)0};
  meet_meshes(&eye, 0, &h, nodes, node_count, triangles);
  if (!ANY(h.hit)) return;
  const vf u = h.u, v = h.v, w = 1.f - u - v, t = select((vf)0.f, h.far, h.hit);
  const vi of_corner = h.id * ATTRIBUTES, plane = h.id * TRIANGLE;

  // Both normals towards the viewer.
  vf gx = GATHER(vf, triangles, 0, plane), gy = GATHER(vf, triangles, 1, plane), gz = GATHER(vf, triangles, 2, plane);
  const vf side = select((vf)1.f, (vf)(-1.f), gx * eye.L + gy * eye.M + gz * eye.N > 0.f);
  gx *= side;
  gy *= side;
  gz *= side;
  vf nx = CORNERS_AT(attributes, 0, of_corner), ny = CORNERS_AT(attributes, 1, of_corner), nz = CORNERS_AT(attributes, 2, of_corner);
  const vf length = rsqrt(AT_LEAST(1e-20f, nx * nx + ny * ny + nz * nz)) *
                    select((vf)1.f, (vf)(-1.f), nx * gx + ny * gy + nz * gz < 0.f);
  nx *= length;
  ny *= length;
  nz *= length;

  const vi material = AS_VI(GATHER(vf, attributes, 24, of_corner)) * MATERIAL;
  const vf width = GATHER(vf, materials, 5, material), height = GATHER(vf, materials, 6, material);
  vf tu = w * GATHER(vf, attributes, 18, of_corner) + u * GATHER(vf, attributes, 20, of_corner) + v * GATHER(vf, attributes, 22, of_corner);
  vf tv = w * GATHER(vf, attributes, 19, of_corner) + u * GATHER(vf, attributes, 21, of_corner) + v * GATHER(vf, attributes, 23, of_corner);
  tu = (tu - floor(tu)) * width - 0.5f;
  tv = (1.f - (tv - floor(tv))) * height - 0.5f;
  const vf cu = CLAMPED(tu, 0.f, width - 1.001f), cv = CLAMPED(tv, 0.f, height - 1.001f);
  const vi iu = TO_VI(cu), iv = TO_VI(cv), row = AS_VI(GATHER(vf, materials, 7, material));
  const vi id = AS_VI(GATHER(vf, materials, 8, material)) + iv * row + iu;
  vf surface[CHANNELS];
  const look_up picture = texel(texels, id, id + row, cu - TO_VF(iu), cv - TO_VF(iv));
  UNROLL for (int c = 0; c < CHANNELS; c++)
    surface[c] = picture.value[c] * GATHER(vf, materials, c, material) * CORNERS_AT(attributes, 9 + c, of_corner);
  const vf specular = GATHER(vf, materials, 3, material), shininess = GATHER(vf, materials, 4, material);

  const float rounding_mm = 1e-3f, rounding = 1e-5f;  // off the surface, so that it does not shade itself
  const vf off = rounding * t + rounding_mm;
  line to_light = {eye.x + t * eye.L + off * gx, eye.y + t * eye.M + off * gy, eye.z + t * eye.N + off * gz};
  const vf nd = nx * eye.L + ny * eye.M + nz * eye.N;
  const vf mirror_x = eye.L - 2.f * nd * nx, mirror_y = eye.M - 2.f * nd * ny, mirror_z = eye.N - 2.f * nd * nz;
  vf light[CHANNELS], shine[CHANNELS];
  UNROLL for (int c = 0; c < CHANNELS; c++) {
    light[c] = lights[c];
    shine[c] = 0.f;
  }
  for (int j = 0; j < light_count; j++) {
    constant float* lamp = lights + AMBIENT + j * LIGHT;
    vf strength = 1.f, far = INFINITY;
    if (lamp[3] > 0.f) {
      to_light.L = lamp[0] - to_light.x;
      to_light.M = lamp[1] - to_light.y;
      to_light.N = lamp[2] - to_light.z;
      const vf square = to_light.L * to_light.L + to_light.M * to_light.M + to_light.N * to_light.N, scale = rsqrt(square);
      to_light.L *= scale;
      to_light.M *= scale;
      to_light.N *= scale;
      strength = lamp[3] * RECIP(square);
      far = square * scale;
    } else {
      to_light.L = lamp[0];
      to_light.M = lamp[1];
      to_light.N = lamp[2];
    }
    const vf cosine = nx * to_light.L + ny * to_light.M + nz * to_light.N;
    const vi faces = h.hit & (cosine > 0.f) & (gx * to_light.L + gy * to_light.M + gz * to_light.N > 0.f);
    mesh_hit shade = {select((vf)(-1.f), far, faces), (vf)0.f, (vf)0.f, (vi)0, (vi)0};
    if (!ANY(faces)) continue;
    meet_meshes(&to_light, 1, &shade, nodes, node_count, triangles);
    strength = select((vf)0.f, strength, faces & (shade.hit == 0));
    const vf along = AT_LEAST(1e-6f, mirror_x * to_light.L + mirror_y * to_light.M + mirror_z * to_light.N);
    const vf highlight = specular * exp2(shininess * log2(along)) * strength;
    UNROLL for (int c = 0; c < CHANNELS; c++) {
      light[c] += lamp[4 + c] * strength * cosine;
      shine[c] += lamp[4 + c] * highlight;
    }
  }
  UNROLL for (int c = 0; c < CHANNELS; c++)
    seen->value[c] = select(seen->value[c], surface[c] * light[c] + shine[c], h.hit);
  seen->missed = seen->missed & (h.hit == 0);
}
#endif
