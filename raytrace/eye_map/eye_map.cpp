#include "raytrace/eye_map/eye_map.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "raytrace/retina/pupil_polynomial.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int field_nodes = EyeMap::field_degree + 1;
/// Terms over wavelength and over accommodation that are tried, the fewest first.
constexpr std::array<int, 2> state_nodes{6, 9};
constexpr int disc_rings = 12, disc_spokes = 20;
constexpr double arcmin = degree / 60;
constexpr int checked_states = 24, rays_a_state = 300;
constexpr double largest_arcmin = 0.1, largest_rms_arcmin = 0.02, largest_position_um = 3;
const char* const remedy = "use an eye whose lens is wider than its pupil, or a smaller pupil";

RetinalGrid grid_of(const EyeMapSettings& settings) {
  RetinalGrid grid;
  grid.field_x_mm = grid.field_y_mm = settings.field_mm;
  return grid;
}

double wavelength_at(const EyeMapSettings& settings, double w) {
  const double low = std::pow(settings.longest_nm, -2), high = std::pow(settings.shortest_nm, -2);
  return 1 / std::sqrt(low + (w + 1) / 2 * (high - low));
}

/// T_0 ... T_(count - 1)
VectorXd chebyshev(double x, int count) {
  VectorXd values = VectorXd::Ones(count);
  if (count > 1) values[1] = x;
  for (int i = 2; i < count; ++i) values[i] = 2 * x * values[i - 1] - values[i - 2];
  return values;
}

/// From values at Chebyshev nodes (columns) to coefficients.
MatrixXd coefficients_from_nodes(int count) {
  const auto nodes = chebyshev_nodes(count);
  MatrixXd matrix(count, count);
  for (int i = 0; i < count; ++i) matrix.col(i) = chebyshev(nodes[i], count) * (2.0 / count);
  matrix.row(0) /= 2;
  return matrix;
}

/// Products of Chebyshev polynomials in u and v to a total degree.
VectorXd field_terms(double u, double v, int degree) {
  const VectorXd in_u = chebyshev(u, degree + 1), in_v = chebyshev(v, degree + 1);
  VectorXd values(EyeMap::terms(degree));
  int k = 0;
  for (int j = 0; j <= degree; ++j)
    for (int i = 0; i <= degree - j; ++i) values[k++] = in_u[i] * in_v[j];
  return values;
}

/// One exact ray through one state of the eye.
struct Sample {
  Vector2d stop;  ///< over the widest aperture's radius
  Eigen::Vector4d out;
  std::vector<Vector3d> hits;  ///< the retina's side first, with the stop's
};

/// Exact rays of one state at one wavelength.
class State {
 public:
  State(EyeModel eye, const EyeMapSettings& settings, double wavelength_nm)
      : eye_(with_pupil(std::move(eye), settings.pupil_mm)),
        aim_(eye_, grid_of(settings), wavelength_nm),
        crossing_(eye_, wavelength_nm),
        tracer_(with_pupil(eye_, wide_open_mm), wavelength_nm),
        half_mm_(settings.field_mm / 2) {
    for (auto surface = eye_.surfaces.rbegin() + 1; surface != eye_.surfaces.rend(); ++surface)
      names_.push_back(surface->is_stop() ? "stop" : surface->name);
  }

  const std::vector<std::string>& names() const { return names_; }
  AimEllipse ellipse(double u, double v) const { return aim_.at(u * half_mm_, v * half_mm_); }

  Sample operator()(double u, double v, const AimEllipse& ellipse, const Vector2d& disc,
                    bool with_hits) const {
    const Vector3d retina = retina_point(eye_, u * half_mm_, v * half_mm_).position_mm;
    const Ray ray = aimed_ray(retina, aim_.plane_z_mm(), ellipse, disc);
    const auto stop = crossing_(retina, retina + ray.direction);
    const RayPath path = tracer_.trace(ray);
    if (!stop || path.state != RayState::reached)
      throw unsupported_error("a map of the eye: rays from the retina to the stop are lost on their way out",
                              remedy);
    Sample sample;
    sample.stop = *stop / crossing_.stop_radius_mm();
    const RayHit& last = path.hits.back();
    const Vector2d slope = last.direction.head<2>() / last.direction.z();
    sample.out << last.position_mm.head<2>() - last.position_mm.z() * slope, slope;
    if (with_hits) sample.hits = hits_of(path, *stop);
    return sample;
  }

