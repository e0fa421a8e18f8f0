// Triangle meshes under lights. All lanes of a batch walk the hierarchy together: their rays come from one
// pixel and lie close.
#if !HAS_MESHES
#define MESHES
#define MESH_ARGUMENTS
#else
// Low corner (3), next node where the box is missed; high corner (3), leaf: first triangle x 16 + count.
#define NODE 8
// Unit normal n (3), n.p; a (3), a0; b (3), b0: weights of the 2nd and 3rd corner a.p + a0, b.p + b0; slack.
#define TRIANGLE 16
#define ATTRIBUTES 32  // normals (9) and colours (9) of the corners, texture coordinates (6), material
// Colour (3), specular, shininess, texture's width and height; row length and first texel (int bits).
#define MATERIAL 12
#define LIGHT 8    // place or direction (3), squared reference distance (0: a direction), colour (3)
#define AMBIENT 4  // in front of the lights: light from everywhere
#define MESHES                                                                                  \
  , global const float *restrict nodes, int node_count, global const float *restrict triangles, \
      global const float *restrict attributes, global const float *restrict materials,          \
      constant float *restrict lights, int light_count
#define MESH_ARGUMENTS , nodes, node_count, triangles, attributes, materials, lights, light_count

typedef struct {
  vf x, y, z, L, M, N;
} line;

typedef struct {
  vf far, u, v;  // distance of the nearest hit so far, weights of the triangle's 2nd and 3rd corner
  vi id, hit;
} mesh_hit;

