// The decoding process: parses and decodes files of unknown origin for its parent, under limits on memory,
// processor time and open files and confined by the kernel, so that a hostile or damaged file ends this process
// and nothing else. Not for users.
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>

#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "segmentation/intake/confinement.hpp"
#include "segmentation/intake/dicom_header.hpp"
#include "segmentation/intake/dicom_pixels.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/process_limits.hpp"
#include "segmentation/intake/sidecar.hpp"

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

void decode(const std::filesystem::path& file, Request request, std::uint64_t byte_limit) {
  DcmFileFormat parsed;
  const ImageHeader header = read_header(file, parsed, request);
  send(MessageType::header, Json(header));
  DecodeEnd end;
  if (header.kind == FileKind::image && request == Request::everything) {
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
    header.sidecar = read_sidecar(file, header.geometry, header.warnings);
    slices = std::move(header.geometry.slice_intensity);
  } catch (const Error& fault) {
    header = {{}, {}, {}, fault.what(), fault.remedy(), fault.status()};
  } catch (const std::bad_alloc&) {
    header = {{}, {},
              {}, file.string() + ": needs more memory than the decoder is allowed",
              {}, ExitStatus::input_invalid};
  }
  send(MessageType::volume, Json(header));
  for (const std::vector<float>& slice : slices)
    send(MessageType::frame, slice.data(), slice.size() * sizeof slice[0]);
}

int serve(std::uint64_t memory_bytes, std::uint64_t byte_limit, double cpu_s) {
  limit_process(memory_bytes);
  register_decoders();
  dcmAcceptOddAttributeLength.set(OFFalse);
  if (!dcmDataDict.isDictionaryLoaded()) return no_dictionary;
  confine_process();  // what the kernel does not grant `emmetrope doctor` says
  send(MessageType::ready, "", 0);
  for (std::string asked; std::getline(std::cin, asked, '\0');) {
    const auto request = static_cast<Request>(asked.at(0));
    const std::filesystem::path file = asked.substr(1);
    std::error_code unreadable;
    const double megabytes = static_cast<double>(std::filesystem::file_size(file, unreadable)) / 1e6;
    limit_processor_time(cpu_s + 0.5 * megabytes);
    if (is_nifti_name(file))
      decode_volume(file);
    else
      decode(file, request, byte_limit);
  }
  return 0;
}

}  // namespace
}  // namespace emmetrope::segmentation

int main(int argc, char** argv) {
  if (argc == 2 && std::string(argv[1]) == "--confinement") {
    std::cout << emmetrope::segmentation::confine_process().in_words() << "\n";
    return 0;
  }
  if (argc != 4) {
    const bool asked = argc == 2 && (std::string(argv[1]) == "--help" || std::string(argv[1]) == "--version");
    (asked ? std::cout : std::cerr)
        << "emmetrope-decode " << emmetrope::version()
        << " reads untrusted files for other commands; it is not to be called by hand.\n"
           "Example: emmetrope inventory STUDY\n";
    return asked ? 0 : 2;
  }
  try {
    return emmetrope::segmentation::serve(std::strtoull(argv[1], nullptr, 10),
                                          std::strtoull(argv[2], nullptr, 10), std::strtod(argv[3], nullptr));
  } catch (const std::bad_alloc&) {
    return emmetrope::segmentation::out_of_memory;
  }
}
