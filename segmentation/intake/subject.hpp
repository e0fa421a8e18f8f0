#pragma once
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "segmentation/intake/study.hpp"
#include "segmentation/intake/wire.hpp"

namespace emmetrope::segmentation {

/// Collects who the files are about. Identity stays in here: only hashes and file names come out.
class Patients {
 public:
  void add(const std::filesystem::path& file, const ImageHeader& header);
  /// Which two files are of different patients and by which tag; empty when all agree.
  std::string conflict() const;
  Subject subject() const;

 private:
  struct Found {
    std::filesystem::path file;
    std::string value;
  };
  Found first_id_, first_name_, first_birth_date_;
  std::string conflict_;
  Subject subject_;
  bool described_ = false;

  void compare(const Tag& tag, Found& first, const std::filesystem::path& file, const ImageHeader& header);
};

}  // namespace emmetrope::segmentation