// Finds the nearest hit closer than h->far, or any where ANY_HIT is set: then lanes with a hit look no
// further.
AI void meet_meshes(const line* r, int any_hit, mesh_hit* h, global const float* restrict nodes,
                    int node_count, global const float* restrict triangles) {
  const vf ix = RECIP(r->L), iy = RECIP(r->M), iz = RECIP(r->N);
  for (int i = 0; i < node_count;) {
    global const float* n = nodes + i * NODE;
    const vf ax = (n[0] - r->x) * ix, bx = (n[4] - r->x) * ix, ay = (n[1] - r->y) * iy,
             by = (n[5] - r->y) * iy, az = (n[2] - r->z) * iz, bz = (n[6] - r->z) * iz;
    const vf enter = max(max(min(ax, bx), min(ay, by)), min(az, bz));
    const vf leave = min(min(max(ax, bx), max(ay, by)), max(az, bz));
    if (!ANY((enter <= leave) & (leave >= 0.f) & (enter < h->far))) {
      i = as_int(n[3]);
      continue;
    }
    const int leaf = as_int(n[7]);
    for (int k = leaf >> 4; k < (leaf >> 4) + (leaf & 15); k++) {
      global const float* p = triangles + k * TRIANGLE;
      const vf t =
          (p[3] - (p[0] * r->x + p[1] * r->y + p[2] * r->z)) * RECIP(p[0] * r->L + p[1] * r->M + p[2] * r->N);
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

// Where the eye's ray meets a mesh, and what lies there.
typedef struct {
  vf x, y, z;     // the place, a little off the surface towards the viewer, so that it does not shade itself
  vf gx, gy, gz;  // normal of the triangle, towards the viewer
  vf nx, ny, nz;  // normal between those of the corners, on the same side
  vf mirror_x, mirror_y, mirror_z;  // the direction of mirrored light
  vf colour[CHANNELS], specular, shininess;
} mesh_point;

AI void find_normals(mesh_point* at, const line* eye, vf u, vf v, vf w, vi of_corner, vi plane,
                     global const float* restrict triangles, global const float* restrict attributes) {
  vf gx = GATHER(vf, triangles, 0, plane), gy = GATHER(vf, triangles, 1, plane),
     gz = GATHER(vf, triangles, 2, plane);
  const vf side = select((vf)1.f, (vf)(-1.f), gx * eye->L + gy * eye->M + gz * eye->N > 0.f);
  gx *= side;
  gy *= side;
  gz *= side;
  vf nx = CORNERS_AT(attributes, 0, of_corner), ny = CORNERS_AT(attributes, 1, of_corner),
     nz = CORNERS_AT(attributes, 2, of_corner);
  const vf length = rsqrt(AT_LEAST(1e-20f, nx * nx + ny * ny + nz * nz)) *
                    select((vf)1.f, (vf)(-1.f), nx * gx + ny * gy + nz * gz < 0.f);
  nx *= length;
  ny *= length;
  nz *= length;
  at->gx = gx;
  at->gy = gy;
  at->gz = gz;
  at->nx = nx;
  at->ny = ny;
  at->nz = nz;
}

// What the surface reflects: texture, material and the corners' own colours together.
AI void find_colour(mesh_point* at, vf u, vf v, vf w, vi of_corner, global const uint* restrict texels,
                    global const float* restrict attributes, global const float* restrict materials) {
  const vi material = AS_VI(GATHER(vf, attributes, 24, of_corner)) * MATERIAL;
  const vf width = GATHER(vf, materials, 5, material), height = GATHER(vf, materials, 6, material);
  vf tu = w * GATHER(vf, attributes, 18, of_corner) + u * GATHER(vf, attributes, 20, of_corner) +
          v * GATHER(vf, attributes, 22, of_corner);
  vf tv = w * GATHER(vf, attributes, 19, of_corner) + u * GATHER(vf, attributes, 21, of_corner) +
          v * GATHER(vf, attributes, 23, of_corner);
  tu = (tu - floor(tu)) * width - 0.5f;
  tv = (1.f - (tv - floor(tv))) * height - 0.5f;
  const vf cu = CLAMPED(tu, 0.f, width - 1.001f), cv = CLAMPED(tv, 0.f, height - 1.001f);
  const vi iu = TO_VI(cu), iv = TO_VI(cv), row = AS_VI(GATHER(vf, materials, 7, material));
  const vi id = AS_VI(GATHER(vf, materials, 8, material)) + iv * row + iu;
  const look_up picture = texel(texels, id, id + row, cu - TO_VF(iu), cv - TO_VF(iv));
  UNROLL
  for (int c = 0; c < CHANNELS; c++)
    at->colour[c] =
        picture.value[c] * GATHER(vf, materials, c, material) * CORNERS_AT(attributes, 9 + c, of_corner);
  at->specular = GATHER(vf, materials, 3, material);
  at->shininess = GATHER(vf, materials, 4, material);
}

// Directs a line at a lamp. strength: of its light there; far: its distance.
AI void aim_at_lamp(line* to_light, constant float* restrict lamp, vf* strength, vf* far) {
  *strength = 1.f;
  *far = INFINITY;
  if (lamp[3] > 0.f) {
    to_light->L = lamp[0] - to_light->x;
    to_light->M = lamp[1] - to_light->y;
    to_light->N = lamp[2] - to_light->z;
    const vf square = to_light->L * to_light->L + to_light->M * to_light->M + to_light->N * to_light->N,
             scale = rsqrt(square);
    to_light->L *= scale;
    to_light->M *= scale;
    to_light->N *= scale;
    *strength = lamp[3] * RECIP(square);
    *far = square * scale;
  } else {
    to_light->L = lamp[0];
    to_light->M = lamp[1];
    to_light->N = lamp[2];
  }
}

// The light of all lamps that shine on a point: what falls on it and what is mirrored towards the viewer.
AI void light_up(const mesh_point* at, vi hit, vf* light, vf* shine, global const float* restrict nodes,
                 int node_count, global const float* restrict triangles, constant float* restrict lights,
                 int light_count) {
  line to_light = {at->x, at->y, at->z};
  UNROLL
  for (int c = 0; c < CHANNELS; c++) {
    light[c] = lights[c];
    shine[c] = 0.f;
  }
  for (int j = 0; j < light_count; j++) {
    constant float* lamp = lights + AMBIENT + j * LIGHT;
    vf strength, far;
    aim_at_lamp(&to_light, lamp, &strength, &far);
    const vf cosine = at->nx * to_light.L + at->ny * to_light.M + at->nz * to_light.N;
    const vi faces =
        hit & (cosine > 0.f) & (at->gx * to_light.L + at->gy * to_light.M + at->gz * to_light.N > 0.f);
    mesh_hit shade = {select((vf)(-1.f), far, faces), (vf)0.f, (vf)0.f, (vi)0, (vi)0};
    if (!ANY(faces)) continue;
    meet_meshes(&to_light, 1, &shade, nodes, node_count, triangles);
    strength = select((vf)0.f, strength, faces & (shade.hit == 0));
    const vf along =
        AT_LEAST(1e-6f, at->mirror_x * to_light.L + at->mirror_y * to_light.M + at->mirror_z * to_light.N);
    const vf highlight = at->specular * exp2(at->shininess * log2(along)) * strength;
    UNROLL
    for (int c = 0; c < CHANNELS; c++) {
      light[c] += lamp[4 + c] * strength * cosine;
      shine[c] += lamp[4 + c] * highlight;
    }
  }
}

AI void look_at_meshes(const ray* r, vf nearest, view* seen, global const uint* restrict texels MESHES) {
  const line eye = {r->x, r->y, r->z, r->L, r->M, r->N};
  mesh_hit h = {select(nearest, (vf)(-1.f), r->state != 0), (vf)0.f, (vf)0.f, (vi)0, (vi)0};
  meet_meshes(&eye, 0, &h, nodes, node_count, triangles);
  if (!ANY(h.hit)) return;
  const vf u = h.u, v = h.v, w = 1.f - u - v, t = select((vf)0.f, h.far, h.hit);
  const vi of_corner = h.id * ATTRIBUTES, plane = h.id * TRIANGLE;
  mesh_point at;
  find_normals(&at, &eye, u, v, w, of_corner, plane, triangles, attributes);
  find_colour(&at, u, v, w, of_corner, texels, attributes, materials);
  const float rounding_mm = 1e-3f, rounding = 1e-5f;
  const vf off = rounding * t + rounding_mm;
  at.x = eye.x + t * eye.L + off * at.gx;
  at.y = eye.y + t * eye.M + off * at.gy;
  at.z = eye.z + t * eye.N + off * at.gz;
  const vf nd = at.nx * eye.L + at.ny * eye.M + at.nz * eye.N;
  at.mirror_x = eye.L - 2.f * nd * at.nx;
  at.mirror_y = eye.M - 2.f * nd * at.ny;
  at.mirror_z = eye.N - 2.f * nd * at.nz;
  vf light[CHANNELS], shine[CHANNELS];
  light_up(&at, h.hit, light, shine, nodes, node_count, triangles, lights, light_count);
  UNROLL
  for (int c = 0; c < CHANNELS; c++)
    seen->value[c] = select(seen->value[c], at.colour[c] * light[c] + shine[c], h.hit);
  seen->missed = seen->missed & (h.hit == 0);
}
#endif