 private:
  static constexpr double wide_open_mm = 1e3;
  static EyeModel with_pupil(EyeModel eye, double pupil_mm) {
    eye.set_stop_diameter(pupil_mm);
    return eye;
  }

  /// In the order of names_.
  std::vector<Vector3d> hits_of(const RayPath& path, const Vector2d& at_stop) const {
    std::vector<Vector3d> hits;
    for (const std::string& name : names_) {
      const auto hit = std::find_if(path.hits.begin(), path.hits.end(),
                                    [&](const RayHit& one) { return one.surface == name; });
      if (hit != path.hits.end())
        hits.push_back(hit->position_mm);
      else if (name == "stop")
        hits.push_back(eye_.stop()->eye_from_surface() * Vector3d(at_stop.x(), at_stop.y(), 0));
      else  // a nucleus that the ray passes beside: nothing is bent there
        hits.push_back(hits.empty() ? path.hits.front().position_mm : hits.back());
    }
    return hits;
  }

  EyeModel eye_;
  PupilAim aim_;
  StopCrossing crossing_;
  ExactTracer tracer_;
  double half_mm_;
  std::vector<std::string> names_;
};

/// What one state at one wavelength adds to the map: rows are field terms.
struct Tables {
  MatrixXd rays, weights, paths;
};

/// Jacobian of the aim by the place in the stop, at each of the places.
VectorXd jacobians(const std::vector<Vector2d>& places, const VectorXd& x, const VectorXd& y) {
  VectorXd result(places.size());
  for (std::size_t s = 0; s < places.size(); ++s) {
    Eigen::Matrix2d slopes = Eigen::Matrix2d::Zero();
    int k = 0;
    for (int j = 0; j <= EyeMap::pupil_degree; ++j)
      for (int i = 0; i <= EyeMap::pupil_degree - j; ++i, ++k) {
        const double by_x = i == 0 ? 0 : i * std::pow(places[s].x(), i - 1) * std::pow(places[s].y(), j);
        const double by_y = j == 0 ? 0 : j * std::pow(places[s].x(), i) * std::pow(places[s].y(), j - 1);
        slopes += Eigen::Matrix2d{{x[k] * by_x, x[k] * by_y}, {y[k] * by_x, y[k] * by_y}};
      }
    result[static_cast<Eigen::Index>(s)] = std::abs(slopes.determinant());
  }
  return result / result.mean();
}

MatrixXd powers_of(const std::vector<Vector2d>& places, int degree) {
  MatrixXd rows(places.size(), EyeMap::terms(degree));
  for (std::size_t s = 0; s < places.size(); ++s)
    rows.row(static_cast<Eigen::Index>(s)) = powers(places[s], degree);
  return rows;
}

/// Coefficients over the field from values at its nodes (rows: v outermost), one column each.
MatrixXd over_field(const MatrixXd& at_nodes, int degree) {
  const MatrixXd to_coefficients = coefficients_from_nodes(field_nodes);
  MatrixXd result = MatrixXd::Zero(EyeMap::terms(degree), at_nodes.cols());
  if (at_nodes.cols() == 0) return result;  // an empty matrix has no data that row() could point into
  int k = 0;
  for (int j = 0; j <= degree; ++j)
    for (int i = 0; i <= degree - j; ++i, ++k)
      for (int q = 0; q < field_nodes; ++q)
        for (int p = 0; p < field_nodes; ++p)
          result.row(k) +=
              to_coefficients(i, p) * to_coefficients(j, q) * at_nodes.row(Eigen::Index{q} * field_nodes + p);
  return result;
}

