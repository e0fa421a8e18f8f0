#pragma once
#include <cstdint>

namespace emmetrope::segmentation {

/// Limits of the process that parses files of unknown origin: memory, open files, no file written, no core; lower ones
/// that it was started under stand. Where the system does not take a limit the process ends.
void limit_process(std::uint64_t memory_bytes);

/// Ends the process when it has taken so much more processor time than until now.
void limit_processor_time(double further_s);

}  // namespace emmetrope::segmentation
