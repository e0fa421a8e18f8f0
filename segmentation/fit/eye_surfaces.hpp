#pragma once
#include <Eigen/Core>
#include <array>

#include "segmentation/fit/eye_parameters.hpp"

/// The surfaces of the fitted eye at a point p of the eye frame (mm), as functions of the parameters a
/// (Parameter).
namespace emmetrope::segmentation {

/// Radius of the sphere on which displacements of the wall are meant in mm.
inline constexpr double displacement_sphere_mm = 11;

/// F > 0 inside, its gradient and second derivatives in the eye frame, and its derivatives by shape
/// parameters.
struct EyeSurface {
  double f = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();  ///< near the surface, to a tenth: it corrects microns
  int count = 0;
  std::array<int, 9 + corneal_form_terms> parameter;
  std::array<double, 9 + corneal_form_terms> derivative;
  void depends(int on_parameter, double with_derivative) {
    parameter[count] = on_parameter;
    derivative[count++] = with_derivative;
  }
};

/// Fields on the wall at a point: its displacement with the gradient, and by how much the background differs
/// from its mean.
struct WallFields {
  double displacement = 0, background = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  std::array<double, 128> bump;  ///< at most all of bump_directions()
};

/// The free form of an irregular cornea at a point: the anterior one's depth (mm) and gradient, and where its
/// coefficients are in the parameters.
struct CorneaField {
  double depth = 0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  std::array<double, corneal_form_terms> d_depth;  ///< mm of depth by um of a coefficient
  int first = 0, back_ratio = 0;
};

/// A Gaussian of the angle from a bump's direction, and its derivative by the angle's cosine.
struct Bump {
  double value, d_cosine;
};
Bump bump_at(double cosine);

/// \param field  none: the biconic alone
EyeSurface cornea_surface(const Eigen::VectorXd& a, const Eigen::Vector3d& p, bool back,
                          const CorneaField* field);
EyeSurface lid_surface(const Eigen::VectorXd& a, const Eigen::Vector3d& p);
/// Sides of the wall, and where its layers meet.
enum class WallSide { inner, between, outer };
/// \param fields  none: the ellipsoid alone
EyeSurface globe_surface(const Eigen::VectorXd& a, const Eigen::Vector3d& p, WallSide side,
                         const WallFields* fields);
/// The nucleus: an ellipsoid of the lens's proportions, this share as large (chosen).
inline constexpr double nucleus_share = 0.62;
EyeSurface nucleus_surface(const Eigen::VectorXd& a, const Eigen::Vector3d& p);
void lens_surfaces(const Eigen::VectorXd& a, const Eigen::Vector3d& p, EyeSurface& front, EyeSurface& back,
                   EyeSurface& equator);
void iris_surfaces(const Eigen::VectorXd& a, const Eigen::Vector3d& p, EyeSurface& top, EyeSurface& bottom,
                   EyeSurface& pupil);

}  // namespace emmetrope::segmentation
