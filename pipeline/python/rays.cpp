#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/python/bindings.hpp"

namespace emmetrope::python {
namespace {

/// Rays are shared among threads by so many.
constexpr std::size_t rays_at_once = 4096;

/// \throw Error (usage) where it begins nowhere or has no direction
void require_ray(const double* origin_mm, const double* direction, py::ssize_t row) {
  using Vector = Eigen::Map<const Eigen::Vector3d>;
  if (!Vector(origin_mm).allFinite())
    throw usage_error(fmt::format("origin_mm: ray {} begins nowhere: finite numbers are wanted", row));
  if (!std::isnormal(Vector(direction).squaredNorm()))
    throw usage_error(fmt::format("direction: ray {} has none: finite numbers, not all 0, are wanted", row));
}

struct TracedRays {
  py::array_t<double> position_mm, direction, opl_mm;
  py::array_t<std::uint8_t> state;
  py::array_t<int> surface;
};

TracedRays trace(const EyeModel& eye, const Doubles& origin_mm, const Doubles& direction,
                 const std::optional<double>& wavelength_nm, int threads) {
  const double* from = rows_of_three(origin_mm, "origin_mm");
  const double* along = rows_of_three(direction, "direction");
  const auto count = static_cast<std::size_t>(origin_mm.shape(0));
  if (direction.shape(0) != origin_mm.shape(0))
    throw usage_error("origin_mm and direction: of the same length");
  const std::vector<py::ssize_t> rows{origin_mm.shape(0), 3};
  TracedRays rays{py::array_t<double>(rows), py::array_t<double>(rows),
                  py::array_t<double>(origin_mm.shape(0)), py::array_t<std::uint8_t>(origin_mm.shape(0)),
                  py::array_t<int>(origin_mm.shape(0))};
  double *position = rays.position_mm.mutable_data(), *leaving = rays.direction.mutable_data(),
         *opl = rays.opl_mm.mutable_data();
  std::uint8_t* state = rays.state.mutable_data();
  int* surface = rays.surface.mutable_data();
  for (py::ssize_t k = 0; k < origin_mm.shape(0); ++k) require_ray(from + 3 * k, along + 3 * k, k);
  const double nm = wavelength_of(eye, wavelength_nm);
  const py::gil_scoped_release unlocked;
  const ExactTracer tracer(eye, nm);
  on_threads(thread_count(threads), (count + rays_at_once - 1) / rays_at_once, [&](std::size_t part) {
    for (std::size_t k = part * rays_at_once; k < std::min(count, (part + 1) * rays_at_once); ++k) {
      using Row = Eigen::Map<const Eigen::Vector3d>;
      const ExactTracer::End end = tracer.trace_end({Row(from + 3 * k), Row(along + 3 * k)});
      Eigen::Map<Eigen::Vector3d>(position + 3 * k) = end.position_mm;
      Eigen::Map<Eigen::Vector3d>(leaving + 3 * k) = end.direction;
      opl[k] = end.opl_mm;
      state[k] = static_cast<std::uint8_t>(end.state);
      surface[k] = end.surface;
    }
  });
  return rays;
}

py::list path_of(const EyeModel& eye, const Eigen::Vector3d& origin_mm, const Eigen::Vector3d& direction,
                 const std::optional<double>& wavelength_nm) {
  require_ray(origin_mm.data(), direction.data(), 0);
  const RayPath path =
      trace_exact(eye, {origin_mm, direction.normalized()}, wavelength_of(eye, wavelength_nm));
  py::list hits;
  for (const RayHit& hit : path.hits) {
    py::dict entry;
    entry["surface"] = hit.surface;
    entry["position_mm"] = hit.position_mm;
    entry["direction"] = hit.direction;
    entry["opl_mm"] = hit.opl_mm;
    hits.append(entry);
  }
  return hits;
}

}  // namespace

void bind_rays(py::module_& module) {
  const auto wavelength = py::arg("wavelength_nm") = py::none();
  py::class_<TracedRays>(module, "Rays", "Where rays ended, an entry each.")
      .def_readonly("position_mm", &TracedRays::position_mm, "(N, 3): the last hit.")
      .def_readonly("direction", &TracedRays::direction, "(N, 3): unit vectors behind it.")
      .def_readonly("opl_mm", &TracedRays::opl_mm, "(N,): optical path from the origin to the last hit.")
      .def_readonly("state", &TracedRays::state, "(N,) uint8: an index into ray_states.")
      .def_readonly("surface", &TracedRays::surface,
                    "(N,) int32: where it ended, an index into Eye.surface_names.");
  py::list states;
  for (int k = 0; k <= static_cast<int>(RayState::missed_scene); ++k)
    states.append(to_string(static_cast<RayState>(k)));
  module.attr("ray_states") = py::tuple(states);
  module.def("trace_rays", &trace, py::arg("eye"), py::arg("origin_mm"), py::arg("direction"), wavelength,
             py::arg("threads") = 0,
             "Exact rays in float64 through an eye, in either direction (z < 0 goes into the eye).\n\n"
             "origin_mm, direction: arrays (N, 3) in the eye's frame; threads: 0 for all cores.");
  module.def("ray_path", &path_of, py::arg("eye"), py::arg("origin_mm"), py::arg("direction"), wavelength,
             "One exact ray, hit by hit: a list of dictionaries surface, position_mm, direction, opl_mm.");
}

}  // namespace emmetrope::python
