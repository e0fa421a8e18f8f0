#pragma once
#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "correction/search/optimise.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::correction {

/// A kind of correcting lens with the numbers that are sought. A parameter is a power in dioptres, so that
/// steps and slopes compare between families.
struct LensFamily {
  std::string name;
  Bounds bounds;
  /// The eye with the lens before it.
  /// \throw Error (usage) where no such lens can be made
  std::function<EyeModel(const EyeModel& eye, const Eigen::VectorXd& lens)> before;
  /// Back vertex power.
  std::function<PowerVector(const Eigen::VectorXd& lens)> power;

  /// The eye with the lenses that bracket this one in each parameter: what images are differentiated by.
  std::vector<raytrace::EyeTangent> tangents(const EyeModel& eye, const Eigen::VectorXd& lens) const;
};

/// Where a lens on the cornea stands: just clear of all that reaches in front of the cornea's vertex, as an irregular or
/// a tilted cornea does beside it.
double clear_of_cornea_mm(const EyeModel& eye);

/// Thin sphero-cylindrical lens; parameters M, J0, J45 (D) at the vertex distance; 0 is a contact lens, which is clear of
/// the cornea.
LensFamily thin_lens(double vertex_distance_mm);

/// The paper's spectacle: plano-cylinder of either sign. Parameters J0, J45 (D) of the lens; its M is -|J|
/// for a minus cylinder and +|J| for a plus cylinder, so one family holds one sign.
/// \param sign  -1 or +1
LensFamily plano_cylinder(int sign, double distance_mm, double index);

/// The lenses of a family along one direction of its parameters: the only parameter t >= 0 stands for t times
/// it.
LensFamily along(const LensFamily& family, const Eigen::VectorXd& direction);

/// The lenses of a family of two parameters in polar form: distance from 0, and arc from `start`'s direction
/// on the circle through it. What a cylinder's image hardly minds, a turn of its axis, is one parameter then.
LensFamily polar(const LensFamily& family, const Eigen::Vector2d& start);

/// Radius and axis of a member of that family, in the contract's sense: radius of the back surface, +50 mm is
/// -10 D at index 1.5; axis is the meridian without power.
struct PlanoCylinder {
  double radius_mm = 0, axis_deg = 0, power_D = 0;
};
PlanoCylinder plano_cylinder_of(int sign, const Eigen::VectorXd& lens, double index);
/// The parameters of a plano-cylinder.
Eigen::Vector2d plano_cylinder_parameters(double radius_mm, double axis_deg, double index);

}  // namespace emmetrope::correction
