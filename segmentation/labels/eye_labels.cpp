#include "segmentation/labels/eye_labels.hpp"

#include <cmath>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {

using Eigen::Vector3d;

namespace {

/// What the fitted eye has at a point of its frame.
Label label_at(const ForwardModel::AtParameters& eye, const Eigen::VectorXd& a, const Vector3d& p) {
  const auto d = eye.distances(p);
  const double depth = -p.z(), r = std::hypot(p.x(), p.y());
  // Beyond the limbus and deeper than it the cornea's conic is no border.
  constexpr double limbus_radius_mm = 5.9, cornea_reach_mm = 5;
  const bool before_limbus = r < 6.3 && depth < cornea_reach_mm;
  const bool in_cornea = before_limbus && d.cornea_front > 0;
  if (!in_cornea && d.outer < 0) return Label::none;
  if (d.lens > 0) return Label::lens;
  const bool in_content = d.globe > 0 || (before_limbus && d.cornea_back > 0);
  if (!in_content) return in_cornea && r < limbus_radius_mm ? Label::cornea : Label::wall;
  if (d.iris > 0 && d.lens_front < 0 && r < 6) return Label::iris;
  const double mid_lens = a[anterior_chamber_depth] + a[lens_thickness] / 2;
  return depth < mid_lens ? Label::anterior_chamber : Label::vitreous;
}

double reach_mm(const EyeFit& fit) { return fit.parameters.segment<3>(globe_x).maxCoeff() + 6; }

}  // namespace

EyeInStack::EyeInStack(const EyeFit& fit, std::size_t view, const Stack& stack, const Vector3d& shift)
    : fit_(fit),
      eye_(fit.model, fit.parameters),
      view_(static_cast<int>(view)),
      sampler_(stack),
      shift_(shift) {
  const Vector3d centre = fit.globe_centre_lps() - fit.head_shift_lps(view) - shift;
  if (fit.front_is_blanked()) blanked_ = BlankedRegion(stack, centre, reach_mm(fit));
}

Label EyeInStack::at(const Vector3d& lps) const {
  const Label label = label_at(eye_, fit_.parameters, eye_.to_eye(lps + shift_, view_));
  if (!fit_.front_is_blanked() || label == Label::none) return label;
  const bool is_seen = (label == Label::vitreous || label == Label::wall) && !blanked_.holds(sampler_, lps);
  return is_seen ? label : Label::none;
}

void rasterise(const EyeFit& fit, std::size_t view, Laterality laterality,
               std::vector<std::vector<std::uint8_t>>& labels) {
  const Stack& stack = *fit.stacks[view].stack;
  const EyeInStack eye(fit, view, stack);
  const Vector3d centre = fit.globe_centre_lps() - fit.head_shift_lps(view);
  const int offset = laterality == Laterality::os ? left_eye_offset : 0;
  for_each_voxel_near(stack, centre, reach_mm(fit), [&](int c, int r, int s, const Vector3d& x) {
    const Label label = eye.at(x);
    if (label != Label::none)
      labels[s][static_cast<std::size_t>(r) * stack.columns + c] =
          static_cast<std::uint8_t>(static_cast<int>(label) + offset);
  });
}

Json label_names() {
  Json list = Json::array();
  for (const Laterality eye : both_eyes) {
    const int offset = eye == Laterality::os ? left_eye_offset : 0;
    const std::string side = eye == Laterality::od ? "right " : "left ";
    int value = 1;
    for (const char* name :
         {"cornea", "anterior chamber", "iris", "lens", "vitreous body", "sclera, choroid and retina"})
      list.push_back({{"value", offset + value++}, {"name", side + name}});
  }
  return Json{{"labels", list}};
}

}  // namespace emmetrope::segmentation
