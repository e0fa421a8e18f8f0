#include "meshing/partial_biometry.hpp"

#include "meshing/retinal_shape.hpp"
#include "pipeline/base/measured.hpp"

namespace emmetrope::meshing {
namespace {

Json meridian(const std::string& reason) {
  return {{"radius_mm", withheld(reason)}, {"power_D", withheld(reason)}, {"axis_deg", withheld(reason)}};
}

}  // namespace

void withhold_cornea(Json& biometry, const std::string& reason) {
  const Json nothing = withheld(reason);
  biometry["corneal_thickness_mm"] = nothing;
  biometry["keratometry"] = {{"flat", meridian(reason)},
                             {"steep", meridian(reason)},
                             {"cylinder_D", nothing},
                             {"asphericity_q", nothing}};
  biometry["astigmatism"] = {{"M_D", nothing},
                             {"J0_D", nothing},
                             {"J45_D", nothing},
                             {"type", nullptr},
                             {"irregularity_um", nothing},
                             {"section_2p3mm", {{"vertical_mm", nothing}, {"horizontal_mm", nothing}}}};
  biometry["cornea_zernike_um"] = nothing;
}

void withhold_front(Json& biometry, const std::string& reason) {
  withhold_cornea(biometry, reason);
  for (const char* name :
       {"axial_length_mm", "optical_axial_length_mm", "anterior_chamber_depth_mm", "lens_thickness_mm",
        "lens_anterior_radius_mm", "lens_posterior_radius_mm", "globe_depth_mm"})
    biometry[name] = withheld(reason);
  biometry["retina"]["volume_mm3"] = withheld(reason);  // it ends at the lens
}

Json edge_biometry_json(const Json& fit, Laterality eye, double retinal_depth_mm) {
  const Json& edges = fit.at("edges");
  const std::string reason = fit.at("withheld").at("fit").get<std::string>();
  Json biometry{{"laterality", to_string(eye)}, {"lps_from_eye", edges.at("lps_from_eye")}};
  for (const char* name : {"axial_length_mm", "optical_axial_length_mm"})
    biometry[name] = edges.at("axial_length_mm");
  if (Json& optical = biometry["optical_axial_length_mm"]; !is_withheld(optical)) {
    auto measured = optical.get<Measured>();
    measured.value += retinal_depth_mm;
    for (double& bound : measured.ci95) bound += retinal_depth_mm;
    optical = measured;
  }
  for (const char* name :
       {"anterior_chamber_depth_mm", "lens_thickness_mm", "globe_width_mm", "globe_height_mm"})
    biometry[name] = edges.at(name);
  biometry.update(ellipsoid_shape_json(edges, reason));
  for (const char* name : {"lens_anterior_radius_mm", "lens_posterior_radius_mm"})
    biometry[name] = withheld(reason);
  withhold_cornea(biometry, reason);
  biometry["head_roll_deg"] = fit.at("head_roll_deg");
  return biometry;
}

}  // namespace emmetrope::meshing
