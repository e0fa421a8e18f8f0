#include "raytrace/device/image_change.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "raytrace/retina/pupil_polynomial.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int floats_a_plane = 20;  // PLANE in kernels/scene.cl
constexpr double largest_relative_error = 0.005;
/// Rays are checked in rounds, until enough have fallen on each plane.
constexpr int rays_a_round = 128, most_rounds = 32, enough_rays = 16;
constexpr const char* derivative_remedy = "use a smaller pupil, or a place nearer the eye's axis";

/// What is tried: degree over the pupil, nodes across the field.
constexpr std::array<std::array<int, 2>, 4> polynomial_sizes{{{3, 3}, {3, 5}, {5, 7}, {7, 9}}};

/// Exact rays out of an eye whose stop does not cut, or out of a part of it.
class OpenEye {
 public:
  OpenEye(EyeModel eye, const std::vector<double>& wavelength_nm) {
    eye.set_stop_diameter(1e3);
    for (const double wavelength : wavelength_nm) tracers_.emplace_back(eye, wavelength);
  }
  Ray operator()(const Ray& ray, int wave) const {
    const auto end = tracers_[wave].trace_end(ray);
    if (end.state != RayState::reached)
      throw unsupported_error("a derivative image: rays are lost on the way out of the eye",
                              derivative_remedy);
    return {end.position_mm, end.direction};
  }

 private:
  std::vector<ExactTracer> tracers_;
};

/// Rays from the retina through the pupil as the picture sends them.
class Aimed {
 public:
  Aimed(const EyeModel& eye, const RetinalGrid& grid, const std::vector<double>& wavelength_nm, int threads)
      : eye_(eye),
        aim_(eye, grid, wavelength_nm.size() > 1 ? eye.reference_wavelength_nm : wavelength_nm[0], threads) {}
  Ray operator()(const Eigen::Vector2d& at, const Eigen::Vector2d& disc) const {
    return aimed_ray(retina_point(eye_, at.x(), at.y()).position_mm, aim_.plane_z_mm(),
                     aim_.at(at.x(), at.y()), disc);
  }

 private:
  EyeModel eye_;
  PupilAim aim_;
};

bool same(const EyeModel& eye, const EyeModel& other, std::size_t k,
          const std::vector<double>& wavelength_nm) {
  const Surface &a = eye.surfaces[k], &b = other.surfaces[k];
  if (a.shape != b.shape || a.position_mm != b.position_mm || a.decentre_mm != b.decentre_mm ||
      a.tilt_deg != b.tilt_deg || a.stop_diameter_mm != b.stop_diameter_mm ||
      a.medium_after != b.medium_after)
    return false;
  if (a.medium_after.empty()) return true;
  const Medium &m = eye.medium(a.medium_after), &n = other.medium(b.medium_after);
  return !m.gradient && !n.gradient &&
         std::all_of(wavelength_nm.begin(), wavelength_nm.end(), [&](double wavelength) {
           return m.index_at(wavelength, eye.reference_wavelength_nm) ==
                  n.index_at(wavelength, other.reference_wavelength_nm);
         });
}

/// Where only what stands in front of the eye differs, a spectacle: the first surface that all share; else 0.
std::size_t first_shared_surface(const std::vector<EyeTangent>& tangents,
                                 const std::vector<double>& wavelength_nm) {
  const EyeModel& one = tangents.front().ahead;
  std::size_t first = one.surfaces.size();
  const auto shared_by = [&](const EyeModel& other, std::size_t k) {
    return other.surfaces.size() == one.surfaces.size() && same(one, other, k, wavelength_nm);
  };
  while (first > 0 && std::all_of(tangents.begin(), tangents.end(), [&](const EyeTangent& tangent) {
           return shared_by(tangent.ahead, first - 1) && shared_by(tangent.behind, first - 1);
         }))
    --first;
  constexpr double clear_of_the_eye_mm = 5;
  const auto in_front = [&] { return one.surfaces.begin() + static_cast<std::ptrdiff_t>(first); };
  const bool separate =
      first > 0 && first < one.surfaces.size() && one.surfaces[first - 1].medium_after == "air" &&
      one.surfaces[first].position_mm - one.surfaces[first - 1].position_mm > clear_of_the_eye_mm &&
      std::any_of(in_front(), one.surfaces.end(), [](const Surface& s) { return s.is_stop(); });
  return separate ? first : 0;
}

