#pragma once
#include <string>

namespace emmetrope {

/// "YYYY-MM-DD" of a date YYYYMMDD, as DICOM writes it; empty where the text is no day of the calendar from 1400 on.
std::string iso_date(const std::string& date);

}  // namespace emmetrope
