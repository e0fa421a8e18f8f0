#include "correction/search/real_lenses.hpp"

#include <algorithm>
#include <array>

#include "pipeline/base/error.hpp"
#include "pipeline/base/notation.hpp"
#include "raytrace/spectacle/base_curve.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::correction {
namespace {

/// Makers' data at the d line.
constexpr std::array<LensMaterial, 7> materials{{{"cr39", 1.498, 58},
                                                 {"trivex", 1.530, 44},
                                                 {"polycarbonate", 1.586, 30},
                                                 {"1.60", 1.600, 41},
                                                 {"1.67", 1.670, 32},
                                                 {"1.74", 1.740, 33},
                                                 {"crown", 1.523, 59}}};

/// A search from the thin lens's answer stays near it.
constexpr double reach_D = 3;

PowerVector as_power(const Eigen::VectorXd& lens) { return {lens[0], lens[1], lens[2]}; }

RealLens ascend_from(const raytrace::Tracer& tracer, const std::shared_ptr<const raytrace::Scene>& scene,
                     const EyeModel& eye, const ImagingLevel& level, const LensFamily& family,
                     const PowerVector& start) {
  const RetinalSharpness sharpness(tracer, scene, eye, family, level);
  const Optimum optimum = ascend(sharpness, as_vector(start));
  RealLens lens;
  lens.kind = family.name;
  lens.power = family.power(optimum.lens);
  lens.sharpness = optimum.sharpness;
  if (!optimum.converged) lens.reason = "the search did not converge: " + optimum.reason;
  lens.images = sharpness.images();
  return lens;
}

}  // namespace

LensMaterial lens_material(const std::string& name) {
  std::string known;
  for (const LensMaterial& material : materials) {
    if (name == material.name) return material;
    known += std::string(known.empty() ? "" : ", ") + material.name;
  }
  throw usage_error("--material \"" + name + "\" is not known", "choose " + known);
}

LensFamily toric_meniscus(const EyeModel& eye, const SpectacleSettings& spectacle, double vertex_distance_mm,
                          const PowerVector& about) {
  if (vertex_distance_mm == 0)
    throw usage_error("a toric meniscus is a spectacle lens, and none stands on the cornea");
  raytrace::Meniscus lens;
  lens.power = about;
  lens.vertex_distance_mm = vertex_distance_mm;
  lens.base_D = spectacle.base_D.value_or(raytrace::base_by_vogel_D(about.M_D));
  lens.centre_thickness_mm = spectacle.centre_thickness_mm;
  lens.semi_diameter_mm = spectacle.semi_diameter_mm;
  lens.index = spectacle.material.index;
  lens.abbe = spectacle.material.abbe;
  // Blanks differ in their backs: front and thickness are those of the lens in the middle.
  const EyeModel middle = raytrace::with_meniscus(eye, lens);
  lens.centre_thickness_mm =
      middle.surface("spectacle_back").position_mm - middle.surface("spectacle_front").position_mm;
  const Eigen::Vector3d centre = as_vector(about);
  return {"toric meniscus",
          {centre.array() - reach_D, centre.array() + reach_D},
          [=](const EyeModel& bare, const Eigen::VectorXd& power) {
            raytrace::Meniscus ground = lens;
            ground.power = as_power(power);
            return raytrace::with_meniscus(bare, ground);
          },
          as_power};
}

std::vector<RealLens> sharpest_real_lenses(const raytrace::Tracer& tracer,
                                           const std::shared_ptr<const raytrace::Scene>& scene,
                                           const EyeModel& eye, const ImagingLevel& level,
                                           const SpectacleSettings& spectacle, const PowerVector& thin,
                                           double vertex_distance_mm) {
  std::vector<RealLens> lenses;
  RealLens& meniscus = lenses.emplace_back();
  try {
    const LensFamily family = toric_meniscus(eye, spectacle, vertex_distance_mm, thin);
    meniscus = ascend_from(tracer, scene, eye, level, family, thin);
    const EyeModel worn = family.before(eye, as_vector(meniscus.power));
    const Surface &front = worn.surface("spectacle_front"), &back = worn.surface("spectacle_back");
    meniscus.base_D = spectacle.base_D.value_or(raytrace::base_by_vogel_D(thin.M_D));
    meniscus.centre_thickness_mm = back.position_mm - front.position_mm;
  } catch (const Error& error) {
    if (error.status() != ExitStatus::usage) throw;
    meniscus.kind = "toric meniscus";
    meniscus.reason = error.what();
  }
  meniscus.vertex_distance_mm = vertex_distance_mm;
  const PowerVector at_cornea = move_towards_eye(thin, vertex_distance_mm);
  LensFamily contact = thin_lens(0);
  contact.name = "contact lens";
  // A strong plus lens is stronger yet on the cornea than any that is sought in front of it.
  contact.bounds = {as_vector(at_cornea).array() - reach_D, as_vector(at_cornea).array() + reach_D};
  lenses.push_back(ascend_from(tracer, scene, eye, level, contact, at_cornea));
  return lenses;
}

std::string name_sharpest(std::vector<RealLens> lenses) {
  lenses.erase(
      std::remove_if(lenses.begin(), lenses.end(), [](const RealLens& lens) { return !lens.reason.empty(); }),
      lenses.end());
  std::sort(lenses.begin(), lenses.end(),
            [](const RealLens& a, const RealLens& b) { return a.sharpness > b.sharpness; });
  if (lenses.empty()) return {};
  const bool equal =
      lenses.size() > 1 && lenses[1].sharpness > (1 - sharpness_repeatability) * lenses[0].sharpness;
  return equal ? "equal" : lenses[0].kind;
}

Json lenses_json(const std::vector<RealLens>& lenses, const SpectacleSettings& spectacle) {
  Json json = Json::array();
  for (const RealLens& lens : lenses) {
    Json one = {{"kind", lens.kind}, {"vertex_distance_mm", lens.vertex_distance_mm}};
    if (lens.reason.empty()) {
      const SpheroCylinder notation = to_sphero_cylinder(lens.power);
      one["sphere_D"] = notation.sphere_D;
      one["cylinder_D"] = notation.cylinder_D;
      one["axis_deg"] = notation.axis_deg;
      one["text"] = format_refraction(notation);
      one["rounded_text"] = format_refraction(round_refraction(lens.power).refraction);
      one["sharpness"] = lens.sharpness;
    } else {
      one["reason"] = lens.reason;
    }
    if (lens.centre_thickness_mm) {
      one["material"] = spectacle.material.name;
      one["index"] = spectacle.material.index;
      one["abbe"] = spectacle.material.abbe;
      one["base_D"] = *lens.base_D;
      one["centre_thickness_mm"] = *lens.centre_thickness_mm;
    }
    json.push_back(std::move(one));
  }
  return json;
}

}  // namespace emmetrope::correction