/// The change of texture coordinates per unit of each parameter: planes outermost, then parameters, then u
/// and v.
class Change {
 public:
  Change(const std::vector<EyeTangent>& tangents, const DeviceScene& scene, const RetinalGrid& grid,
         const std::vector<double>& wavelength_nm, int threads)
      : planes_(scene.planes) {
    const std::size_t shared = first_shared_surface(tangents, wavelength_nm);
    const auto cut = static_cast<std::ptrdiff_t>(shared);
    if (shared > 0) {
      EyeModel bare = tangents.front().ahead;
      bare.surfaces.erase(bare.surfaces.begin(), bare.surfaces.begin() + cut);
      aims_.emplace_back(bare, grid, wavelength_nm, threads);
      bare_.emplace(bare, wavelength_nm);
    }
    for (const auto& tangent : tangents)
      for (EyeModel eye : {tangent.ahead, tangent.behind}) {
        if (shared >
            0) {  // what stands in front of the eye, with a plane where that begins in place of a retina
          Surface end;
          end.name = "eye";
          end.shape = make_plane();
          end.position_mm = eye.surfaces[shared].position_mm;
          eye.surfaces.erase(eye.surfaces.begin() + cut, eye.surfaces.end());
          eye.surfaces.push_back(end);
        } else {
          aims_.emplace_back(eye, grid, wavelength_nm, threads);
        }
        eyes_.emplace_back(eye, wavelength_nm);
        steps_.push_back(tangent.step);
      }
  }

  Eigen::Index outputs() const {
    return static_cast<Eigen::Index>(planes_.size() / floats_a_plane * eyes_.size());
  }

  Eigen::VectorXd operator()(const Eigen::Vector2d& at, const Eigen::Vector2d& disc, int wave) const {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(outputs());
    const auto eyes = static_cast<Eigen::Index>(eyes_.size());
    std::optional<Ray> before;
    if (bare_) before = (*bare_)(aims_.front()(at, disc), wave);
    for (Eigen::Index i = 0; i < eyes; ++i) {
      const Ray out = eyes_[i](before ? *before : aims_[i](at, disc), wave);
      const double weight = (i % 2 == 0 ? 1 : -1) / steps_[i];
      for (Eigen::Index plane = 0; plane * eyes < result.size(); ++plane)
        result.segment<2>(plane * eyes + i / 2 * 2) += weight * meeting(out, plane).head<2>();
    }
    return result;
  }

  /// Of each output, whether the ray falls on its plane.
  Eigen::Array<bool, Eigen::Dynamic, 1> seen(const Eigen::Vector2d& at, const Eigen::Vector2d& disc,
                                             int wave) const {
    const Ray aimed = aims_.front()(at, disc);
    const Ray out = eyes_.front()(bare_ ? (*bare_)(aimed, wave) : aimed, wave);
    Eigen::Array<bool, Eigen::Dynamic, 1> result(outputs());
    const auto eyes = static_cast<Eigen::Index>(eyes_.size());
    for (Eigen::Index plane = 0; plane * eyes < result.size(); ++plane)
      result.segment(plane * eyes, eyes).setConstant(falls_on(out, plane));
    return result;
  }

 private:
  /// Texture coordinates where the ray meets a plane, and how far along it that is.
  Eigen::Vector3d meeting(const Ray& ray, Eigen::Index plane) const {
    using Plane = Eigen::Matrix<float, floats_a_plane, 1>;
    const Eigen::Matrix<double, floats_a_plane, 1> p =
        Eigen::Map<const Plane>(&planes_[plane * floats_a_plane]).cast<double>();
    const Eigen::Vector3d from = p[12] * ray.origin;
    const double t = (p[3] - p.head<3>().dot(from)) / p.head<3>().dot(ray.direction);
    const Eigen::Vector3d hit = from + t * ray.direction;
    return {p.segment<3>(4).dot(hit) + p[7], p.segment<3>(8).dot(hit) + p[11], t};
  }
  bool falls_on(const Ray& ray, Eigen::Index plane) const {
    const Eigen::Vector3d met = meeting(ray, plane);
    const float* last_texel = &planes_[plane * floats_a_plane + 13];
    return met.z() > 0 && met.x() >= -0.5 && met.y() >= -0.5 && met.x() <= last_texel[0] + 0.5 &&
           met.y() <= last_texel[1] + 0.5;
  }

  const std::vector<float>& planes_;
  std::optional<OpenEye> bare_;  ///< of an eye whose spectacle alone changes
  std::vector<Aimed> aims_;      ///< of that one, or of every eye
  std::vector<OpenEye> eyes_;    ///< ahead and behind in turn
  std::vector<double> steps_;
};

/// Dispersion is nearly linear in this.
double number_of(double wavelength_nm) { return std::pow(500 / wavelength_nm, 2) - 1; }

