// The fast map: what leaves the eye as polynomials of where the ray is aimed at, made and checked in
// fast_map.cpp.
#if FAST
// A pixel's polynomials have OUTPUTS_OF_MAP values (x, y on the plane z = map_z, slopes L/N and M/N, squared
// radius at the stop over that of the stop), each of MAP_TERMS terms; x^i y^j with i rising, for j =
// 0..DEGREE.
#define OUTPUTS_OF_MAP 5
#define MAP_TERMS ((DEGREE + 1) * (DEGREE + 2) / 2)
#define MAP_FLOATS ((OUTPUTS_OF_MAP * MAP_TERMS + 15) / 16 * 16)
// With lanes for wavelengths every lane has polynomials of its own.
#define MAP_LANES (SPECTRAL && VLN > 1)
#if MAP_LANES
typedef vf coefficient;
#else
typedef float coefficient;
#endif

// A pixel's polynomials from those of its row at NODES places across its tile.
AI void map_of_pixel(coefficient* c, int row, int column, int width, int height, int wave,
                     global const float* restrict rows, global const float* restrict weights) {
  const int tile = (2 * column + 1) * TILES / (2 * width);
  const int stride = MAP_FLOATS * (MAP_LANES ? VLN : 1);
  global const float* nodes =
      rows + ((MAP_LANES ? row : wave * height + row) * TILES + tile) * NODES * stride;
  weights += column * NODES;
#if MAP_LANES
  for (int k = 0; k < OUTPUTS_OF_MAP * MAP_TERMS; k++) {
    vf sum = 0.f;
    for (int i = 0; i < NODES; i++) sum += weights[i] * VLOAD(k, nodes + i * stride);
    c[k] = sum;
  }
#elif VLN > 1
  for (int k = 0; k < MAP_FLOATS / VLN; k++) {
    vf sum = 0.f;
    for (int i = 0; i < NODES; i++) sum += weights[i] * VLOAD(k, nodes + i * stride);
    VSTORE(sum, k, c);
  }
#else
  for (int k = 0; k < OUTPUTS_OF_MAP * MAP_TERMS; k++) {
    float sum = 0.f;
    for (int i = 0; i < NODES; i++) sum += weights[i] * nodes[i * stride + k];
    c[k] = sum;
  }
#endif
}

AI vf map_value(const coefficient* c, vf x, vf y) {
  vf value = 0.f;
  int first = MAP_TERMS;
  UNROLL
  for (int j = DEGREE; j >= 0; j--) {
    first -= DEGREE - j + 1;
    vf row = c[first + DEGREE - j];
    UNROLL
    for (int i = DEGREE - j - 1; i >= 0; i--) row = row * x + c[first + i];
    value = value * y + row;
  }
  return value;
}

// The ray behind the operations that the map stands for, from a place of the disc.
AI void start_by_map(ray* r, vf at_x, vf at_y, const coefficient* c, float map_z) {
  r->x = map_value(c, at_x, at_y);
  r->y = map_value(c + MAP_TERMS, at_x, at_y);
  r->z = map_z;
  r->L = map_value(c + 2 * MAP_TERMS, at_x, at_y);
  r->M = map_value(c + 3 * MAP_TERMS, at_x, at_y);
  r->N = rsqrt(1.f + r->L * r->L + r->M * r->M);
  r->L *= r->N;
  r->M *= r->N;
  r->state = select((vi)0, (vi)VIGNETTED, map_value(c + 4 * MAP_TERMS, at_x, at_y) > 1.f);
}
#endif
