#pragma once
#include <cstdint>
#include <vector>

namespace emmetrope::segmentation {

/// Decodes one JPEG 2000 codestream (or JP2 file) of one component, row after row.
/// \throw Error (input_invalid) when it is damaged or its size is not rows x columns
std::vector<std::int32_t> decode_jpeg2000(const std::vector<std::uint8_t>& stream, int rows, int columns);

}  // namespace emmetrope::segmentation
