#pragma once
#include <array>

namespace emmetrope::driver {

struct CommandSummary {
  const char* name;
  const char* summary;
};

/// Every command of `emmetrope`, in the order that a newcomer meets them; each is an executable
/// emmetrope-<name>.
inline constexpr std::array<CommandSummary, 20> commands{{
    {"run", "from a DICOM folder to the report, all stages, resuming what is done"},
    {"segment", "find the eyes in the MR images and fit their surfaces"},
    {"mesh", "surfaces as triangle meshes; biometry and keratometry"},
    {"trace", "what the eye sees: rays traced backward from the retina"},
    {"correct", "the spectacle lens that sharpens the retinal image"},
    {"report", "the clinical report of a case: HTML, PDF, DICOM"},
    {"view", "a page in which an eye looks at charts, through lenses that are dragged"},
    {"deidentify", "a case's DICOM objects without identity, by the profile of DICOM PS3.15"},
    {"follow", "how the eyes of one person grow, from two or more visits"},
    {"cohort", "many studies, several at a time; the table and the page of all"},
    {"bids", "a BIDS dataset, as BIDS Apps do"},
    {"sweep", "trace, correct or eye with every combination of settings; one table"},
    {"pacs", "a study from an archive, a case's results into it"},
    {"inventory", "the series of a DICOM folder and what is wrong with them"},
    {"eye", "a schematic or measured eye: powers, cardinal points, pupils"},
    {"ray", "one ray through an eye in float64"},
    {"phantom", "a synthetic orbit MRI study with known truth"},
    {"devices", "the OpenCL devices"},
    {"doctor", "what this machine lacks, and the remedy"},
    {"help", "this list, or the help of a command"},
}};

}  // namespace emmetrope::driver
