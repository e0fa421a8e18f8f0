#pragma once
#include <algorithm>
#include <array>
#include <string>

namespace emmetrope {

/// "YYYY-MM-DD" of a date YYYYMMDD, as DICOM writes it; empty where the text is no day of the calendar.
inline std::string iso_date(const std::string& date) {
  const bool is_of_digits =
      std::all_of(date.begin(), date.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (date.size() != 8 || !is_of_digits) return {};
  const int year = std::stoi(date.substr(0, 4)), month = std::stoi(date.substr(4, 2)),
            day = std::stoi(date.substr(6));
  const bool is_leap_year = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
  const std::array<int, 12> days{31, is_leap_year ? 29 : 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (month < 1 || month > 12 || day < 1 || day > days[static_cast<std::size_t>(month - 1)]) return {};
  return date.substr(0, 4) + "-" + date.substr(4, 2) + "-" + date.substr(6);
}

}  // namespace emmetrope
