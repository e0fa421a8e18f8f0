#pragma once
#include <string>

#include "segmentation/intake/series_checks.hpp"

namespace emmetrope::segmentation {

/// Collects who the files are about. Identity stays in here: only names of files come out.
class Patients {
 public:
  void add(const ScannedFile& file);
  /// Which two files are of different patients and by which tag; empty when all agree.
  std::string conflict() const;
  Subject subject() const;

 private:
  struct Found {
    std::string file;  ///< a mention
    std::string value;
  };
  Found first_id_, first_name_, first_birth_date_;
  std::string conflict_;
  Subject subject_;
  bool described_ = false;

  void compare(const Tag& tag, Found& first, const ScannedFile& file);
};

}  // namespace emmetrope::segmentation
