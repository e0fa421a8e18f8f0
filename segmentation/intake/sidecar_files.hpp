#pragma once
#include <filesystem>
#include <vector>

namespace emmetrope::segmentation {

/// T1.json of T1.nii and T1.nii.gz.
std::filesystem::path sidecar_of(std::filesystem::path volume);

/// The JSON files that tell of a volume's acquisition, the nearest first: the one of its name beside it, also where it is
/// a link to nothing, and in a BIDS dataset (sub-*, below a dataset_description.json) those from which it inherits: in
/// its folder, without one of its own, and in each above it one of its suffix, without an entity that is not its own.
/// \param volume  absolute, or no folder above those that it names is looked into
std::vector<std::filesystem::path> sidecars_of(const std::filesystem::path& volume);

}  // namespace emmetrope::segmentation
