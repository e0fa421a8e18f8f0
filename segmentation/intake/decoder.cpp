#include "segmentation/intake/decoder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>
#include <vector>

#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/memory_limit.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

using Clock = std::chrono::steady_clock;

/// Longer messages than any sane file needs are taken as a fault of the child.
constexpr std::uint64_t longest_json = 64'000'000;

/// The child ended or broke the protocol; the text says how.
struct ChildFailure {
  std::string text;
  bool hung = false;
};

/// Of one frame on the wire, 0 when the header does not say.
std::uint64_t frame_bytes(const ImageHeader& header) {
  const double rows = parse_number(header.value(tag::rows)).value_or(0);
  const double columns = parse_number(header.value(tag::columns)).value_or(0);
  const bool possible = rows > 0 && rows < 65'536 && columns > 0 && columns < 65'536;
  return possible
             ? static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) * sizeof(std::int32_t)
             : 0;
}

std::filesystem::path decoder_executable() {
  const auto here = executable_folder();
  std::vector<std::filesystem::path> folders{here, here.parent_path() / "bin"};
  // Another program that uses the library finds it where it finds the commands.
  const char* path = std::getenv("PATH");
  std::istringstream listed(path == nullptr ? "" : path);
  for (std::string folder; std::getline(listed, folder, ':');) folders.emplace_back(folder);
  for (const auto& folder : folders)
    if (std::filesystem::exists(folder / "emmetrope-decode")) return folder / "emmetrope-decode";
  throw Error(ExitStatus::fault, "emmetrope-decode is neither beside " + here.string() + " nor on the PATH",
              "install Emmetrope again with cmake --install");
}

ChildFailure failure_of(int status) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGXCPU) return {"took more processor time than the decoder is allowed", true};
    return {fmt::format("crashed the decoder (signal {}, {})", signal, ::strsignal(signal))};
  }
  if (WEXITSTATUS(status) == out_of_memory) return {"needs more memory than the decoder is allowed"};
  return {fmt::format("ended the decoder with status {}", WEXITSTATUS(status))};
}

}  // namespace

