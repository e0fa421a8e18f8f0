#pragma once
#include <string>
#include <vector>

#include "raytrace/eye/eye_model.hpp"

namespace emmetrope {

/// How a ray ended. Every traced ray is counted under exactly one.
enum class RayState { reached, vignetted, tir, missed_surface, missed_scene };
const char* to_string(RayState state);

/// One refraction (or the end) of a ray; eye frame.
struct RayHit {
  std::string surface;
  Eigen::Vector3d position_mm;
  Eigen::Vector3d direction;  ///< after the hit
  double opl_mm = 0;          ///< optical path length from the ray's origin
};

struct RayPath {
  std::vector<RayHit> hits;
  RayState state = RayState::reached;
  std::string at;  ///< the surface where it ended
};

/// The float64 reference: one ray through all surfaces that lie ahead of it, in either direction (a ray with
/// direction z < 0 goes into the eye). A surface that it legitimately misses (a nucleus smaller than the lens) is skipped
/// with the right media; the stop vignettes. Gradients are integrated with RK4 at `gradient_step_mm`.
RayPath trace_exact(const EyeModel& eye, const Ray& ray_in_eye, double wavelength_nm,
                    double gradient_step_mm = 0.02);

}  // namespace emmetrope
