#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/labels/eye_labels.hpp"

/// A segmentation that somebody corrected in another program, in place of a stack's intensities.
namespace emmetrope::segmentation {

/// Labels of one stack: values as in labels.json, one vector a slice as in Stack::slice_intensity.
struct HandLabels {
  std::size_t stack = 0;  ///< index into the stacks
  std::string input;      ///< name in stage.json's inputs: "labels/1"
  std::vector<std::vector<std::uint8_t>> values;

  /// Whether any voxel is the eye's.
  bool shows(Laterality laterality) const;
};

/// Reads NIfTI label volumes; each belongs to the stack whose voxels' centres are its own (within a tenth of
/// a voxel, the axes in any order).
/// \throw Error (input_invalid) naming the file, what was found and what is expected: a grid of no stack, a
///   value that labels.json does not have, no label at all; (usage) for two files on one stack
std::vector<HandLabels> read_hand_labels(const std::vector<std::filesystem::path>& files,
                                         const std::vector<const Stack*>& stacks);

/// Puts the labelled eyes where their labels are, to be fitted to the labelled stacks alone; eyes without
/// labels stay as they were found.
/// \throw Error (input_invalid) when a tissue is missing or an eye's labels lie in the other one
void place_labelled_eyes(const std::vector<HandLabels>& labels, const std::vector<const Stack*>& stacks,
                         FoundEyes& found);

/// One eye's labels as an image for the fit (Evidence::labels).
Stack label_image(const HandLabels& labels, const Stack& stack, Laterality laterality);

}  // namespace emmetrope::segmentation
