#include "pipeline/base/write_beside.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope {
namespace {

bool synced(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool done = ::fsync(descriptor) == 0;
  return ::close(descriptor) == 0 && done;
}

}  // namespace

void write_beside(const std::filesystem::path& file,
                  const std::function<bool(const std::filesystem::path& part)>& write) {
  require_replaceable(file);
  std::filesystem::path part = file;
  part.replace_filename(file.stem().string() + "." + std::to_string(::getpid()) + file.extension().string());
  try {
    errno = 0;
    if (!write(part) || !synced(part) || ::rename(part.c_str(), file.c_str()) != 0)
      throw output_error(
          "cannot write " + file.string() + (errno != 0 ? std::string(": ") + std::strerror(errno) : ""),
          "check the folder, its permissions and the room on its disk");
  } catch (...) {
    ::unlink(part.c_str());
    throw;
  }
}

}  // namespace emmetrope
