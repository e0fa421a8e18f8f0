#include "segmentation/intake/dicom_pixels.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dccodec.h>
#include <dcmtk/dcmdata/dcfcache.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/appender.h>
#include <dcmtk/oflog/oflog.h>
#include <dcmtk/oflog/spi/logevent.h>
#include <fmt/format.h>

#include "pipeline/base/error.hpp"
#include "segmentation/intake/jpeg2000.hpp"

namespace emmetrope::segmentation {
namespace {

/// Counts what DCMTK's libraries complain about: damaged JPEG data are padded with zeros after a warning
/// only. A scan header whose spectral selection is not that of sequential JPEG (0 to 63), as NEMA's own sample files have
/// it, damages nothing.
class ComplaintCounter : public dcmtk::log4cplus::Appender {
 public:
  explicit ComplaintCounter(int& counter) : count_(counter) {}
  ~ComplaintCounter() override { destructorImpl(); }
  void close() override {}

 protected:
  void append(const dcmtk::log4cplus::spi::InternalLoggingEvent& event) override {
    const bool is_harmless = event.getMessage().find("Invalid SOS parameters") != std::string::npos;
    if (event.getLogLevel() >= dcmtk::log4cplus::WARN_LOG_LEVEL && !is_harmless) ++count_;
  }

 private:
  int& count_;
};

int& complaints() {
  static int count = 0;
  return count;
}

struct Layout {
  int rows = 0, columns = 0, frames = 1;
  int bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;

  std::uint64_t samples() const {
    return static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns);
  }
  std::uint64_t frame_bytes() const { return samples() * static_cast<std::uint64_t>(bits_allocated / 8); }
};

int number(DcmItem& data_set, const Tag& tag) {
  Uint16 value = 0;
  if (data_set.findAndGetUint16(DcmTagKey(tag.group, tag.element), value).bad())
    throw input_error(to_string(tag) + " is absent or no number");
  return value;
}

Layout read_layout(DcmItem& data_set) {
  Layout layout;
  layout.rows = number(data_set, tag::rows);
  layout.columns = number(data_set, tag::columns);
  layout.bits_allocated = number(data_set, tag::bits_allocated);
  layout.bits_stored = number(data_set, tag::bits_stored);
  layout.high_bit = number(data_set, tag::high_bit);
  const int representation = number(data_set, tag::pixel_representation);
  if (representation > 1)
    throw input_error(fmt::format("{} is {}; 0 (unsigned) or 1 (signed) is required",
                                  to_string(tag::pixel_representation), representation));
  layout.is_signed = representation == 1;
  if (const int samples = number(data_set, tag::samples_per_pixel); samples != 1)
    throw unsupported_error(
        fmt::format("{} is {}: a colour image; 1 is required", to_string(tag::samples_per_pixel), samples));
  if (data_set.tagExists(DCM_NumberOfFrames)) {
    Sint32 frames = 0;
    if (data_set.findAndGetSint32(DCM_NumberOfFrames, frames).bad() || frames < 1)
      throw input_error(to_string(tag::number_of_frames) + " is no positive number");
    layout.frames = frames;
  }
  if (layout.rows == 0 || layout.columns == 0)
    throw input_error(fmt::format("{} is {} and {} is {}: an empty image", to_string(tag::rows), layout.rows,
                                  to_string(tag::columns), layout.columns));
  if (layout.bits_allocated != 8 && layout.bits_allocated != 16)
    throw unsupported_error(
        fmt::format("{} is {}; 8 or 16 are read", to_string(tag::bits_allocated), layout.bits_allocated));
  if (layout.bits_stored < 1 || layout.bits_stored > layout.bits_allocated)
    throw input_error(fmt::format("{} is {} of {} bits", to_string(tag::bits_stored), layout.bits_stored,
                                  layout.bits_allocated));
  if (layout.high_bit < layout.bits_stored - 1 || layout.high_bit >= layout.bits_allocated)
    throw input_error(fmt::format("{} is {} with {} bits stored", to_string(tag::high_bit), layout.high_bit,
                                  layout.bits_stored));
  return layout;
}

void check_size(const Layout& layout, std::uint64_t byte_limit) {
  if (static_cast<std::uint64_t>(layout.frames) > byte_limit / layout.frame_bytes())
    throw input_error(fmt::format("{} {} x {} {} x {} {} is more than {} MB", to_string(tag::rows),
                                  layout.rows, to_string(tag::columns), layout.columns,
                                  to_string(tag::number_of_frames), layout.frames, byte_limit / 1'000'000));
}

/// Picks the stored bits out of allocated ones (PS3.5 8.1.1) and notes bits set elsewhere. Copies of the sign
/// above the high bit are usual and not stray.
class SampleReader {
 public:
  explicit SampleReader(const Layout& layout)
      : shift_(layout.high_bit + 1 - layout.bits_stored),
        mask_((1U << layout.bits_stored) - 1),
        sign_(layout.is_signed ? 1U << (layout.bits_stored - 1) : 0),
        allocated_((1U << layout.bits_allocated) - 1) {}

