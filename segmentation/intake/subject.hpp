#pragma once
#include <map>
#include <optional>
#include <string>

#include "segmentation/intake/scanned_series.hpp"
#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {

/// PatientAge, an Age String (PS3.5 6.2): "026Y", "018M", "012W", "100D"; nothing where it is no person's
/// age.
std::optional<double> parse_age_years(const std::string& text);

/// Collects who the files are about. Identity stays in here: only names of files come out.
class Patients {
 public:
  void add(const ScannedFile& file);
  /// Which two files are of different patients and by which tag; empty when all agree.
  std::string conflict() const;
  /// By StudyInstanceUID: between two visits the patient grows older.
  std::map<std::string, Subject> subjects() const;

 private:
  struct Found {
    std::string file;  ///< a mention
    std::string value;
  };
  Found first_id_, first_name_, first_birth_date_;
  bool lacks_id_ = false;  ///< a file so far
  std::string conflict_;
  std::map<std::string, Subject> subjects_;

  void compare(const Tag& tag, Found& first, const ScannedFile& file);
};

}  // namespace emmetrope::segmentation
