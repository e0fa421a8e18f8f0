#include "raytrace/device/fast_map.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "raytrace/device/device_rays.hpp"
#include "raytrace/retina/pupil_polynomial.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int random_rays = 10'000;
constexpr double largest_arcmin = 0.01, largest_rms_arcmin = 0.003, largest_position_um = 1;
constexpr double arcmin = degree / 60;

/// What is tried, the fastest first: degree, nodes, tiles.
constexpr std::array<std::array<int, 3>, 5> map_sizes{
    {{5, 8, 1}, {7, 8, 1}, {9, 8, 1}, {9, 8, 3}, {11, 10, 4}}};

/// The system at one of its wavelengths, its stop wide open.
OpticalSystem opened_at(OpticalSystem system, int wave, int stop) {
  for (std::size_t k = 0; k < system.kinds.size(); ++k)
    std::fill_n(system.ratios.begin() + static_cast<std::ptrdiff_t>(k * wavelength_count), wavelength_count,
                system.ratios[k * wavelength_count + wave]);
  for (std::size_t g = OpticalSystem::gradient_shifts; g < system.gradients.size();
       g += OpticalSystem::gradient_floats)
    std::fill_n(system.gradients.begin() + static_cast<std::ptrdiff_t>(g), wavelength_count,
                system.gradients[g + wave]);
  system.operations[static_cast<std::size_t>(stop) * OpticalSystem::parameters + 3] = 1e8F;
  return system;
}

class Fit {
 public:
  Fit(OpenCl& cl, const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim,
      const OpticalSystem& system, int stop)
      : cl_(cl), eye_(eye), grid_(grid), aim_(aim), system_(system), stop_(stop) {}

  FastMap operator()(const std::array<int, 3>& size, int waves) const {
    FastMap map;
    map.degree = size[0];
    map.nodes = size[1];
    map.tiles = size[2];
    const auto disc = disc_points(2 * map.degree + 4, 4 * map.degree + 4);
    Eigen::MatrixXd design(disc.size(), map.terms());
    for (std::size_t i = 0; i < disc.size(); ++i) design.row(i) = powers(disc[i], map.degree);
    const Eigen::HouseholderQR<Eigen::MatrixXd> solver(design);

    const std::vector<float> in = rays(map, disc);
    for (int wave = 0; wave < waves; ++wave) {
      const OpticalSystem open = opened_at(system_, wave, stop_);
      const SystemBuffers buffers(cl_, open);
      const auto at_stop = trace_rays(cl_, open, buffers, in, stop_ + 1);
      const auto behind = trace_rays(cl_, open, buffers, in, static_cast<int>(open.kinds.size()));
      const std::size_t count = behind.size() / 7;
      if (wave == 0)
        for (std::size_t i = 0; i < count; ++i)
          map.plane_z_mm += static_cast<double>(behind[2 * count + i]) / static_cast<double>(count);
      map.plane_z_mm = static_cast<float>(map.plane_z_mm);
      map.tables.push_back(table(map, solver, disc.size(), at_stop, behind));
    }
    return map;
  }

 private:
  /// Every disc point from every node of every tile.
  std::vector<float> rays(const FastMap& map, const std::vector<Eigen::Vector2d>& disc) const {
    const auto nodes = chebyshev_nodes(map.nodes);
    const int side = map.nodes * map.tiles;
    const std::size_t count = disc.size() * side * side;
    std::vector<float> in(6 * count);
    std::size_t ray = 0;
    for (int q = 0; q < map.tiles; ++q)
      for (int p = 0; p < map.tiles; ++p)
        for (int j = 0; j < map.nodes; ++j)
          for (int i = 0; i < map.nodes; ++i) {
            const auto share = [&](int tile, double node) { return (tile + (node + 1) / 2) / map.tiles; };
            const Eigen::Vector2d at = field_point(grid_, share(p, nodes[i]), share(q, nodes[j]));
            const AimEllipse ellipse = aim_.at(at.x(), at.y());
            const Eigen::Vector3d retina = retina_point(eye_, at.x(), at.y()).position_mm;
            for (const auto& point : disc) {
              const Ray r = aimed_ray(retina, aim_.plane_z_mm(), ellipse, point);
              for (int c = 0; c < 3; ++c) {
                in[c * count + ray] = static_cast<float>(r.origin[c]);
                in[(3 + c) * count + ray] = static_cast<float>(r.direction[c]);
              }
              ++ray;
            }
          }
    return in;
  }

