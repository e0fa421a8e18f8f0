#pragma once
#include <string>
#include <vector>

#include "data_samples/phantom/phantom.hpp"
#include "segmentation/fit/eye_fit.hpp"

/// Phantom stacks in memory, as the fit reads them.
namespace emmetrope::segmentation {

/// A rendered stack as the reader would deliver it.
inline Stack to_stack(const phantom::RenderedStack& rendered, const std::string& name) {
  Stack stack;
  stack.name = name;
  stack.columns = rendered.plan.columns;
  stack.rows = rendered.plan.rows;
  stack.along_row = rendered.plan.along_row;
  stack.along_column = rendered.plan.along_column;
  stack.normal = rendered.plan.normal();
  stack.column_spacing_mm = stack.row_spacing_mm = rendered.plan.pixel_mm;
  stack.slice_thickness_mm = rendered.plan.slice_thickness_mm;
  stack.fat_shift_sigma_mm.x() = rendered.plan.pixel_mm;  // the readout is along the rows
  stack.slices_are_encoded = rendered.plan.profile == phantom::SliceProfile::encoded;
  stack.slice_intensity = rendered.slices;
  for (int s = 0; s < rendered.plan.slices; ++s)
    stack.slice_position.push_back(rendered.plan.slice_position(s));
  return stack;
}

/// The stacks of a protocol that show one eye.
struct PhantomEye {
  std::vector<Stack> stacks;
  std::vector<Eigen::Isometry3d> scanner_from_reference;  ///< where the head was in each

  std::vector<const Stack*> views() const {
    std::vector<const Stack*> list;
    for (const Stack& stack : stacks) list.push_back(&stack);
    return list;
  }
};

/// Both eyes of a head in one axial stack of 0.8 mm: seconds to fit, and all of an eye is seen.
/// \param contrast  t1, t2
inline Stack small_scan(const phantom::HeadGeometry& head, const std::string& contrast = "t2") {
  const phantom::Anatomy anatomy(head);
  phantom::Protocol protocol;
  protocol.disturbances.snr = 20;
  protocol.stacks.push_back(phantom::make_stack(
      "head-axial:pixel_mm=0.8,slice_mm=0.8,matrix=140x60,slices=44,contrast=" + contrast, anatomy));
  return to_stack(phantom::render(anatomy, protocol, 0, 1), "stack1");
}
inline Stack small_scan(unsigned long long seed) { return small_scan(phantom::random_head(seed)); }

inline PhantomEye render_eye(const phantom::HeadGeometry& head, const phantom::Protocol& protocol,
                             Laterality laterality, int threads) {
  const phantom::Anatomy anatomy(head);
  PhantomEye eye;
  for (std::size_t i = 0; i < protocol.stacks.size(); ++i) {
    const phantom::StackPlan& plan = protocol.stacks[i];
    if (plan.coil == phantom::Coil::surface && plan.coil_eye != laterality) continue;
    const phantom::RenderedStack rendered = render(anatomy, protocol, i, threads);
    eye.stacks.push_back(to_stack(rendered, "stack" + std::to_string(i + 1)));
    eye.scanner_from_reference.push_back(rendered.scanner_from_reference);
  }
  return eye;
}

}  // namespace emmetrope::segmentation
