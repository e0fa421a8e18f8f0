#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/case_folder.hpp"

/// What every stage does that works eye by eye.
namespace emmetrope {

std::vector<Laterality> eyes_asked_for(LateralityChoice wanted);

/// The eyes asked for of which a stage before has written `file` into its folder of the eye.
std::vector<Laterality> eyes_with(const std::filesystem::path& case_folder, const std::string& stage_before,
                                  const std::string& file, LateralityChoice wanted);

/// Works on one eye after the other. An eye whose work ends in an Error (no_result) gives its reason; the
/// others are worked on all the same.
///
/// \param before  the verdict of the stage before: its reasons hold here too, and where it gave one eye of
///   two this stage is partial as well
/// \return done, partial (some of the eyes, or of those before) or no_result
StageVerdict work_eye_by_eye(const std::vector<Laterality>& eyes, const StageVerdict& before,
                             const std::function<void(Laterality)>& work);

/// The same error, said of an eye.
Error said_of(Laterality eye, const Error& error);

/// Before segmentation's own words, where a later stage quotes why there is nothing of an eye.
inline constexpr const char* refused_by_segmentation = "refused by segmentation: ";

/// A warning of what other instruments measured of an eye that the run does not work on.
std::string readings_not_used(Laterality eye);

/// What a stage has to say of one eye.
struct EyeAnswer {
  Json json;
  std::string text;
};

/// The answer of a stage that ran or was up to date: status, reasons, skipped, wall_s and "eyes", and the
/// same as text.
/// \param of_eye  what the case now holds of an eye that was asked for; nothing where it holds none
Answer stage_answer(const PipelineStage& stage, const StageOutcome& outcome, const CommonOptions& common,
                    const std::function<std::optional<EyeAnswer>(Laterality)>& of_eye);

}  // namespace emmetrope
