#pragma once
#include <filesystem>
#include <vector>

#include "segmentation/judgement/judged_eye.hpp"

/// The pictures and volumes of CASE/segmentation.
namespace emmetrope::segmentation {

/// Into the eye's folder: overlay_<stack>.png of every stack that shows the eye (without borders where no eye
/// was fitted) and residual_<stack>.png of those that it was fitted to.
/// \param stacks  of the study, as FoundEye counts them
/// \throw Error (not_writable)
void write_eye_images(const std::filesystem::path& folder, const JudgedEye& eye,
                      const std::vector<const Stack*>& stacks);

/// overlay_<stack>.png of what was looked at, for whoever asks why no eye was found.
/// \throw Error (not_writable)
void write_middle_slices(const std::filesystem::path& folder, const std::vector<const Stack*>& stacks);

/// <stack>.nii.gz and <stack>_labels.nii.gz of every stack that an eye was fitted to, and labels.json.
/// \throw Error (not_writable)
void write_volumes(const std::filesystem::path& folder, const std::vector<JudgedEye>& eyes,
                   const std::vector<const Stack*>& stacks);

}  // namespace emmetrope::segmentation