/// Coefficients of every node of the field, nodes rising in x within those of a y: for each output the
/// polynomial's, and with several wavelengths those of what is added per unit of the wavelength's number.
struct Table {
  int degree, nodes;
  Eigen::Index rows;             ///< of an output
  Eigen::MatrixXd coefficients;  ///< a column a node
  Eigen::VectorXd at(const Place& x, const Place& y) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(coefficients.rows());
    for (int j = 0; j < nodes; ++j)
      for (int i = 0; i < nodes; ++i) sum += x.weights[i] * y.weights[j] * coefficients.col(j * nodes + i);
    return sum;
  }
};

Table fit(const Change& change, const RetinalGrid& grid, const std::vector<double>& wavelength_nm, int degree,
          int nodes, int threads) {
  const auto disc = disc_points(degree + 2, 2 * degree + 4);
  const auto terms = static_cast<Eigen::Index>((degree + 1) * (degree + 2) / 2);
  std::vector<int> waves{0};
  if (wavelength_nm.size() > 1)
    waves = {0, static_cast<int>(wavelength_nm.size()) / 2, static_cast<int>(wavelength_nm.size()) - 1};
  const Eigen::Index sets = waves.size() > 1 ? 2 : 1;
  Eigen::MatrixXd design(disc.size() * waves.size(), sets * terms);
  for (std::size_t w = 0; w < waves.size(); ++w)
    for (std::size_t i = 0; i < disc.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(w * disc.size() + i);
      design.row(row).head(terms) = powers(disc[i], degree);
      if (sets > 1)
        design.row(row).tail(terms) = number_of(wavelength_nm[waves[w]]) * powers(disc[i], degree);
    }
  const Eigen::HouseholderQR<Eigen::MatrixXd> solver(design);
  const auto places = chebyshev_nodes(nodes);
  Table table{degree, nodes, sets * terms, Eigen::MatrixXd(change.outputs() * sets * terms, nodes * nodes)};
  on_threads(threads, static_cast<std::size_t>(nodes) * nodes, [&](std::size_t node) {
    const Eigen::Vector2d at =
        field_point(grid, (places[node % nodes] + 1) / 2, (places[node / nodes] + 1) / 2);
    Eigen::MatrixXd values(design.rows(), change.outputs());
    for (std::size_t w = 0; w < waves.size(); ++w)
      for (std::size_t i = 0; i < disc.size(); ++i)
        values.row(static_cast<Eigen::Index>(w * disc.size() + i)) = change(at, disc[i], waves[w]);
    const Eigen::MatrixXd solution = solver.solve(values);
    table.coefficients.col(static_cast<Eigen::Index>(node)) =
        Eigen::Map<const Eigen::VectorXd>(solution.data(), solution.size());
  });
  return table;
}

/// A ray at random, exactly traced.
struct CheckedRay {
  double share_x, share_y;  ///< of the field
  Eigen::Vector2d disc;
  int wave;
  Eigen::Array<bool, Eigen::Dynamic, 1> seen;  ///< of each output, whether the ray falls on its plane
  Eigen::VectorXd exact = {};                  ///< outputs
};

CheckedRay random_ray(const Change& change, const RetinalGrid& grid, std::size_t waves, unsigned number) {
  std::mt19937 random(number + 1);
  const auto unit = [&] { return random() / 4294967296.0; };
  const double share_x = unit(), share_y = unit(), radius = std::sqrt(unit()), angle = 2 * M_PI * unit();
  const Eigen::Vector2d disc(radius * std::cos(angle), radius * std::sin(angle));
  const int wave = static_cast<int>(unit() * static_cast<double>(waves));
  return {share_x, share_y, disc, wave, change.seen(field_point(grid, share_x, share_y), disc, wave)};
}

/// Those of the first round, and of the others those on whose planes few had fallen.
std::vector<CheckedRay> rays_to_check(const Change& change, const RetinalGrid& grid, std::size_t waves,
                                      int threads) {
  std::vector<CheckedRay> kept;
  Eigen::ArrayXi hits = Eigen::ArrayXi::Zero(change.outputs());
  for (int round = 0; round < most_rounds && (round == 0 || (hits < enough_rays).any()); ++round) {
    std::vector<CheckedRay> rays(rays_a_round);
    on_threads(threads, rays.size(), [&](std::size_t i) {
      rays[i] = random_ray(change, grid, waves, static_cast<unsigned>(round * rays_a_round + i));
    });
    for (CheckedRay& ray : rays) {
      if (round > 0 && !(ray.seen && hits < enough_rays).any()) continue;
      hits += ray.seen.cast<int>();
      kept.push_back(std::move(ray));
    }
  }
  on_threads(threads, kept.size(), [&](std::size_t i) {
    CheckedRay& ray = kept[i];
    ray.exact = change(field_point(grid, ray.share_x, ray.share_y), ray.disc, ray.wave);
  });
  return kept;
}

