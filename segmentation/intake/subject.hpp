#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "segmentation/intake/scanned_series.hpp"
#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {

/// PatientAge, an Age String (PS3.5 6.2): "026Y", "018M", "012W", "100D"; nothing where it is no person's
/// age ("000Y", more than 110 years).
std::optional<double> parse_age_years(const std::string& text);

/// The tag by which two series are not of one person at one visit; empty where none says so.
std::string contradiction(const TagValues& one, const TagValues& other);

/// Collects who the files are about. Identity stays in here: only names of files come out.
class Patients {
 public:
  void add(const ScannedFile& file);
  /// Which two files are of different patients and by which tag; empty when all agree.
  std::string conflict() const;
  /// What is odd of the patient in the files of a series: an age that is no person's or contradicts the dates; sexes,
  /// ages, issuers of PatientID or dates of the study that differ. The values are not told.
  std::vector<std::string> warnings(const std::string& series_uid) const;
  /// By SeriesInstanceUID and keyword: who was scanned when, as far as headers say, which is compared and not told.
  std::map<std::string, TagValues> visits() const;
  /// By StudyInstanceUID: between two visits the patient grows older.
  std::map<std::string, Subject> subjects() const;

 private:
  struct Found {
    std::string file;  ///< a mention
    std::string value;
  };
  struct OfSeries {
    std::map<std::string, Found> first;           ///< by keyword
    std::map<std::string, std::string> warnings;  ///< one of each subject
  };
  Found first_id_, first_name_, first_birth_date_;
  bool lacks_id_ = false;  ///< a file so far
  std::string conflict_;
  std::map<std::string, Subject> subjects_;
  std::map<std::string, OfSeries> series_;  ///< by SeriesInstanceUID

  void compare(const Tag& tag, Found& first, const ScannedFile& file);
  void compare_within_series(const ScannedFile& file);
};

}  // namespace emmetrope::segmentation
