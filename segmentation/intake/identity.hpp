#pragma once
#include <array>
#include <set>
#include <string>
#include <vector>

#include "segmentation/intake/wire.hpp"

namespace emmetrope::segmentation {

/// What identifies the patient, or by whom, where and when the images were made, in the headers of a study, to be taken
/// out of its free texts: people type names and numbers into series descriptions.
class Identity {
 public:
  /// Notes names of patient, mother, responsible person, physicians and operators, numbers of patient, record, trial
  /// subject, accession, study, admission, order, procedure, telephone and device, address, institution,
  /// station and who issued the patient's number, the dates of birth, study, series and acquisition.
  void add(const ImageHeader& header);
  /// The text with "[removed]" in place of each part of a name (3 letters or more; 2 where letters are words; one
  /// letter less where two parts stand together), each number, issuer, institution and station as a whole, and the dates
  /// in their usual spellings, the month as a number or as a word of whatever language; whatever the case, with accents,
  /// without or spelt out (Müller, Muller, Mueller), and what has 5 letters and digits or more however it is punctuated.
  std::string removed_from(const std::string& text) const;
  /// The same of the header's free texts and of its image types, whose terms stay; its own identifying values go.
  void remove_from(ImageHeader& header) const;

 private:
  void add_name(const std::string& name);
  void add_whole(const std::string& text);
  void add_number(const std::string& text);
  void add_date(const std::string& date);
  std::string removed_from_type(const std::string& type) const;
  std::set<std::u32string> terms_;       ///< folded
  std::set<std::u32string> pairs_;       ///< two parts of a name of which one is too short to tell alone
  std::set<std::u32string> punctuated_;  ///< numbers and dates, found however a text punctuates them
  std::set<std::array<int, 3>> dates_;   ///< year, month, day
};

}  // namespace emmetrope::segmentation
