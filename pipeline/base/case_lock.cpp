#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/up_to_date.hpp"

// Who may write into a case.
namespace emmetrope {
namespace {

namespace fs = std::filesystem;

constexpr const char* lock_name = ".lock";
constexpr const char* lock_variable =
    "EMMETROPE_CASE_LOCK";  // "<descriptor>" that a driver hands to its stages

bool is_same_file(int descriptor, const fs::path& file) {
  struct stat held {};
  struct stat wanted {};
  return ::fstat(descriptor, &held) == 0 && ::stat(file.c_str(), &wanted) == 0 &&
         held.st_dev == wanted.st_dev && held.st_ino == wanted.st_ino;
}

/// The driver's lock, where this process was started by one and it is for the same case.
std::optional<int> inherited_lock(const fs::path& lock_file) {
  const char* text = std::getenv(lock_variable);
  if (text == nullptr) return std::nullopt;
  const int descriptor = static_cast<int>(std::strtol(text, nullptr, 10));
  return is_same_file(descriptor, lock_file) ? std::optional(descriptor) : std::nullopt;
}

/// The processes of a run that was killed hold its lock until the system has taken them down: wait a moment
/// for that.
bool lock_soon(int descriptor) {
  constexpr auto patience = std::chrono::seconds(3);
  const auto start = std::chrono::steady_clock::now();
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK || std::chrono::steady_clock::now() - start > patience) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

/// Left over from runs that were killed; nobody else writes while we hold the lock.
void remove_leftovers(const fs::path& case_folder) {
  for (const auto& entry : fs::directory_iterator(case_folder)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(".writing-", 0) == 0) fs::remove_all(entry.path());
  }
}

}  // namespace

bool looks_like_a_case(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "case.json", ignored)) return true;
  return std::any_of(pipeline_stages.begin(), pipeline_stages.end(), [&](const PipelineStage& stage) {
    return fs::exists(folder / stage.folder / stage_file, ignored);
  });
}

CaseLock::CaseLock(const fs::path& case_folder, bool create) : folder_(case_folder) {
  std::error_code fault;
  if (create) created_ = fs::create_directories(case_folder, fault);
  if (fault) throw output_error("cannot make the folder " + case_folder.string() + ": " + fault.message());
  if (!fs::is_directory(case_folder))
    throw input_error("the case folder " + case_folder.string() + " does not exist",
                      "make it with: emmetrope segment STUDY -o " + case_folder.string());
  if (!create && !looks_like_a_case(case_folder))
    throw input_error(case_folder.string() + " is no case: it holds neither case.json nor a finished stage",
                      "make one with: emmetrope segment STUDY -o " + case_folder.string());
  const fs::path lock_file = case_folder / lock_name;
  if (const auto inherited = inherited_lock(lock_file)) {
    descriptor_ = *inherited;
    inherited_ = true;
    return;
  }
  descriptor_ = ::open(lock_file.c_str(), O_RDWR | O_CREAT, 0644);
  if (descriptor_ < 0)
    throw output_error("cannot write in the folder " + case_folder.string() + ": " + std::strerror(errno));
  // A lock on a file that its last holder has just removed would keep nobody out.
  if (!lock_soon(descriptor_) || !is_same_file(descriptor_, lock_file)) {
    ::close(descriptor_);
    throw output_error(case_folder.string() + " is in use by another run",
                       "wait for it to end, or write to another folder");
  }
  ::setenv(lock_variable, std::to_string(descriptor_).c_str(), 1);
  remove_leftovers(case_folder);
}

CaseLock::~CaseLock() {
  if (inherited_) return;
  ::unsetenv(lock_variable);
  std::error_code ignored;
  if (!looks_like_a_case(folder_)) {  // nothing came of it: the folder is left as it was found
    fs::remove(folder_ / lock_name, ignored);
    if (created_) fs::remove(folder_, ignored);  // an empty one
  }
  ::close(descriptor_);
}

}  // namespace emmetrope
