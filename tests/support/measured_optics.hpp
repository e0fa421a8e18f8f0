#pragma once
#include <cmath>

#include "pipeline/base/json.hpp"

namespace emmetrope {

/// A measured eye as the mesh stage describes it, with an oblique cornea and a tilted lens.
inline Json measured_optics() {
  const double c = 1 / 7.8, cylinder = 0.006;
  const double j0 = cylinder * std::cos(0.7), j45 = cylinder * std::sin(0.7), ratio = 0.83;
  const double axis_deg = 0.35 * 180 / 3.14159265358979;
  const auto cornea = [&](const char* name, double position_mm, double scale, const char* medium) {
    return Json{{"name", name},
                {"type", "biconic"},
                {"position_mm", position_mm},
                {"radius_mm", {1 / (scale * (c + cylinder)), 1 / (scale * (c - cylinder))}},
                {"q", {-0.2, -0.2}},
                {"axis_deg", axis_deg},
                {"medium_after", medium}};
  };
  Json eye;
  eye["name"] = "measured";
  eye["reference_wavelength_nm"] = 589.3;
  eye["media"] = {{"cornea", {{"index", 1.376}}},
                  {"aqueous", {{"index", 1.336}}},
                  {"lens", {{"index", 1.4254}}},
                  {"vitreous", {{"index", 1.336}}}};
  eye["surfaces"] = {cornea("cornea_anterior", 0, 1, "cornea"),
                     cornea("cornea_posterior", 0.55, 1 / ratio, "aqueous"),
                     {{"name", "iris"}, {"type", "stop"}, {"position_mm", 3.4}, {"diameter_mm", 3.0}},
                     {{"name", "lens_anterior"},
                      {"type", "conic"},
                      {"position_mm", 3.4},
                      {"radius_mm", 10.5},
                      {"q", -3},
                      {"medium_after", "lens"}},
                     {{"name", "lens_posterior"},
                      {"type", "conic"},
                      {"position_mm", 7.2},
                      {"radius_mm", -6.0},
                      {"q", -1},
                      {"medium_after", "vitreous"}},
                     {{"name", "retina"}, {"type", "sphere"}, {"position_mm", 24.0}, {"radius_mm", -12.0}}};
  const std::vector<std::string> names{"cornea_c_per_mm",           "cornea_j0_per_mm",
                                       "cornea_j45_per_mm",         "cornea_q",
                                       "cornea_back_ratio",         "cornea_thickness_mm",
                                       "anterior_chamber_depth_mm", "lens_thickness_mm",
                                       "lens_anterior_radius_mm",   "lens_posterior_radius_mm",
                                       "optical_axial_length_mm",   "lens_tilt_x_deg",
                                       "lens_tilt_y_deg",           "lens_anterior_q",
                                       "lens_posterior_q",          "lens_decentre_x_mm",
                                       "lens_decentre_y_mm"};
  const std::vector<double> values{c,   j0,   j45, -0.2, ratio, 0.55, 3.4, 3.8, 10.5,
                                   6.0, 24.0, 0,   0,    -3,    -1,   0,   0};
  const std::vector<double> sigma{0.0016, 0.0006, 0.0006, 0.1, 0.015, 0.03, 0.02, 0.02, 0.5,
                                  0.3,    0.03,   1.5,    1.5, 1.0,   0.5,  0.1,  0.1};
  Json covariance = Json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::vector<double> row(names.size(), 0.0);
    row[i] = sigma[i] * sigma[i];
    // Deeper chamber, thinner lens: as a fit finds them.
    if (i == 6) row[7] = -0.5 * sigma[6] * sigma[7];
    if (i == 7) row[6] = -0.5 * sigma[6] * sigma[7];
    covariance.push_back(row);
  }
  return {{"eye", eye},
          {"parameters", names},
          {"values", values},
          {"covariance", covariance},
          {"sources", std::vector<std::string>(names.size(), "mri")},
          {"prior_sigmas", std::vector<Json>(names.size(), nullptr)}};
}

}  // namespace emmetrope
