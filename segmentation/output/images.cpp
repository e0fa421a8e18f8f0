#include "segmentation/output/images.hpp"

#include <fmt/format.h>

#include "pipeline/base/json.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/labels/eye_labels.hpp"
#include "segmentation/output/overlay.hpp"

namespace emmetrope::segmentation {

namespace fs = std::filesystem;

namespace {

fs::path overlay_file(const fs::path& folder, const Stack& stack) {
  return folder / fmt::format("overlay_{}.png", stack.name);
}

/// To the contrast that stands, and to the other one.
std::vector<const EyeFit*> fits_of(const JudgedEye& eye) {
  std::vector<const EyeFit*> fits;
  if (eye.fit) fits.push_back(&*eye.fit);
  for (const JudgedEye& other : eye.in_other_contrast)
    if (other.fit) fits.push_back(&*other.fit);
  return fits;
}

}  // namespace

void write_eye_images(const fs::path& folder, const JudgedEye& eye, const std::vector<const Stack*>& stacks) {
  const EyeView& first = eye.found.views.front();
  for (const std::vector<EyeView>* views : {&eye.found.views, &eye.found.left_out})
    for (const EyeView& view : *views) {
      const Stack& stack = *stacks[view.stack];
      if (!eye.fit) {
        write_plain(overlay_file(folder, stack), stack, view.globe.centre);
      } else if (views == &eye.found.left_out) {
        write_overlay(overlay_file(folder, stack), *eye.fit, stack, first.globe.centre - view.globe.centre);
      }
    }
  for (const EyeFit* fit : fits_of(eye))
    for (std::size_t v = 0; v < fit->stacks.size(); ++v) {
      const Stack& stack = *fit->stacks[v].stack;
      write_overlay(overlay_file(folder, stack), *fit, v);
      write_residuals(folder / fmt::format("residual_{}.png", stack.name), *fit, v);
    }
}

void write_middle_slices(const fs::path& folder, const std::vector<const Stack*>& stacks) {
  for (const Stack* stack : stacks) {
    const int column = stack->columns / 2, row = stack->rows / 2, slice = stack->slices() / 2;
    write_plain(overlay_file(folder, *stack), *stack, stack->position(column, row, slice));
  }
}

void write_volumes(const fs::path& folder, const std::vector<JudgedEye>& eyes,
                   const std::vector<const Stack*>& stacks) {
  for (const Stack* stack : stacks) {
    std::vector<std::vector<std::uint8_t>> labels(
        stack->slices(),
        std::vector<std::uint8_t>(static_cast<std::size_t>(stack->columns) * stack->rows, 0));
    bool used = false;
    for (const JudgedEye& eye : eyes) {
      for (const JudgedEye* reading : eye.readings()) {
        for (const EyeView& view : reading->found.views) used = used || stacks[view.stack] == stack;
        if (!reading->is_fitted()) continue;
        for (std::size_t v = 0; v < reading->fit->stacks.size(); ++v)
          if (reading->fit->stacks[v].stack == stack)
            rasterise(*reading->fit, v, eye.found.laterality, labels);
      }
    }
    if (!used) continue;
    write_nifti(folder / (stack->name + ".nii.gz"), *stack);
    write_label_nifti(folder / (stack->name + "_labels.nii.gz"), *stack, labels);
  }
  write_json(folder / "labels.json", label_names());
}

}  // namespace emmetrope::segmentation
