#pragma once
#include <string>

namespace emmetrope {

/// "0.1.0+<git describe --always --dirty>"; part of every stage's key, so that a new version redoes its work.
std::string version();

inline constexpr const char* research_notice =
    "Research use only. Not a medical device. Not for prescribing without an eye examination.";

}  // namespace emmetrope
