#pragma once
#include <array>
#include <string>

#include "pipeline/base/json.hpp"

namespace emmetrope {

/// A measured number: its value, 95 % interval and where it comes from.
/// JSON: {"value": v, "ci95": [lo, hi], "source": "mri" | "prior" | "keratometry" | ...,
/// "method": "fit" | "edges"}
struct Measured {
  double value = 0;
  std::array<double, 2> ci95{0, 0};
  std::string source = "mri";
  std::string method = {};  ///< "fit", or "edges" where a plain reading stands in for it; empty: not told

  /// The normal approximation: value -+ 1.96 sigma.
  static Measured from_sigma(double value, double sigma, std::string source, std::string method = {});
  /// Half the width of the interval over 1.96.
  double sigma() const { return (ci95[1] - ci95[0]) / (2 * 1.959963985); }
};

void to_json(Json& json, const Measured& measured);
/// A quantity that the images do not support.
Json withheld(const std::string& reason);
bool is_withheld(const Json& quantity);
/// \throw Error (input_invalid) when a key is missing
void from_json(const Json& json, Measured& measured);

}  // namespace emmetrope
