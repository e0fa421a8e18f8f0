#include "pipeline/report/content/learnt.hpp"

namespace emmetrope::report {
namespace {

constexpr const char *images = "the images alone", *images_and_readings = "images and other instruments";

}  // namespace

Learnt learnt_since_traced(const EyeData& eye) {
  if (!eye.prescription.is_object()) return Learnt::nothing;
  const Json from = eye.prescription.value("learnt_from", Json::array());
  if (from.empty()) return Learnt::nothing;
  return from == Json::array({"refraction"}) ? Learnt::refraction : Learnt::readings;
}

std::string meshed_from(const CaseData& data, const EyeData& eye) {
  const StageData* meshing = data.stage("meshing");
  const Json::json_pointer readings("/parameters/instruments/" + eye.id());
  return meshing != nullptr && meshing->provenance.contains(readings) ? images_and_readings : images;
}

std::string combined_with(const CaseData& data, const EyeData& eye) {
  return learnt_since_traced(eye) == Learnt::readings ? images_and_readings : meshed_from(data, eye);
}

}  // namespace emmetrope::report