Tables tables_of(const State& state, bool with_paths) {
  const auto nodes = chebyshev_nodes(field_nodes);
  const auto disc = disc_points(disc_rings, disc_spokes);
  const int pupil_terms = EyeMap::terms(EyeMap::pupil_degree),
            path_terms = EyeMap::terms(EyeMap::path_degree);
  const auto surfaces = static_cast<Eigen::Index>(state.names().size());
  const auto count = static_cast<Eigen::Index>(disc.size());
  constexpr int places = field_nodes * field_nodes;
  MatrixXd rays(places, pupil_terms * EyeMap::outputs),
      weights(places, EyeMap::terms(EyeMap::weight_pupil_degree)),
      paths(places, with_paths ? surfaces * path_terms * 3 : 0);
  for (int place = 0; place < places; ++place) {
    const double u = nodes[place % field_nodes], v = nodes[place / field_nodes];
    const AimEllipse ellipse = state.ellipse(u, v);
    MatrixXd values(count, EyeMap::outputs + 2), hits(count, with_paths ? surfaces * 3 : 0);
    std::vector<Vector2d> at;
    for (Eigen::Index s = 0; s < count; ++s) {
      const Sample sample = state(u, v, ellipse, disc[s], with_paths);
      at.push_back(sample.stop);
      values.row(s) << sample.out.transpose(), (ellipse.from_disc * disc[s]).transpose();
      if (with_paths)
        for (Eigen::Index k = 0; k < surfaces; ++k) hits.block<1, 3>(s, 3 * k) = sample.hits[k].transpose();
    }
    const MatrixXd fit = Eigen::HouseholderQR<MatrixXd>(powers_of(at, EyeMap::pupil_degree)).solve(values);
    for (int t = 0; t < pupil_terms; ++t)
      rays.block<1, EyeMap::outputs>(place, Eigen::Index{t} * EyeMap::outputs) =
          fit.block<1, EyeMap::outputs>(t, 0);
    weights.row(place) = Eigen::HouseholderQR<MatrixXd>(powers_of(at, EyeMap::weight_pupil_degree))
                             .solve(jacobians(at, fit.col(EyeMap::outputs), fit.col(EyeMap::outputs + 1)))
                             .transpose();
    if (!with_paths) continue;
    const MatrixXd path = Eigen::HouseholderQR<MatrixXd>(powers_of(at, EyeMap::path_degree)).solve(hits);
    for (Eigen::Index k = 0; k < surfaces; ++k)
      for (int t = 0; t < path_terms; ++t)
        paths.block<1, 3>(place, (k * path_terms + t) * 3) = path.block<1, 3>(t, 3 * k);
  }
  return {over_field(rays, EyeMap::field_degree), over_field(weights, EyeMap::weight_field_degree),
          over_field(paths, EyeMap::path_degree)};
}

/// Row after row.
void append(std::vector<double>& values, const MatrixXd& table) {
  for (Eigen::Index row = 0; row < table.rows(); ++row)
    for (Eigen::Index column = 0; column < table.cols(); ++column) values.push_back(table(row, column));
}

/// Tables at the nodes of some coordinates become coefficients: sum over nodes of weight times table.
MatrixXd weighted(const std::vector<const MatrixXd*>& tables, const Eigen::RowVectorXd& weights) {
  MatrixXd sum = MatrixXd::Zero(tables.front()->rows(), tables.front()->cols());
  for (std::size_t i = 0; i < tables.size(); ++i) sum += weights[static_cast<Eigen::Index>(i)] * *tables[i];
  return sum;
}

double in_range(std::mt19937_64& random) {
  return static_cast<double>(random() >> 11U) / 4503599627370496.0 - 1;
}

/// Ray of the map, evaluated as a page does: polynomials of the pupil in float32.
Eigen::Vector4d ray_of(const EyeMap& map, double a, double w, double u, double v, const Vector2d& p) {
  const int field = EyeMap::terms(EyeMap::field_degree), pupil = EyeMap::terms(EyeMap::pupil_degree);
  const VectorXd in_a = chebyshev(a, map.accommodations), in_w = chebyshev(w, map.waves),
                 in_field = field_terms(u, v, EyeMap::field_degree);
  MatrixXd sum = MatrixXd::Zero(EyeMap::outputs, pupil);
  for (int l = 0; l < map.accommodations; ++l)
    for (int k = 0; k < map.waves; ++k)
      for (int f = 0; f < field; ++f)
        sum += in_a[l] * in_w[k] * in_field[f] *
               Eigen::Map<const MatrixXd>(
                   map.rays.data() +
                       (static_cast<std::ptrdiff_t>(l * map.waves + k) * field + f) * pupil * EyeMap::outputs,
                   EyeMap::outputs, pupil);
  return (sum.cast<float>() * powers(p, EyeMap::pupil_degree).cast<float>()).cast<double>();
}

