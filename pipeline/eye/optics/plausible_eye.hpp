#pragma once
#include <string>

#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// Why a model is no human eye, for a warning: its power (without a spectacle) or its length, as of lengths in another
/// unit than mm; empty where it may be one.
std::string implausible_eye(const EyeModel& eye);

}  // namespace emmetrope