  std::int32_t operator()(std::uint32_t word) {
    const std::uint32_t stored = (word >> shift_) & mask_;
    const bool negative = (stored & sign_) != 0;
    const std::uint32_t outside = word & allocated_ & ~(mask_ << shift_);
    const std::uint32_t sign_copies = allocated_ & ~((mask_ << shift_) | ((1U << shift_) - 1));
    if (outside != 0 && !(negative && outside == sign_copies)) stray_bits_ = true;
    return static_cast<std::int32_t>(stored) - (negative ? static_cast<std::int32_t>(2 * sign_) : 0);
  }
  bool stray_bits() const { return stray_bits_; }

 private:
  int shift_;
  std::uint32_t mask_, sign_, allocated_;
  bool stray_bits_ = false;
};

DcmPixelData& pixel_data(DcmDataset& data_set) {
  DcmElement* element = nullptr;
  if (data_set.findAndGetElement(DCM_PixelData, element).bad() || element == nullptr)
    throw input_error(to_string(tag::pixel_data) + " is absent");
  auto* pixels = dynamic_cast<DcmPixelData*>(element);
  if (pixels == nullptr)
    throw input_error(to_string(tag::pixel_data) + " has an impossible value representation");
  return *pixels;
}

/// Raw samples of all frames.
DecodeEnd stream_raw(DcmPixelData& pixels, const Layout& layout, const FrameSink& sink) {
  const std::uint64_t found = pixels.getLength();
  if (static_cast<std::uint64_t>(layout.frames) > found / layout.frame_bytes())
    throw input_error(fmt::format("{} has {} bytes, too few for {} rows x {} columns x {} frames of {} bits",
                                  to_string(tag::pixel_data), found, layout.rows, layout.columns,
                                  layout.frames, layout.bits_allocated));
  const std::uint64_t needed = layout.frame_bytes() * static_cast<std::uint64_t>(layout.frames);
  DecodeEnd end;
  end.extra_bytes = found - needed > (needed & 1) ? found - needed : 0;
  const auto bytes_per_frame = static_cast<Uint32>(layout.frame_bytes());
  std::vector<std::uint8_t> bytes(bytes_per_frame);
  std::vector<std::int32_t> samples(layout.samples());
  SampleReader read(layout);
  DcmFileCache cache;
  for (int frame = 0; frame < layout.frames; ++frame) {
    const auto got = pixels.getPartialValue(bytes.data(), static_cast<Uint32>(frame) * bytes_per_frame,
                                            bytes_per_frame, &cache, EBO_LittleEndian);
    if (got.bad())
      throw input_error(fmt::format("{} cannot be read: {}", to_string(tag::pixel_data), got.text()));
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i] = layout.bits_allocated == 8
                       ? read(bytes[i])
                       : read(bytes[2 * i] | static_cast<std::uint32_t>(bytes[2 * i + 1]) << 8);
    sink(samples);
  }
  end.stray_bits = read.stray_bits();
  return end;
}

