#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/fuzz/mutations.hpp"

/// Every way by which bytes of unknown origin come in, as a function of a file.
namespace emmetrope::fuzz {

struct Door {
  std::string name;
  std::string file;  ///< name of the file, as its ending tells the reader what it is
  /// Whole inputs of that kind, made into a folder.
  std::function<std::vector<std::string>(const std::filesystem::path& folder)> seeds;
  std::function<std::string(const std::string& input, Random& random)> mutate;
  /// Reads the file. An Error is a refusal; whatever else is thrown, a crash or a hang is a fault.
  std::function<void(const std::filesystem::path& file)> open;
};

const std::vector<Door>& doors();

}  // namespace emmetrope::fuzz
