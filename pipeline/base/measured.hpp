#pragma once
#include <array>
#include <optional>
#include <string>

#include "pipeline/base/json.hpp"

namespace emmetrope {

/// Where a number comes from.
struct Origin {
  std::string source = "mri";  ///< "mri", "mri+prior", "prior", "keratometry", ...
  /// The part of the information that the images gave, 1 - (sigma / prior's sigma)^2, 0 to 1; none: not known.
  std::optional<double> image_share = {};

  Origin() = default;
  Origin(std::string from) : source(std::move(from)) {}  // NOLINT(google-explicit-constructor)
  Origin(const char* from) : source(from) {}             // NOLINT(google-explicit-constructor)
  /// A number of which images and a prior tell, named by the images' share: the images where they gave more than
  /// half of the information, "prior" below a tenth, both between.
  /// \param images  "mri" or "labels"
  static Origin of_images(const std::string& images, double image_share);
};

/// A measured number: its value, 95 % interval and where it comes from.
/// JSON: {"value": v, "ci95": [lo, hi], "source": "mri" | "prior" | "keratometry" | ..., "image_share": 0 to 1,
/// "method": "fit" | "edges"}
struct Measured {
  double value = 0;
  std::array<double, 2> ci95{0, 0};
  std::string source = "mri";
  std::string method = {};  ///< "fit", or "edges" where a plain reading stands in for it; empty: not told
  std::optional<double> image_share = {};  ///< as in Origin

  /// The normal approximation: value -+ 1.96 sigma.
  static Measured from_sigma(double value, double sigma, Origin origin, std::string method = {});
  /// Half the width of the interval over 1.96.
  double sigma() const { return (ci95[1] - ci95[0]) / (2 * 1.959963985); }
};

void to_json(Json& json, const Measured& measured);
/// A quantity that the images do not support.
Json withheld(const std::string& reason);
bool is_withheld(const Json& quantity);
/// \throw Error (input_invalid) when a key is missing or of another type
void from_json(const Json& json, Measured& measured);

}  // namespace emmetrope
