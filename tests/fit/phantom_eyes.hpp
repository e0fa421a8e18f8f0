#pragma once
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
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
  stack.slice_intensity = rendered.slices;
  for (int s = 0; s < rendered.plan.slices; ++s)
    stack.slice_position.push_back(rendered.plan.slice_position(s));
  return stack;
}

/// A head with the stacks of a protocol that show one eye.
struct PhantomEye {
  phantom::PlacedEye truth;
  std::vector<Stack> stacks;
  Contrast contrast = Contrast::t2;

  std::vector<const Stack*> views() const {
    std::vector<const Stack*> list;
    for (const Stack& stack : stacks) list.push_back(&stack);
    return list;
  }
};

/// \param cache  folder in which rendered voxels are kept for the next call; empty: none
inline PhantomEye render_eye(const phantom::HeadGeometry& head, const phantom::Protocol& protocol,
                             Laterality laterality, int threads, const std::string& cache = {}) {
  const phantom::Anatomy anatomy(head);
  PhantomEye eye;
  eye.truth = phantom::place(head, laterality);
  for (std::size_t i = 0; i < protocol.stacks.size(); ++i) {
    const phantom::StackPlan& plan = protocol.stacks[i];
    const bool of_one_eye = plan.coil == phantom::Coil::surface;
    if (of_one_eye && plan.coil_eye != laterality) continue;
    eye.contrast = plan.contrast == phantom::Contrast::T2 ? Contrast::t2 : Contrast::t1;
    const std::string name = "stack" + std::to_string(i + 1);
    const phantom::Disturbances& d = protocol.disturbances;
    const std::string file = fmt::format("{}/{}-{}-{}-{}-{}-{}-{}.raw", cache, protocol.name, name, d.seed,
                                         d.snr, d.motion_mm, d.scale_error, d.chemical_shift_px);
    phantom::RenderedStack rendered;
    rendered.plan = plan;
    const std::size_t voxels = static_cast<std::size_t>(plan.columns) * plan.rows;
    if (!cache.empty() && std::filesystem::exists(file)) {
      rendered.slices.assign(plan.slices, std::vector<float>(voxels));
      std::ifstream in(file, std::ios::binary);
      for (auto& slice : rendered.slices)
        in.read(reinterpret_cast<char*>(slice.data()), static_cast<std::streamsize>(voxels * sizeof(float)));
    } else {
      rendered = render(anatomy, protocol, i, threads);
      if (!cache.empty()) {
        std::ofstream out(file, std::ios::binary);
        for (const auto& slice : rendered.slices)
          out.write(reinterpret_cast<const char*>(slice.data()),
                    static_cast<std::streamsize>(voxels * sizeof(float)));
      }
    }
    eye.stacks.push_back(to_stack(rendered, name));
  }
  return eye;
}

}  // namespace emmetrope::segmentation