/// Of planes that no ray falls on (edge on beside the field, behind the eye) polynomials need not hold. What falls
/// there between the checked rays finds no change, rather than whatever they would make of it.
void leave_unseen(Table& table, const std::vector<CheckedRay>& rays) {
  for (Eigen::Index k = 0; k < rays.front().seen.size(); ++k)
    if (std::none_of(rays.begin(), rays.end(), [&](const CheckedRay& ray) { return ray.seen[k]; }))
      table.coefficients.middleRows(k * table.rows, table.rows).setZero();
}

/// The largest of the outputs' rms errors, as a share of their rms changes, both over the rays that fall on the
/// output's plane.
double relative_error(const Table& table, const std::vector<CheckedRay>& rays,
                      const std::vector<double>& wavelength_nm, int threads) {
  const Eigen::Index sets = wavelength_nm.size() > 1 ? 2 : 1, terms = table.rows / sets,
                     outputs = rays.front().seen.size();
  Eigen::MatrixXd errors = Eigen::MatrixXd::Zero(outputs, static_cast<Eigen::Index>(rays.size())),
                  values = errors;
  on_threads(threads, rays.size(), [&](std::size_t i) {
    const CheckedRay& ray = rays[i];
    const Eigen::VectorXd coefficients = table.at(place_of(ray.share_x, table.nodes, 1),
                                                  place_of(ray.share_y, table.nodes, 1)),
                          power = powers(ray.disc, table.degree);
    const auto column = static_cast<Eigen::Index>(i);
    for (Eigen::Index k = 0; k < outputs; ++k) {
      if (!ray.seen[k]) continue;
      values(k, column) = ray.exact[k];
      double value = coefficients.segment(k * table.rows, terms).dot(power);
      if (sets > 1)
        value += number_of(wavelength_nm[ray.wave]) *
                 coefficients.segment(k * table.rows + terms, terms).dot(power);
      errors(k, column) = value - ray.exact[k];
    }
  });
  // u and v together: either may stand still
  double largest = 0;
  for (Eigen::Index k = 0; k < outputs; k += 2) {
    const double error = errors.middleRows(k, 2).norm() / std::max(1e-12, values.middleRows(k, 2).norm());
    if (!std::isfinite(error)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, error);
  }
  return largest;
}

}  // namespace

ImageChange make_image_change(const std::vector<EyeTangent>& tangents, const DeviceScene& scene,
                              const RetinalGrid& grid,
                              const std::array<double, wavelength_count>& wavelength_nm, int threads) {
  std::vector<double> wavelengths(wavelength_nm.begin(), wavelength_nm.end());
  wavelengths.erase(std::unique(wavelengths.begin(), wavelengths.end()), wavelengths.end());
  const Change change(tangents, scene, grid, wavelengths, threads);
  const std::vector<CheckedRay> rays = rays_to_check(change, grid, wavelengths.size(), threads);
  double error = 0;
  for (const auto& size : polynomial_sizes) {
    const int degree = size[0], nodes = size[1];
    Table table = fit(change, grid, wavelengths, degree, nodes, threads);
    leave_unseen(table, rays);
    error = relative_error(table, rays, wavelengths, threads);
    if (!(error <= largest_relative_error)) continue;
    ImageChange result;
    result.degree = degree;
    result.floats_a_pixel = static_cast<int>(table.coefficients.rows());
    for (const double wavelength : wavelength_nm)
      result.by_wave.push_back(static_cast<float>(number_of(wavelength)));
    result.values.resize(static_cast<std::size_t>(result.floats_a_pixel) * grid.width * grid.height);
    Eigen::MatrixXf across(nodes, grid.width);
    for (int column = 0; column < grid.width; ++column)
      across.col(column) = place_of((column + 0.5) / grid.width, nodes, 1).weights.cast<float>();
    const Eigen::MatrixXf coefficients = table.coefficients.cast<float>();
    on_threads(threads, grid.height, [&](std::size_t row) {
      const Eigen::VectorXf weights =
          place_of((static_cast<double>(row) + 0.5) / grid.height, nodes, 1).weights.cast<float>();
      Eigen::MatrixXf of_row = Eigen::MatrixXf::Zero(coefficients.rows(), nodes);
      for (int j = 0; j < nodes; ++j)
        of_row += weights[j] * coefficients.middleCols(Eigen::Index{j} * nodes, nodes);
      Eigen::Map<Eigen::MatrixXf>(result.values.data() + row * grid.width * result.floats_a_pixel,
                                  coefficients.rows(), grid.width)
          .noalias() = of_row * across;
    });
    return result;
  }
  throw unsupported_error(
      fmt::format(
          "a derivative image: its polynomials miss exactly traced rays by {:.2g} %: part of the field "
          "sees the scene past an edge within the eye, or a plane edge on",
          100 * error),
      derivative_remedy);
}

}  // namespace emmetrope::raytrace
