#pragma once
#include <cstdint>
#include <optional>
#include <string>

namespace emmetrope {

/// How much address space this process may have (ulimit -v); none: as much as it wants.
std::optional<std::uint64_t> memory_limit_bytes();

/// ": this process may have 500 MB (ulimit -v)", for the remedy of what failed for want of memory; empty without limit.
std::string memory_limit_note();

}  // namespace emmetrope