  std::vector<double> table(const FastMap& map, const Eigen::HouseholderQR<Eigen::MatrixXd>& solver,
                            std::size_t points, const std::vector<float>& at_stop,
                            const std::vector<float>& behind) const {
    const std::size_t count = behind.size() / 7, places = count / points;
    const float* stop = &system_.operations[static_cast<std::size_t>(stop_) * OpticalSystem::parameters];
    std::vector<double> result;
    Eigen::MatrixXd values(points, FastMap::outputs);
    for (std::size_t place = 0; place < places; ++place) {
      for (std::size_t i = 0; i < points; ++i) {
        const std::size_t k = place * points + i;
        const auto value = [&](const std::vector<float>& rays, int plane) -> double {
          return rays[plane * count + k];
        };
        if (behind[6 * count + k] != 0)
          throw unsupported_error(
              "--surfaces fast: rays from the field to the stop are lost on the way out of the eye",
              "use a smaller --pupil or --field-mm, or another --surfaces");
        const double l = value(behind, 3) / value(behind, 5), m = value(behind, 4) / value(behind, 5),
                     t = map.plane_z_mm - value(behind, 2), x = value(at_stop, 0) - stop[0],
                     y = value(at_stop, 1) - stop[1];
        values.row(i) << value(behind, 0) + t * l, value(behind, 1) + t * m, l, m, (x * x + y * y) / stop[3];
      }
      const Eigen::MatrixXd coefficients = solver.solve(values);
      result.insert(result.end(), coefficients.data(), coefficients.data() + coefficients.size());
    }
    return result;
  }

  OpenCl& cl_;
  const EyeModel& eye_;
  const RetinalGrid& grid_;
  const PupilAim& aim_;
  const OpticalSystem& system_;
  int stop_;
};

/// Random rays that leave the eye, exactly traced.
struct Truth {
  Eigen::Vector2d share;  ///< of the field
  Eigen::Vector2d disc;
  int wave = 0;
  Eigen::Vector3d position_mm, direction;
};

std::vector<Truth> exact_rays(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim,
                              const std::vector<double>& wavelength_nm, std::uint64_t seed, int threads) {
  std::vector<ExactTracer> tracers;
  for (const double wavelength : wavelength_nm) tracers.emplace_back(eye, wavelength);
  std::vector<std::vector<Truth>> found(16);  // the same rays whatever the number of threads
  on_threads(threads, found.size(), [&](std::size_t thread) {
    std::mt19937_64 random(seed * 1000003 + thread);
    const auto unit = [&] { return static_cast<double>(random() >> 11U) / 9007199254740992.0; };
    const int wanted = random_rays / static_cast<int>(found.size()) + 1;
    for (int tries = 0; static_cast<int>(found[thread].size()) < wanted && tries < 4 * wanted; ++tries) {
      Truth truth;
      truth.share = {unit(), unit()};
      const double radius = std::sqrt(unit()), angle = 2 * pi * unit();
      truth.disc = {radius * std::cos(angle), radius * std::sin(angle)};
      truth.wave = static_cast<int>(unit() * static_cast<double>(tracers.size()));
      const Eigen::Vector2d at = field_point(grid, truth.share.x(), truth.share.y());
      const auto end =
          tracers[truth.wave].trace_end(aimed_ray(retina_point(eye, at.x(), at.y()).position_mm,
                                                  aim.plane_z_mm(), aim.at(at.x(), at.y()), truth.disc));
      if (end.state != RayState::reached) continue;
      truth.position_mm = end.position_mm;
      truth.direction = end.direction;
      found[thread].push_back(truth);
    }
  });
  std::vector<Truth> result;
  for (const auto& part : found) result.insert(result.end(), part.begin(), part.end());
  return result;
}

void measure(FastMap& map, const std::vector<Truth>& rays) {
  const int terms = map.terms(), floats = FastMap::outputs * terms;
  double square = 0;
  for (const Truth& truth : rays) {
    const Place x = place_of(truth.share.x(), map.nodes, map.tiles),
                y = place_of(truth.share.y(), map.nodes, map.tiles);
    const double* table =
        map.tables[truth.wave].data() +
        static_cast<std::ptrdiff_t>((y.tile * map.tiles + x.tile) * map.nodes * map.nodes) * floats;
    Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(floats);
    for (int j = 0; j < map.nodes; ++j)
      for (int i = 0; i < map.nodes; ++i)
        coefficients += x.weights[i] * y.weights[j] *
                        Eigen::Map<const Eigen::VectorXd>(
                            table + static_cast<std::ptrdiff_t>(j * map.nodes + i) * floats, floats);
    // in the precision that the device has
    const Eigen::VectorXf power = powers(truth.disc, map.degree).cast<float>(),
                          c = coefficients.cast<float>();
    const auto value = [&](int output) -> double {
      return c.segment(Eigen::Index{output} * terms, terms).dot(power);
    };
    const Eigen::Vector3d direction = Eigen::Vector3d(value(2), value(3), 1).normalized(),
                          exact = truth.direction;
    const double angle = direction.cross(exact).norm() / arcmin;
    square += angle * angle;
    map.direction_max_arcmin = std::max(map.direction_max_arcmin, angle);
    const Eigen::Vector3d offset = Eigen::Vector3d(value(0), value(1), map.plane_z_mm) - truth.position_mm;
    map.position_max_um = std::max(map.position_max_um, 1000 * (offset - offset.dot(exact) * exact).norm());
  }
  map.direction_rms_arcmin = std::sqrt(square / static_cast<double>(rays.size()));
}

}  // namespace

