#pragma once
#include <filesystem>
#include <string>

#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/trace_options.hpp"

namespace emmetrope::raytrace {

/// A schematic eye or an eye.json, and where what it sees is written: a picture, or a folder of files.
struct NamedEye {
  std::string eye;
  EyeOptions options;  ///< but for the laterality
  std::filesystem::path output;

  /// \throw Error (usage) for an output that is missing or of a kind that cannot be written
  void check() const;
};

/// Both eyes of that form where a pupillary distance is given, else one.
Answer trace_named(const NamedEye& named, const TraceOptions& options, const CommonOptions& common);

}  // namespace emmetrope::raytrace