using Fragment = std::vector<std::uint8_t>;

/// The compressed fragments, without the offset table.
std::vector<Fragment> fragments_of(DcmPixelData& pixels, E_TransferSyntax syntax) {
  DcmPixelSequence* sequence = nullptr;
  if (pixels.getEncapsulatedRepresentation(syntax, nullptr, sequence).bad() || sequence == nullptr)
    throw input_error(to_string(tag::pixel_data) +
                      " is not encapsulated as (0002,0010) TransferSyntaxUID says");
  std::vector<Fragment> fragments;
  for (unsigned long i = 1; i < sequence->card(); ++i) {
    DcmPixelItem* item = nullptr;
    Uint8* bytes = nullptr;
    if (sequence->getItem(item, i).bad() || item->getUint8Array(bytes).bad() || bytes == nullptr ||
        item->getLength() == 0)
      throw input_error(
          fmt::format("{}: fragment {} is empty or cannot be read", to_string(tag::pixel_data), i));
    fragments.emplace_back(bytes, bytes + item->getLength());
  }
  return fragments;
}

/// One compressed stream a frame.
/// \throw Error (unsupported) when fragments cannot be told to frames
std::vector<Fragment> streams_of(std::vector<Fragment> fragments, int frames) {
  if (static_cast<int>(fragments.size()) == frames) return fragments;
  if (fragments.empty() || static_cast<int>(fragments.size()) < frames)
    throw input_error(fmt::format("{} has {} fragments for {} frames", to_string(tag::pixel_data),
                                  fragments.size(), frames));
  if (frames > 1)
    throw unsupported_error(fmt::format("{} has {} fragments for {} frames; one each is read",
                                        to_string(tag::pixel_data), fragments.size(), frames));
  Fragment joined;
  for (const auto& part : fragments) joined.insert(joined.end(), part.begin(), part.end());
  return {joined};
}

/// Rows and columns in the frame header of a JPEG or JPEG-LS stream (ITU-T T.81 B.2.2), {0, 0} when there is
/// none.
std::array<int, 2> jpeg_size(const Fragment& stream) {
  for (std::size_t i = 2; i + 9 < stream.size();) {
    if (stream[i] != 0xFF) return {0, 0};
    const int marker = stream[i + 1];
    if (marker == 0xFF || marker == 0x01) {  // a fill byte, or TEM, which has no length
      i += marker == 0xFF ? 1 : 2;
      continue;
    }
    const bool frame_header =
        (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) ||
        marker == 0xF7;
    if (frame_header) return {stream[i + 5] << 8 | stream[i + 6], stream[i + 7] << 8 | stream[i + 8]};
    i += 2 + static_cast<std::size_t>(stream[i + 2] << 8 | stream[i + 3]);
  }
  return {0, 0};
}

/// The end-of-image marker FFD9, before padding: zeros, or one byte that DCMTK's own JPEG-LS writer leaves
/// undefined.
bool ends_with_marker(const Fragment& stream) {
  std::size_t end = stream.size();
  while (end > 3 && stream[end - 1] == 0) --end;
  const auto marker_before = [&](std::size_t at) { return stream[at - 2] == 0xFF && stream[at - 1] == 0xD9; };
  return end >= 3 && (marker_before(end) || marker_before(end - 1));
}

/// DCMTK pads a stream that ends early or is smaller than the image with zeros.
void check_jpeg_streams(const std::vector<Fragment>& streams, const Layout& layout) {
  for (std::size_t frame = 0; frame < streams.size(); ++frame) {
    const auto& stream = streams[frame];
    const auto size = jpeg_size(stream);
    if (size[0] != layout.rows || size[1] != layout.columns)
      throw input_error(
          fmt::format("{}: the JPEG stream of frame {} has {} rows and {} columns, not {} and {}",
                      to_string(tag::pixel_data), frame + 1, size[0], size[1], layout.rows, layout.columns));
    if (!ends_with_marker(stream))
      throw input_error(
          fmt::format("{}: the JPEG stream of frame {} is cut off", to_string(tag::pixel_data), frame + 1));
  }
}