FastMap make_fast_map(OpenCl& cl, const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim,
                      const OpticalSystem& system, const std::array<double, wavelength_count>& wavelength_nm,
                      std::uint64_t seed, int threads) {
  const auto stop = std::find(system.kinds.begin(), system.kinds.end(), Operation::stop);
  if (stop == system.kinds.end())
    throw unsupported_error("--surfaces fast: the eye has no stop",
                            "add a surface of type stop with diameter_mm");
  std::vector<double> wavelengths(wavelength_nm.begin(), wavelength_nm.end());
  wavelengths.erase(std::unique(wavelengths.begin(), wavelengths.end()), wavelengths.end());
  const auto truth = exact_rays(eye, grid, aim, wavelengths, seed, threads);
  if (static_cast<int>(truth.size()) < random_rays)
    throw unsupported_error("--surfaces fast: too many rays are lost between retina and stop",
                            "use a smaller --field-mm or another --surfaces");
  const Fit fit(cl, eye, grid, aim, system, static_cast<int>(stop - system.kinds.begin()));
  FastMap map;
  for (const auto& size : map_sizes) {
    map = fit(size, static_cast<int>(wavelengths.size()));
    measure(map, truth);
    if (map.direction_max_arcmin <= largest_arcmin && map.direction_rms_arcmin <= largest_rms_arcmin &&
        map.position_max_um <= largest_position_um)
      return map;
  }
  throw unsupported_error(
      fmt::format("--surfaces fast: the map misses one of {} exactly traced rays by {:.3g} arcmin and {:.3g} "
                  "um (rms {:.3g} arcmin), more than {} arcmin and {} um (rms {} arcmin)",
                  truth.size(), map.direction_max_arcmin, map.position_max_um, map.direction_rms_arcmin,
                  largest_arcmin, largest_position_um, largest_rms_arcmin),
      "use a smaller --pupil or --field-mm, or another --surfaces");
}

std::string FastMap::definitions() const {
  return fmt::format(" -DFAST=1 -DDEGREE={} -DNODES={} -DTILES={}", degree, nodes, tiles);
}

std::string FastMap::note() const {
  return fmt::format(
      "fast map of degree {}, {} x {} nodes in {} x {} tiles: rms {:.4f}, at most {:.4f} arcmin and {:.3f} "
      "um from {} exactly traced rays",
      degree, nodes, nodes, tiles, tiles, direction_rms_arcmin, direction_max_arcmin, position_max_um,
      random_rays);
}

std::vector<float> FastMap::rows(int height, int lanes) const {
  const int floats = outputs * terms(), padded = (floats + 15) / 16 * 16;
  const int waves = static_cast<int>(tables.size());
  const bool side_by_side = waves > 1 && lanes > 1;
  std::vector<float> result(static_cast<std::size_t>(waves) * height * tiles * nodes * padded);
  Eigen::VectorXd sum(floats);
  for (int row = 0; row < height; ++row) {
    const Place y = place_of((row + 0.5) / height, nodes, tiles);
    for (int wave = 0; wave < waves; ++wave)
      for (int p = 0; p < tiles; ++p)
        for (int i = 0; i < nodes; ++i) {
          sum.setZero();
          for (int j = 0; j < nodes; ++j)
            sum +=
                y.weights[j] *
                Eigen::Map<const Eigen::VectorXd>(
                    tables[wave].data() +
                        static_cast<std::ptrdiff_t>(((y.tile * tiles + p) * nodes + j) * nodes + i) * floats,
                    floats);
          const std::size_t node =
              (static_cast<std::size_t>(side_by_side ? row : wave * height + row) * tiles + p) * nodes + i;
          for (int k = 0; k < floats; ++k)
            result[side_by_side ? (node * padded + k) * wavelength_count + wave : node * padded + k] =
                static_cast<float>(sum[k]);
        }
  }
  return result;
}

std::vector<float> FastMap::column_weights(int width) const {
  std::vector<float> result;
  for (int column = 0; column < width; ++column) {
    const Place x = place_of((column + 0.5) / width, nodes, tiles);
    for (int i = 0; i < nodes; ++i) result.push_back(static_cast<float>(x.weights[i]));
  }
  return result;
}

}  // namespace emmetrope::raytrace
