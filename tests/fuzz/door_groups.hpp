#pragma once
#include <vector>

#include "tests/fuzz/doors.hpp"

/// Parts of doors(), by what is read.
namespace emmetrope::fuzz {

/// Scenes, models and pictures.
std::vector<Door> scene_doors();
/// Files of a case and of a cohort, which an editor may have changed.
std::vector<Door> case_doors();
/// Options that have a grammar: the file's text is the value.
std::vector<Door> option_doors();

}  // namespace emmetrope::fuzz
