#include "pipeline/base/files.hpp"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return value_; }
  /// The result of close(), which a full disk may only show here.
  int close() { return ::close(std::exchange(value_, -1)); }

 private:
  int value_;
};

/// SHA-256 over pieces.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void add(const void* bytes, std::size_t size) { EVP_DigestUpdate(context_.get(), bytes, size); }
  std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    static constexpr char digits[] = "0123456789abcdef";
    std::string text;
    for (unsigned i = 0; i < size; ++i) {
      text += digits[digest[i] >> 4];
      text += digits[digest[i] & 15];
    }
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

[[noreturn]] void throw_not_written(const std::filesystem::path& file, int reason) {
  throw output_error(
      "cannot write " + file.string() + ": " + std::strerror(reason),
      reason == ENOSPC || reason == EFBIG ? "free some disk space" : "check the folder and its permissions");
}

/// A device or a pipe may never end.
void require_regular_file(const std::filesystem::path& file) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(file, status))
    throw input_error("cannot read " + file.string() + ": it is not a regular file or does not exist");
}

void read_blocks(const std::filesystem::path& file,
                 const std::function<void(const char*, std::size_t)>& take) {
  require_regular_file(file);
  const auto fail = [&] { throw input_error("cannot read " + file.string() + ": " + std::strerror(errno)); };
  Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.get() < 0) fail();
  std::array<char, 1 << 16> block{};
  while (true) {
    const ssize_t size = ::read(descriptor.get(), block.data(), block.size());
    if (size == 0) return;
    if (size > 0) take(block.data(), static_cast<std::size_t>(size));
    if (size < 0 && errno != EINTR) fail();
  }
}

}  // namespace

bool is_file(const std::filesystem::path& path) {
  std::error_code none;
  return std::filesystem::is_regular_file(path, none);
}

std::string read_file(const std::filesystem::path& file) {
  std::string bytes;
  read_blocks(file, [&](const char* block, std::size_t size) { bytes.append(block, size); });
  return bytes;
}

void require_replaceable(const std::filesystem::path& file) {
  std::error_code none;
  const std::filesystem::file_status status = std::filesystem::status(file, none);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw output_error("cannot write " + file.string() + ": it is there and no regular file",
                       "name another file");
}

void write_file(const std::filesystem::path& file, std::string_view bytes) {
  require_replaceable(file);
  const std::string name = file.string() + "." + std::to_string(::getpid());
  Descriptor descriptor(::open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (descriptor.get() < 0) throw_not_written(file, errno);
  try {
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t written = ::write(descriptor.get(), bytes.data() + done, bytes.size() - done);
      if (written < 0 && errno != EINTR) throw_not_written(file, errno);
      if (written > 0) done += static_cast<std::size_t>(written);
    }
    if (::fsync(descriptor.get()) != 0 || descriptor.close() != 0) throw_not_written(file, errno);
    if (::rename(name.c_str(), file.c_str()) != 0) throw_not_written(file, errno);
  } catch (...) {
    ::unlink(name.c_str());
    throw;
  }
}

std::string sha256_of(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes.data(), bytes.size());
  return hash.hex();
}

std::string sha256_of_file(const std::filesystem::path& file) {
  Sha256 hash;
  read_blocks(file, [&](const char* block, std::size_t size) { hash.add(block, size); });
  return hash.hex();
}

std::filesystem::path executable_folder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

std::filesystem::path data_folder() {
  const auto installed = executable_folder() / ".." / "share" / "emmetrope";
  if (std::filesystem::is_directory(installed)) return std::filesystem::canonical(installed);
  std::filesystem::path source = EMMETROPE_SOURCE_FOLDER;
  if (std::filesystem::is_directory(source)) return source;
  throw Error(ExitStatus::fault,
              "the program's data are neither in " + installed.string() + " nor in " + source.string(),
              "install Emmetrope again with cmake --install");
}

}  // namespace emmetrope