void check(EyeMap& map, const EyeStates& states, const EyeMapSettings& settings) {
  std::vector<double> errors_arcmin(static_cast<std::size_t>(checked_states) * rays_a_state),
      errors_um(errors_arcmin.size());
  on_threads(settings.threads, checked_states, [&](std::size_t number) {
    std::mt19937_64 random(settings.seed * 1000003 + number);
    const double a = in_range(random), w = in_range(random);
    const State state(states.at((a + 1) / 2 * states.largest_accommodation_D), settings,
                      wavelength_at(settings, w));
    for (std::size_t ray = 0; ray < rays_a_state;) {
      const double u = in_range(random), v = in_range(random);
      const Vector2d disc(in_range(random), in_range(random));
      if (disc.norm() > 1) continue;
      const Sample sample = state(u, v, state.ellipse(u, v), disc, false);
      if (sample.stop.norm() > 1) continue;
      const Eigen::Vector4d found = ray_of(map, a, w, u, v, sample.stop);
      const Vector3d exact = Vector3d(sample.out[2], sample.out[3], 1).normalized();
      const std::size_t k = number * rays_a_state + ray;
      errors_arcmin[k] = Vector3d(found[2], found[3], 1).normalized().cross(exact).norm() / arcmin;
      const Vector3d offset(found[0] - sample.out[0], found[1] - sample.out[1], 0);
      errors_um[k] = 1000 * (offset - offset.dot(exact) * exact).norm();
      ++ray;
    }
  });
  map.checked_rays = static_cast<int>(errors_arcmin.size());
  map.direction_max_arcmin = *std::max_element(errors_arcmin.begin(), errors_arcmin.end());
  map.position_max_um = *std::max_element(errors_um.begin(), errors_um.end());
  map.direction_rms_arcmin =
      Eigen::Map<const VectorXd>(errors_arcmin.data(), map.checked_rays).norm() / std::sqrt(map.checked_rays);
}

EyeMap map_with(int nodes, const EyeStates& states, const EyeMapSettings& settings) {
  EyeMap map;
  map.field_mm = settings.field_mm;
  map.pupil_mm = settings.pupil_mm;
  map.shortest_nm = settings.shortest_nm;
  map.longest_nm = settings.longest_nm;
  map.reference_nm = settings.reference_nm;
  map.largest_accommodation_D = states.largest_accommodation_D;
  map.waves = nodes;
  map.accommodations = states.largest_accommodation_D > 0 ? nodes : 1;
  map.state_degree = nodes - 1;

  // The last of each accommodation's is at the reference wavelength.
  const auto wave_at = chebyshev_nodes(map.waves), accommodation_at = chebyshev_nodes(map.accommodations);
  const int a_state = map.waves + 1;
  std::vector<Tables> tables(static_cast<std::size_t>(map.accommodations) * a_state);
  on_threads(settings.threads, tables.size(), [&](std::size_t k) {
    const int l = static_cast<int>(k) / a_state, wave = static_cast<int>(k) % a_state;
    const double accommodation_D = (accommodation_at[l] + 1) / 2 * states.largest_accommodation_D;
    const bool is_reference = wave == map.waves;
    const State state(states.at(accommodation_D), settings,
                      is_reference ? settings.reference_nm : wavelength_at(settings, wave_at[wave]));
    tables[k] = tables_of(state, is_reference);
  });
  const EyeModel at_rest = states.at(0);
  for (auto surface = at_rest.surfaces.rbegin() + 1; surface != at_rest.surfaces.rend(); ++surface)
    map.surfaces.push_back(surface->is_stop() ? "stop" : surface->name);

  const MatrixXd by_wave = coefficients_from_nodes(map.waves),
                 by_accommodation = coefficients_from_nodes(map.accommodations);
  for (int l = 0; l < map.accommodations; ++l) {
    for (int k = 0; k < map.waves; ++k) {
      std::vector<const MatrixXd*> nodes;
      Eigen::RowVectorXd weights(map.accommodations * map.waves);
      for (int m = 0; m < map.accommodations; ++m)
        for (int n = 0; n < map.waves; ++n) {
          nodes.push_back(&tables[static_cast<std::size_t>(m) * a_state + n].rays);
          weights[m * map.waves + n] = l + k > map.state_degree ? 0 : by_accommodation(l, m) * by_wave(k, n);
        }
      append(map.rays, weighted(nodes, weights));
    }
    std::vector<const MatrixXd*> weights, paths;
    for (int m = 0; m < map.accommodations; ++m) {
      const Tables& reference = tables[static_cast<std::size_t>(m) * a_state + map.waves];
      weights.push_back(&reference.weights);
      paths.push_back(&reference.paths);
    }
    append(map.weights, weighted(weights, by_accommodation.row(l)));
    const MatrixXd path = weighted(paths, by_accommodation.row(l));
    const auto a_surface = 3 * Eigen::Index{EyeMap::terms(EyeMap::path_degree)};
    for (Eigen::Index k = 0; k < path.cols() / a_surface; ++k)
      append(map.paths, path.middleCols(k * a_surface, a_surface));
  }

  check(map, states, settings);
  return map;
}

