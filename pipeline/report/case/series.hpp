#pragma once
#include <string>
#include <vector>

#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/document/document.hpp"

/// The images behind a case, as case.json tells them.
namespace emmetrope::report {

struct Series {
  std::string stack, description, contrast;
  std::string number;  ///< of the series in the study; empty where unknown
  std::string plane;   ///< "axial", "coronal" or "sagittal", the nearest
  double pixel_mm = 0, slice_mm = 0, field_strength_T = 0;
  int slices = 0;
  bool is_used = false;
  std::string reason;  ///< why it is used or not

  /// "T2, sagittal, 0.31 x 0.31 x 2.00 mm, 3 T"
  std::string in_words() const;
};

/// The series that a stack was made of, used or not.
std::vector<Series> series_of(const CaseData& data);
std::vector<Series> used_series(const CaseData& data);

Table series_table(const CaseData& data);

}  // namespace emmetrope::report
