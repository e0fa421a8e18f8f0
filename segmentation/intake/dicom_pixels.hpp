#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "segmentation/intake/wire.hpp"

class DcmFileFormat;

namespace emmetrope::segmentation {

/// Stored values of one frame, row after row: masked to BitsStored at HighBit and sign-extended, not
/// rescaled.
using FrameSink = std::function<void(const std::vector<std::int32_t>&)>;

/// Registers the decoders for JPEG, JPEG-LS and RLE; to be called once.
void register_decoders();

/// Decodes all frames one after the other. The size is checked against the bytes that are there before any
/// allocation.
/// \param byte_limit for the decoded pixels of a compressed file; others are as large as the file says and is
/// \throw Error (input_invalid or unsupported) naming the tag
DecodeEnd decode_pixels(DcmFileFormat& parsed, std::uint64_t byte_limit, const FrameSink& sink);

}  // namespace emmetrope::segmentation