DecodeEnd stream_jpeg2000(const std::vector<Fragment>& streams, const Layout& layout, const FrameSink& sink) {
  SampleReader read(layout);
  for (const auto& stream : streams) {
    auto samples = decode_jpeg2000(stream, layout.rows, layout.columns);
    for (auto& sample : samples) sample = read(static_cast<std::uint32_t>(sample));
    sink(samples);
  }
  return {};
}

/// DCMTK 3.6.8 has other names for it.
bool is_compressed(const DcmXfer& syntax) {
#if OFFIS_DCMTK_VERSION_NUMBER >= 368
  return syntax.usesEncapsulatedFormat() && syntax.isPixelDataCompressed();
#else
  return syntax.isEncapsulated();
#endif
}

}  // namespace

void register_decoders() {
  DJDecoderRegistration::registerCodecs();
  DJLSDecoderRegistration::registerCodecs();
  DcmRLEDecoderRegistration::registerCodecs();
  auto logger = dcmtk::log4cplus::Logger::getRoot();
  logger.removeAllAppenders();
  logger.addAppender(dcmtk::log4cplus::SharedAppenderPtr(new ComplaintCounter(complaints())));
  logger.setLogLevel(dcmtk::log4cplus::WARN_LOG_LEVEL);
}

DecodeEnd decode_pixels(DcmFileFormat& parsed, std::uint64_t byte_limit, const FrameSink& sink) {
  DcmDataset& data_set = *parsed.getDataset();
  OFString stated;
  if (parsed.getMetaInfo()->findAndGetOFString(DCM_TransferSyntaxUID, stated).good() &&
      DcmXfer(stated.c_str()).getXfer() == EXS_Unknown)
    throw unsupported_error(fmt::format("{} {} is not known; convert the study to an uncompressed one",
                                        to_string(tag::transfer_syntax), stated.c_str()));
  DcmPixelData& pixels = pixel_data(data_set);
  Layout layout = read_layout(data_set);
  const DcmXfer syntax(data_set.getOriginalXfer());
  if (!is_compressed(syntax)) {
    const bool misordered =
        syntax.getByteOrder() == EBO_BigEndian && layout.bits_allocated > 8 && pixels.getVR() == EVR_OB;
    if (misordered)
      throw input_error(to_string(tag::pixel_data) + " has 16 bits in OB with big endian: order unknown");
    return stream_raw(pixels, layout, sink);
  }

  check_size(layout, byte_limit);
  const bool jpeg2000 = syntax.getXfer() == EXS_JPEG2000 || syntax.getXfer() == EXS_JPEG2000LosslessOnly;
  const bool run_length = syntax.getXfer() == EXS_RLELossless;
  if (!jpeg2000 && !DcmCodecList::canChangeCoding(syntax.getXfer(), EXS_LittleEndianExplicit))
    throw unsupported_error(
        fmt::format("{} {} ({}) cannot be decoded; convert the study to an uncompressed one",
                    to_string(tag::transfer_syntax), syntax.getXferID(), syntax.getXferName()));
  if (!run_length) {
    const auto streams = streams_of(fragments_of(pixels, syntax.getXfer()), layout.frames);
    if (jpeg2000) return stream_jpeg2000(streams, layout, sink);
    check_jpeg_streams(streams, layout);
  }
  const int complaints_before = complaints();
  const auto decoded = data_set.chooseRepresentation(EXS_LittleEndianExplicit, nullptr);
  if (decoded.bad())
    throw input_error(fmt::format("{} cannot be decoded: {}", to_string(tag::pixel_data), decoded.text()));
  if (complaints() != complaints_before)
    throw input_error(to_string(tag::pixel_data) + ": the compressed stream is damaged");
  layout = read_layout(data_set);  // decoders adapt the bits allocated
  return stream_raw(pixel_data(data_set), layout, sink);
}

}  // namespace emmetrope::segmentation
