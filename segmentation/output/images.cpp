#include "segmentation/output/images.hpp"

#include <fmt/format.h>

#include <algorithm>

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

/// What of a fit is withheld.
Withholds withheld_of(const JudgedEye& eye) {
  if (!eye.fit) return Withholds::nothing;
  return !eye.is_fitted()     ? Withholds::fit
         : !eye.has_front()   ? Withholds::front
         : !eye.is_measured() ? Withholds::cornea
                              : Withholds::nothing;
}

/// The edges that are told, where a view has them: by its own edges, or by where the globe was found in it.
std::optional<ToldEdges> told_edges(const JudgedEye& eye, const EyeView& view) {
  if (!eye.is_read()) return std::nullopt;
  const EdgeReading told = eye.main_edges()->reading;
  Eigen::Vector3d shift = view.globe.centre - eye.found.views.front().globe.centre;
  for (std::size_t v = 0; v < eye.edges.size(); ++v)
    if (eye.edges[v] && eye.found.views[v].stack == view.stack)
      shift = eye.edges[v]->reading.globe.centre - told.globe.centre;
  return ToldEdges{told, shift, eye.edges_on_axis_withheld().empty()};
}

/// Views that the eye was not fitted to.
void write_unfitted(const fs::path& folder, const JudgedEye& eye, const std::vector<const Stack*>& stacks) {
  const EyeView& first = eye.found.views.front();
  const auto write = [&](const EyeView& view) {
    const Stack& stack = *stacks[view.stack];
    const OverlayNotes notes{withheld_of(eye), told_edges(eye, view)};
    const fs::path file = overlay_file(folder, stack);
    if (eye.fit)
      write_overlay(file, *eye.fit, stack, first.globe.centre - view.globe.centre, notes);
    else if (notes.edges)
      write_edge_overlay(file, stack, *notes.edges);
    else
      write_plain(file, stack, view.globe.centre);
  };
  if (!eye.fit) std::for_each(eye.found.views.begin(), eye.found.views.end(), write);
  std::for_each(eye.found.left_out.begin(), eye.found.left_out.end(), write);
}

/// \param main  the reading whose verdict the eye's numbers have: it holds for the other contrast too
void write_fitted(const fs::path& folder, const JudgedEye& eye, const JudgedEye& main) {
  const bool is_main = &eye == &main;
  for (std::size_t v = 0; eye.fit && v < eye.fit->stacks.size(); ++v) {
    const Stack& stack = *eye.fit->stacks[v].stack;
    const OverlayNotes notes{std::max(withheld_of(eye), withheld_of(main)),
                             is_main ? told_edges(eye, eye.found.views[v]) : std::nullopt};
    write_overlay(overlay_file(folder, stack), *eye.fit, v, notes);
    write_residuals(folder / fmt::format("residual_{}.png", stack.name), *eye.fit, v);
  }
}

}  // namespace

void write_eye_images(const fs::path& folder, const JudgedEye& eye, const std::vector<const Stack*>& stacks) {
  write_unfitted(folder, eye, stacks);
  write_fitted(folder, eye, eye);
  for (const JudgedEye& other : eye.in_other_contrast) write_fitted(folder, other, eye);
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
