#include "pipeline/eye/parametric/corneal_form.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {

CornealForm corneal_form(double x_mm, double y_mm) {
  static const Eigen::VectorXd at_apex = zernike_values(corneal_form_order, 0, 0);
  const double r_mm = std::hypot(x_mm, y_mm);
  const double shrink = r_mm > corneal_form_reach_mm ? corneal_form_reach_mm / r_mm : 1;
  const double scale = shrink / corneal_form_radius_mm;
  CornealForm form;
  for (int i = 0; i < corneal_form_terms; ++i) {
    const int j = corneal_form_first + i;
    const ZernikeJet jet = zernike_jet(j, scale * x_mm, scale * y_mm);
    form.value[i] = jet.value - at_apex[j];
    form.gradient_per_mm[i] = scale * jet.gradient;
    if (shrink < 1) {
      const Eigen::Vector2d outward = Eigen::Vector2d(x_mm, y_mm) / r_mm;
      form.gradient_per_mm[i] -= form.gradient_per_mm[i].dot(outward) * outward;
    }
  }
  return form;
}

std::string corneal_form_name(int term) {
  return fmt::format("cornea_zernike_{:02}_um", corneal_form_first + term);
}

}  // namespace emmetrope
