#pragma once
#include <array>
#include <string_view>

namespace emmetrope {

/// A stage of the pipeline: the folder of the case that it fills, and the command that does it.
struct PipelineStage {
  const char* folder;
  const char* command;
};

/// In the order in which they follow one another.
inline constexpr std::array<PipelineStage, 5> pipeline_stages{{{"segmentation", "segment"},
                                                               {"meshing", "mesh"},
                                                               {"raytrace", "trace"},
                                                               {"correction", "correct"},
                                                               {"report", "report"}}};

/// The stage that fills a folder of the case; null where none does.
constexpr const PipelineStage* stage_of_folder(std::string_view folder) {
  for (const PipelineStage& stage : pipeline_stages)
    if (stage.folder == folder) return &stage;
  return nullptr;
}

}  // namespace emmetrope