/// One running emmetrope-decode.
class Decoder::Child {
 public:
  explicit Child(const IntakeLimits& limits) {
    const std::string program = decoder_executable();
    std::array<std::string, 4> words{program, std::to_string(limits.child_memory_bytes),
                                     std::to_string(limits.file_bytes), fmt::format("{}", limits.cpu_s)};
    std::array<char*, 5> arguments{words[0].data(), words[1].data(), words[2].data(), words[3].data(),
                                   nullptr};
    // Nothing of the caller's environment: DCMTK's dictionary path and the locale could change what is read.
    std::string locale = "LC_ALL=C";
    std::array<char*, 2> environment{locale.data(), nullptr};

    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, to_child_.ends[0], STDIN_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, from_child_.ends[1], STDOUT_FILENO);
    // What libraries say may quote patient data.
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addclosefrom_np(&actions, 3);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    const int failure = ::posix_spawn(&process_, program.c_str(), &actions, &attributes, arguments.data(),
                                      environment.data());
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&actions);
    if (failure != 0)
      throw Error(ExitStatus::fault, "cannot start " + program + ": " + std::strerror(failure));
    to_child_.close(0);
    from_child_.close(1);
    ::fcntl(from_child_.ends[0], F_SETPIPE_SZ, 1 << 20);
    end_on_interrupt_ = std::make_unique<EndOnInterrupt>(process_);
    await_start();
  }

  ~Child() {
    to_child_.close(1);
    if (process_ > 0) stop();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void ask(const std::filesystem::path& file, Request request) {
    const std::string asked = static_cast<char>(request) + file.string() + '\0';
    for (std::size_t done = 0; done < asked.size();) {
      const ssize_t written = ::write(to_child_.ends[1], asked.data() + done, asked.size() - done);
      if (written < 0 && errno != EINTR) fail();
      if (written > 0) done += static_cast<std::size_t>(written);
    }
  }

  void read(void* target, std::size_t size, Clock::time_point deadline) {
    for (auto* bytes = static_cast<char*>(target); size > 0;) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
      pollfd waiting{from_child_.ends[0], POLLIN, 0};
      const int ready =
          left <= 0 ? 0 : ::poll(&waiting, 1, static_cast<int>(std::min<long long>(left, 1'000'000)));
      if (ready == 0) {
        stop();
        throw ChildFailure{"took longer than the decoder is allowed", true};
      }
      if (ready < 0 && errno == EINTR) continue;
      const ssize_t got = ::read(from_child_.ends[0], bytes, size);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) fail();
      bytes += got;
      size -= static_cast<std::size_t>(got);
    }
  }

  /// Type and length of the next message.
  std::pair<MessageType, std::uint64_t> read_start(Clock::time_point deadline) {
    std::pair<MessageType, std::uint64_t> start;
    read(&start.first, sizeof start.first, deadline);
    read(&start.second, sizeof start.second, deadline);
    return start;
  }

  Json read_json(std::uint64_t size, Clock::time_point deadline) {
    if (size > longest_json) throw ChildFailure{"made the decoder answer nonsense"};
    std::string text(size, '\0');
    read(text.data(), size, deadline);
    return Json::parse(text);
  }

 private:
  /// A decoder that does not even start is the machine's fault, not that of the file that it was to read.
  void await_start() {
    try {
      if (read_start(Clock::now() + std::chrono::seconds(60)).first == MessageType::ready) return;
      throw ChildFailure{"does not answer as one"};
    } catch (const ChildFailure& failure) {
      if (process_ > 0) stop();
      throw Error(ExitStatus::fault, "emmetrope-decode does not start: it " + failure.text,
                  "give it more memory and processes" + memory_limit_note());
    }
  }

  /// A pipe broke: says how the child ended. One that lives on is ended.
  [[noreturn]] void fail() {
    const auto deadline = Clock::now() + std::chrono::seconds(1);
    int status = 0;
    while (::waitpid(process_, &status, WNOHANG) != process_) {
      if (Clock::now() > deadline) {
        stop();
        throw ChildFailure{"broke the pipe to the decoder"};
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    end_on_interrupt_.reset();
    process_ = -1;
    if (WIFEXITED(status) && WEXITSTATUS(status) == no_dictionary)
      throw Error(ExitStatus::fault, "DCMTK's data dictionary is not installed",
                  "install the package dcmtk-data (libdcmtk17 on Debian 12)");
    throw failure_of(status);
  }

  void stop() {
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
    end_on_interrupt_.reset();
    process_ = -1;
  }

  struct Pipe {
    std::array<int, 2> ends{-1, -1};
    Pipe() {
      if (::pipe2(ends.data(), O_CLOEXEC) != 0)
        throw Error(ExitStatus::fault, std::string("cannot make a pipe: ") + std::strerror(errno));
    }
    ~Pipe() {
      close(0);
      close(1);
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;
    void close(int end) {
      if (ends[end] >= 0) ::close(std::exchange(ends[end], -1));
    }
  };

  Pipe to_child_, from_child_;
  pid_t process_ = -1;
  std::unique_ptr<EndOnInterrupt> end_on_interrupt_;
};

Decoder::Decoder(const IntakeLimits& limits) : limits_(limits) {}
Decoder::~Decoder() = default;

Decoder::File Decoder::decode(const std::filesystem::path& file, const FrameSink& sink) {
  return decode(file, Request::everything, sink);
}

ImageHeader Decoder::header(const std::filesystem::path& file) {
  return decode(file, Request::header, [](int, const std::vector<std::int32_t>&) {}).header;
}

Decoder::File Decoder::decode(const std::filesystem::path& file, Request request, const FrameSink& sink) {
  File result;
  if (hangs_ >= limits_.hanging_files) {
    result.header = {FileKind::damaged,
                     fmt::format("not read, as {} files before it never came to an end", hangs_)};
    return result;
  }
  bool header_read = false;
  try {
    const auto deadline = ask(file, request);
    std::vector<std::int32_t> samples;
    for (int frame = 0;;) {
      const auto [type, size] = child_->read_start(deadline);
      if (type == MessageType::frame) {
        if (!header_read || size != frame_bytes(result.header))
          throw ChildFailure{"made the decoder answer nonsense"};
        samples.resize(size / sizeof samples[0]);
        child_->read(samples.data(), size, deadline);
        sink(frame++, samples);
        continue;
      }
      const Json json = child_->read_json(size, deadline);
      if (type == MessageType::header) {
        json.get_to(result.header);
        header_read = true;
      } else {
        json.get_to(result.end);
        return result;
      }
    }
  } catch (const ChildFailure& failure) {
    child_.reset();
    hangs_ += failure.hung ? 1 : 0;
    if (header_read)
      result.end.error = to_string(tag::pixel_data) + " " + failure.text;
    else
      result.header = {FileKind::damaged, failure.text};
  } catch (const Json::exception&) {
    child_.reset();
    result.header = {FileKind::damaged, "made the decoder answer nonsense"};
  }
  return result;
}

Clock::time_point Decoder::ask(const std::filesystem::path& file, Request request) {
  if (!child_) child_ = std::make_unique<Child>(limits_);
  std::error_code unreadable;
  const double megabytes = static_cast<double>(std::filesystem::file_size(file, unreadable)) / 1e6;
  child_->ask(file, request);
  return Clock::now() +
         std::chrono::milliseconds(static_cast<long long>(1000 * (limits_.wall_s + megabytes)));
}

Decoder::Volume Decoder::decode_volume(const std::filesystem::path& file) {
  const std::string name = file.string();
  try {
    const auto deadline = ask(file, Request::everything);
    const auto [type, size] = child_->read_start(deadline);
    if (type != MessageType::volume) throw ChildFailure{"made the decoder answer nonsense"};
    auto header = child_->read_json(size, deadline).get<VolumeHeader>();
    if (!header.error.empty()) throw Error(header.status, header.error, header.remedy);
    Stack stack = std::move(header.geometry);
    const std::size_t voxels = static_cast<std::size_t>(stack.rows) * static_cast<std::size_t>(stack.columns);
    for (int slice = 0; slice < stack.slices(); ++slice) {
      const auto [of_slice, bytes] = child_->read_start(deadline);
      if (of_slice != MessageType::frame || bytes != voxels * sizeof(float))
        throw ChildFailure{"made the decoder answer nonsense"};
      stack.slice_intensity.emplace_back(voxels);
      child_->read(stack.slice_intensity.back().data(), bytes, deadline);
    }
    return {std::move(stack), std::move(header.sidecar), std::move(header.warnings)};
  } catch (const ChildFailure& failure) {
    child_.reset();
    throw input_error(fmt::format("{}: {}", name, failure.text));
  } catch (const Json::exception&) {
    child_.reset();
    throw input_error(name + ": made the decoder answer nonsense");
  }
}

}  // namespace emmetrope::segmentation
