// The decoding process: parses and decodes files of unknown origin for its parent, under limits on memory,
// processor time and open files, so that a hostile or damaged file ends this process and nothing else. Not
// for users.
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>

#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "segmentation/intake/dicom_header.hpp"
#include "segmentation/intake/dicom_pixels.hpp"
#include "segmentation/intake/nifti.hpp"

namespace emmetrope::segmentation {
namespace {

void write_all(const void* data, std::size_t size) {
  for (auto* bytes = static_cast<const char*>(data); size > 0;) {
    const ssize_t written = ::write(STDOUT_FILENO, bytes, size);
    if (written < 0) ::_exit(1);  // the parent is gone
    bytes += written;
    size -= static_cast<std::size_t>(written);
  }
}

void send(MessageType type, const void* data, std::uint64_t size) {
  write_all(&type, 1);
  write_all(&size, sizeof size);
  write_all(data, size);
}

void send(MessageType type, const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  send(type, text.data(), text.size());
}

void limit(decltype(RLIMIT_AS) what, rlim_t soft, rlim_t hard) {
  const rlimit value{soft, hard};
  if (::setrlimit(what, &value) != 0) ::_exit(1);
}

/// Processor time used so far by this process.
double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

void decode(const std::filesystem::path& file, std::uint64_t byte_limit) {
  DcmFileFormat parsed;
  const ImageHeader header = read_header(file, parsed);
  send(MessageType::header, Json(header));
  DecodeEnd end;
  if (header.kind == FileKind::image) {
    try {
      end = decode_pixels(parsed, byte_limit, [](const std::vector<std::int32_t>& samples) {
        send(MessageType::frame, samples.data(), samples.size() * sizeof samples[0]);
      });
    } catch (const Error& fault) {
      end.error = fault.what();
      end.unsupported = fault.status() == ExitStatus::unsupported;
    } catch (const std::bad_alloc&) {
      end.error = "needs more memory than the decoder is allowed";
    }
  }
  send(MessageType::end, Json(end));
}

void decode_volume(const std::filesystem::path& file) {
  VolumeHeader header;
  std::vector<std::vector<float>> slices;
  try {
    header.geometry = read_nifti(file, header.warnings);
    slices = std::move(header.geometry.slice_intensity);
  } catch (const Error& fault) {
    header = {{}, {}, fault.what(), fault.remedy(), fault.status()};
  } catch (const std::bad_alloc&) {
    header = {{},
              {},
              file.string() + ": needs more memory than the decoder is allowed",
              {},
              ExitStatus::input_invalid};
  }
  send(MessageType::volume, Json(header));
  for (const std::vector<float>& slice : slices)
    send(MessageType::frame, slice.data(), slice.size() * sizeof slice[0]);
}

int serve([[maybe_unused]] std::uint64_t memory_bytes, std::uint64_t byte_limit, double cpu_s) {
#ifndef __SANITIZE_ADDRESS__  // its shadow memory needs terabytes of address space
  limit(RLIMIT_AS, memory_bytes, memory_bytes);
#endif
  limit(RLIMIT_CORE, 0, 0);
  limit(RLIMIT_FSIZE, 0, 0);
  limit(RLIMIT_NOFILE, 32, 32);
  register_decoders();
  dcmAcceptOddAttributeLength.set(OFFalse);
  if (!dcmDataDict.isDictionaryLoaded()) return 2;
  for (std::string file; std::getline(std::cin, file, '\0');) {
    std::error_code unreadable;
    const double megabytes = static_cast<double>(std::filesystem::file_size(file, unreadable)) / 1e6;
    limit(RLIMIT_CPU, static_cast<rlim_t>(std::ceil(cpu_seconds() + cpu_s + 0.5 * megabytes)), RLIM_INFINITY);
    if (is_nifti_name(file))
      decode_volume(file);
    else
      decode(file, byte_limit);
  }
  return 0;
}

}  // namespace
}  // namespace emmetrope::segmentation

int main(int argc, char** argv) {
  if (argc != 4) {
    const bool asked = argc == 2 && (std::string(argv[1]) == "--help" || std::string(argv[1]) == "--version");
    (asked ? std::cout : std::cerr)
        << "emmetrope-decode " << emmetrope::version()
        << " reads untrusted files for other commands; it is not to be called by hand.\n"
           "Example: emmetrope inventory STUDY\n";
    return asked ? 0 : 2;
  }
  return emmetrope::segmentation::serve(std::strtoull(argv[1], nullptr, 10),
                                        std::strtoull(argv[2], nullptr, 10), std::strtod(argv[3], nullptr));
}
