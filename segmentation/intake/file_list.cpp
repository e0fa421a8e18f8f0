#include "segmentation/intake/file_list.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "segmentation/intake/sidecar_files.hpp"
#include "segmentation/intake/wire.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

class Walker {
 public:
  Walker(fs::path root, const IntakeLimits& limits) : limits_(limits) { list_.root = std::move(root); }

  void visit_folder(const fs::path& folder, int depth) {
    if (depth > limits_.depth)
      throw input_error(fmt::format("{}: folders are nested more than {} deep",
                                    (list_.root / folder).string(), limits_.depth));
    std::vector<fs::path> names;
    std::error_code failed;
    for (fs::directory_iterator entry(list_.root / folder, failed), end; !failed && entry != end;
         entry.increment(failed)) {
      names.push_back(entry->path().filename());
      if (names.size() + list_.files.size() > limits_.files)
        throw input_error(fmt::format("{} holds more than {} files", list_.root.string(), limits_.files),
                          "give the folder of one study");
    }
    if (failed) skip(folder, "cannot be listed: " + failed.message());
    // The copies of the images in a case made from this study would be fitted a second time.
    if (std::error_code hidden; depth >= 0 && fs::exists(list_.root / folder / "case.json", hidden))
      return skip(folder, "a case folder of Emmetrope, not images of a scanner");
    // The first of two links to one file stays the same. Hidden ones come last: git-annex keeps the files themselves there.
    std::sort(names.begin(), names.end(), [](const fs::path& a, const fs::path& b) {
      const auto is_hidden = [](const fs::path& name) { return name.c_str()[0] == '.'; };
      return std::pair(is_hidden(a), a) < std::pair(is_hidden(b), b);
    });
    for (const auto& name : names) visit(folder / name, depth);
  }

  void visit(const fs::path& path, int depth) {
    const fs::path full = list_.root / path;
    struct stat status {};
    if (::stat(full.c_str(), &status) != 0) return skip(path, "a link to nothing, or not accessible");
    const bool folder = S_ISDIR(status.st_mode);
    if (!folder && !S_ISREG(status.st_mode)) return skip(path, "not a regular file");
    if (!folder && status.st_size == 0) return skip(path, "empty");
    if (!folder && ::access(full.c_str(), R_OK) != 0) return skip(path, "not readable");
    if (!seen_.insert({status.st_dev, status.st_ino}).second)
      return skip(path, "seen already under another name");
    if (folder) return visit_folder(path, depth + 1);
    list_.files.push_back(path);
  }

  void visit_sidecars() {
    std::set<fs::path> known(list_.files.begin(), list_.files.end());
    for (const SkippedFile& skipped : list_.skipped) known.insert(skipped.file);
    for (const fs::path& file : std::vector(list_.files)) {
      if (!is_nifti_name(file)) continue;
      for (const fs::path& sidecar : sidecars_of(list_.root / file)) {
        const fs::path relative = sidecar.lexically_relative(list_.root);
        const fs::path& name = *relative.begin() == ".." ? sidecar : relative;
        list_.sidecars[file].push_back(name);
        if (known.insert(name).second) visit(name, 0);
      }
    }
  }

  FileList take() {
    visit_sidecars();
    std::sort(list_.files.begin(), list_.files.end());
    return std::move(list_);
  }

 private:
  void skip(const fs::path& path, const std::string& reason) { list_.skipped.push_back({path, reason}); }

  IntakeLimits limits_;
  FileList list_;
  std::set<std::pair<dev_t, ino_t>> seen_;
};

}  // namespace

FileList list_files(const fs::path& study, const IntakeLimits& limits) {
  if (!fs::exists(study))
    throw input_error(study.string() + " does not exist", "give the folder of a DICOM study");
  if (!fs::is_directory(study)) {
    Walker walker(fs::canonical(study.parent_path() / "."), limits);
    walker.visit(study.filename(), 0);
    return walker.take();
  }
  Walker walker(fs::canonical(study), limits);
  walker.visit("", -1);
  return walker.take();
}

}  // namespace emmetrope::segmentation
