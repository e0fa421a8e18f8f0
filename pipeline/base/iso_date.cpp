#include "pipeline/base/iso_date.hpp"

#include <algorithm>
#include <boost/date_time/gregorian/gregorian.hpp>
#include <stdexcept>

namespace emmetrope {

std::string iso_date(const std::string& date) {
  const bool is_of_digits =
      std::all_of(date.begin(), date.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (date.size() != 8 || !is_of_digits) return {};
  try {
    return boost::gregorian::to_iso_extended_string(boost::gregorian::from_undelimited_string(date));
  } catch (const std::out_of_range&) {
    return {};
  }
}

}  // namespace emmetrope
