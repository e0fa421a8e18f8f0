#include "segmentation/intake/jpeg2000.hpp"

#include <fmt/format.h>
#include <openjpeg.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>

#include "pipeline/base/error.hpp"

namespace emmetrope::segmentation {
namespace {

struct Reader {
  const std::vector<std::uint8_t>& bytes;
  std::size_t position = 0;
};

OPJ_SIZE_T read_bytes(void* buffer, OPJ_SIZE_T wanted, void* data) {
  auto& reader = *static_cast<Reader*>(data);
  const std::size_t available = std::min<std::size_t>(wanted, reader.bytes.size() - reader.position);
  if (available == 0) return static_cast<OPJ_SIZE_T>(-1);
  std::memcpy(buffer, reader.bytes.data() + reader.position, available);
  reader.position += available;
  return available;
}

OPJ_OFF_T skip_bytes(OPJ_OFF_T count, void* data) {
  auto& reader = *static_cast<Reader*>(data);
  if (count < 0) return -1;
  const auto step =
      std::min<std::size_t>(static_cast<std::size_t>(count), reader.bytes.size() - reader.position);
  reader.position += step;
  return static_cast<OPJ_OFF_T>(step);
}

OPJ_BOOL seek_bytes(OPJ_OFF_T position, void* data) {
  auto& reader = *static_cast<Reader*>(data);
  if (position < 0 || static_cast<std::size_t>(position) > reader.bytes.size()) return OPJ_FALSE;
  reader.position = static_cast<std::size_t>(position);
  return OPJ_TRUE;
}

void note_complaint(const char* /*message*/, void* complained) { *static_cast<bool*>(complained) = true; }

bool is_jp2(const std::vector<std::uint8_t>& stream) {
  static constexpr std::array<std::uint8_t, 8> signature{0, 0, 0, 12, 'j', 'P', ' ', ' '};
  return stream.size() > signature.size() && std::equal(signature.begin(), signature.end(), stream.begin());
}

}  // namespace

std::vector<std::int32_t> decode_jpeg2000(const std::vector<std::uint8_t>& stream, int rows, int columns) {
  const std::unique_ptr<opj_codec_t, decltype(&opj_destroy_codec)> codec(
      opj_create_decompress(is_jp2(stream) ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K), &opj_destroy_codec);
  const std::unique_ptr<opj_stream_t, decltype(&opj_stream_destroy)> input(
      opj_stream_default_create(OPJ_TRUE), &opj_stream_destroy);
  Reader reader{stream};
  opj_stream_set_user_data(input.get(), &reader, nullptr);
  opj_stream_set_user_data_length(input.get(), stream.size());
  opj_stream_set_read_function(input.get(), read_bytes);
  opj_stream_set_skip_function(input.get(), skip_bytes);
  opj_stream_set_seek_function(input.get(), seek_bytes);

  bool complained = false;  // OpenJPEG carries on with zeros after some faults and only says so
  opj_set_warning_handler(codec.get(), note_complaint, &complained);
  opj_set_error_handler(codec.get(), note_complaint, &complained);
  opj_dparameters_t parameters;
  opj_set_default_decoder_parameters(&parameters);

  opj_image_t* raw_image = nullptr;
  const bool started = opj_setup_decoder(codec.get(), &parameters) &&
                       opj_decoder_set_strict_mode(codec.get(), OPJ_TRUE) &&
                       opj_read_header(input.get(), codec.get(), &raw_image);
  const std::unique_ptr<opj_image_t, decltype(&opj_image_destroy)> image(raw_image, &opj_image_destroy);
  if (!started || image == nullptr)
    throw input_error("(7fe0,0010) PixelData: the JPEG 2000 stream is damaged");
  const bool fits = image->numcomps == 1 && image->x1 - image->x0 == static_cast<OPJ_UINT32>(columns) &&
                    image->y1 - image->y0 == static_cast<OPJ_UINT32>(rows);
  if (!fits)
    throw input_error(
        fmt::format("(7fe0,0010) PixelData: the JPEG 2000 stream has {} rows, {} columns and {} components, "
                    "not {}, {} and 1",
                    image->y1 - image->y0, image->x1 - image->x0, image->numcomps, rows, columns));
  if (!opj_decode(codec.get(), input.get(), image.get()) || complained || image->comps[0].data == nullptr ||
      image->comps[0].w != static_cast<OPJ_UINT32>(columns) ||
      image->comps[0].h != static_cast<OPJ_UINT32>(rows))
    throw input_error("(7fe0,0010) PixelData: the JPEG 2000 stream is damaged");
  const auto count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  return {image->comps[0].data, image->comps[0].data + count};
}

}  // namespace emmetrope::segmentation
