#include "segmentation/intake/sidecar_files.hpp"

#include <algorithm>
#include <optional>
#include <set>
#include <string>

#include "pipeline/base/files.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

/// "sub-01_acq-fast_T1w": entities, then the suffix.
struct BidsName {
  std::set<std::string> entities;
  std::string suffix;

  explicit BidsName(const std::string& stem) {
    std::size_t first = 0;
    for (std::size_t end = stem.find('_'); end != std::string::npos; end = stem.find('_', first)) {
      entities.insert(stem.substr(first, end - first));
      first = end + 1;
    }
    suffix = stem.substr(first);
  }
  bool applies_to(const BidsName& image) const {
    return suffix == image.suffix &&
           std::includes(image.entities.begin(), image.entities.end(), entities.begin(), entities.end());
  }
};

/// From the volume's to that of the dataset; none where it is in no dataset.
std::vector<fs::path> folders_in_dataset(const fs::path& volume) {
  std::vector<fs::path> folders;
  for (fs::path folder = volume.parent_path(); !folder.empty(); folder = folder.parent_path()) {
    folders.push_back(folder);
    if (is_file(folder / "dataset_description.json")) return folders;
    if (folder == folder.root_path()) break;
  }
  return {};
}

/// BIDS allows one a folder; of several the one with most entities, which applies to the fewest images.
std::optional<fs::path> inherited_from(const fs::path& folder, const BidsName& image) {
  std::optional<fs::path> nearest;
  std::size_t most = 0;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end; entry.increment(failed)) {
    const fs::path& file = entry->path();
    const BidsName name(file.stem().string());
    if (file.extension() != ".json" || !name.applies_to(image) || !is_file(file)) continue;
    if (!nearest || std::pair(most, *nearest) < std::pair(name.entities.size(), file)) {
      most = name.entities.size();
      nearest = file;
    }
  }
  return nearest;
}

}  // namespace

fs::path sidecar_of(fs::path volume) {
  if (volume.extension() == ".gz") volume.replace_extension();
  return volume.replace_extension(".json");
}

std::vector<fs::path> sidecars_of(const fs::path& volume) {
  std::vector<fs::path> sidecars;
  const fs::path own = sidecar_of(volume);
  std::error_code unreadable;
  if (is_file(own) || fs::is_symlink(own, unreadable)) sidecars.push_back(own);
  const std::string stem = own.stem().string();
  if (stem.rfind("sub-", 0) != 0) return sidecars;
  for (const fs::path& folder : folders_in_dataset(volume)) {
    const bool has_own = folder == volume.parent_path() && !sidecars.empty();
    if (auto file = has_own ? std::nullopt : inherited_from(folder, BidsName(stem)))
      sidecars.push_back(*std::move(file));
  }
  return sidecars;
}

}  // namespace emmetrope::segmentation