bool is_near(const EyeMap& map) {
  return map.direction_max_arcmin <= largest_arcmin && map.direction_rms_arcmin <= largest_rms_arcmin &&
         map.position_max_um <= largest_position_um;
}

}  // namespace

std::string EyeMap::note() const {
  return fmt::format(
      "rms {:.4f}, at most {:.3f} arcmin and {:.2f} um from {} exactly traced rays (pupil to {:g} mm, {:g} x {:g} mm of "
      "retina, {:.0f} to {:.0f} nm, accommodation to {:.1f} D)",
      direction_rms_arcmin, direction_max_arcmin, position_max_um, checked_rays, pupil_mm, field_mm, field_mm,
      shortest_nm, longest_nm, largest_accommodation_D);
}

EyeMap make_eye_map(const EyeStates& states, const EyeMapSettings& settings) {
  EyeMap map;
  for (const int nodes : state_nodes) {
    map = map_with(nodes, states, settings);
    if (is_near(map)) return map;
  }
  throw unsupported_error("a map of the eye misses exact rays: " + map.note(), remedy);
}

std::vector<double> rays_at_rest(const EyeModel& eye, const EyeMapSettings& settings) {
  std::vector<double> values;
  append(values, tables_of(State(eye, settings, settings.reference_nm), false).rays);
  return values;
}

EyeMap widest_eye_map(const EyeStates& states, const EyeMapSettings& settings) {
  constexpr double least_mm = 4;
  for (EyeMapSettings tried = settings;; tried.pupil_mm -= 1) try {
      return make_eye_map(states, tried);
    } catch (const Error& error) {
      if (tried.pupil_mm - 1 < least_mm || error.status() == ExitStatus::fault) throw;
    }
}

EyeMap with_accommodation_of(const EyeMap& eye, const EyeMap& changed) {
  EyeMap sum = changed;
  // At rest a is -1: T_l(-1) = (-1)^l. `values` at rest are taken from, those of `base` added to, the constant term.
  const auto add = [&](std::vector<double>& values, const std::vector<double>& base) {
    const std::size_t a_term = base.size();
    for (std::size_t i = 0; i < a_term; ++i) {
      double at_rest = 0;
      for (int l = 0; l < sum.accommodations; ++l) at_rest += (l % 2 == 0 ? 1 : -1) * values[l * a_term + i];
      values[i] += base[i] - at_rest;
    }
  };
  add(sum.rays, eye.rays);
  add(sum.weights, eye.weights);
  add(sum.paths, eye.paths);
  sum.direction_max_arcmin = eye.direction_max_arcmin + changed.direction_max_arcmin;
  sum.direction_rms_arcmin = std::hypot(eye.direction_rms_arcmin, changed.direction_rms_arcmin);
  sum.position_max_um = eye.position_max_um + changed.position_max_um;
  sum.checked_rays = eye.checked_rays + changed.checked_rays;
  return sum;
}

}  // namespace emmetrope::raytrace
