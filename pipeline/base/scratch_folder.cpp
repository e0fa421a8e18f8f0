#include "pipeline/base/scratch_folder.hpp"

#include "pipeline/base/error.hpp"

namespace emmetrope {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(fs::path path) : path_(std::move(path)), on_interrupt_(path_) {
  std::error_code fault;
  fs::remove_all(path_, fault);
  fs::create_directories(path_, fault);
  if (fault) throw output_error("cannot make the folder " + path_.string() + ": " + fault.message());
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace emmetrope
