#include "pipeline/eye/commands/describe_eye.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/eye/exchange/eye_file.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/optics/plausible_eye.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope {
namespace {

/// Wider than any iris: a schematic eye's iris that stops nothing.
constexpr double open_iris_mm = 20;

/// An eye without a stop has none.
Json pupil_json(const EyeModel& eye, const Pupil& pupil) {
  if (eye.stop() == nullptr) return nullptr;
  return {{"position_mm", pupil.position_mm}, {"diameter_mm", pupil.diameter_mm}};
}

Eigen::Vector3d point(const std::vector<double>& values, const char* option) {
  Eigen::Vector3d p(values.at(0), values.at(1), values.at(2));
  if (!p.allFinite()) throw usage_error(std::string(option) + ": expected three finite numbers");
  return p;
}

double plain(double value) { return without_negative_zero(value, 4); }

void warn_of_extrapolation(const EyeModel& eye, double nm) {
  if (const std::string warning = extrapolation_warning(eye, nm); !warning.empty())
    spdlog::warn("{}", warning);
}

/// Of an eye without power they are nowhere.
std::string pair_text(const Json& object, const Json& image) {
  const double before_mm = object.get<double>(), behind_mm = image.get<double>();
  return std::isfinite(before_mm) && std::isfinite(behind_mm)
             ? fmt::format("{:9.4f} and {:.4f}", before_mm, behind_mm)
             : "     none: the eye has no power";
}

std::string text_of(const EyeModel& eye, const Json& json) {
  const auto number = [&](const char* key) { return json[key].get<double>(); };
  std::string text = fmt::format("{} at {:g} nm (depths in mm behind the corneal vertex)\n", eye.name,
                                 number("wavelength_nm"));
  text += fmt::format("power             {:9.4f} D\n", plain(number("power_D")));
  for (const auto& [label, key] : {std::pair{"focal points    ", "focal"},
                                   {"principal points", "principal"},
                                   {"nodal points    ", "nodal"}})
    text +=
        fmt::format("{}  {}\n", label,
                    pair_text(json[fmt::format("object_{}_mm", key)], json[fmt::format("image_{}_mm", key)]));
  const Json& pupil = json["entrance_pupil"];
  text += pupil.is_null()
              ? "entrance pupil         none: the eye has no stop\n"
              : fmt::format("entrance pupil    {:9.4f}, diameter {:.4f} mm\n",
                            pupil["position_mm"].get<double>(), pupil["diameter_mm"].get<double>());
  text += fmt::format("axial length      {:9.4f} mm\n", number("axial_length_mm"));
  const Json& r = json["refraction"];
  text += fmt::format("refraction        M {:+.4f}  J0 {:+.4f}  J45 {:+.4f} D at the corneal vertex\n",
                      plain(r["M_D"]), plain(r["J0_D"]), plain(r["J45_D"]));
  return text;
}

/// Whether a point lies on the retina, as seen from the globe's middle. One that closes the globe in front is a retina
/// behind the lens alone.
bool is_on_retina(const EyeModel& eye, const Eigen::Vector3d& point) {
  constexpr double rounding_mm = 0.1;  // of the lengths that people write
  const std::size_t count = eye.surfaces.size();
  if (count > 1 && -point.z() < eye.surfaces[count - 2].position_mm) return false;
  const Eigen::Vector3d centre = retina_centre(eye), outwards = point - centre;
  if (outwards.norm() < rounding_mm) return false;
  const std::optional<RetinaPoint> retina = meet_retina(eye, Ray{centre, outwards.normalized()});
  return retina && (point - retina->position_mm).norm() <= rounding_mm;
}

/// A ray out of the eye begins in the vitreous at the retina, whatever its numbers say.
/// \throw Error (usage)
void check_is_on_retina(const EyeModel& eye, const Eigen::Vector3d& from) {
  if (is_on_retina(eye, from)) return;
  const std::optional<RetinaPoint> behind = meet_retina(eye, Eigen::Vector2d(from.x(), from.y()));
  throw usage_error("--from is not on the retina, where a ray out of the eye starts",
                    behind
                        ? fmt::format("at these X and Y the retina is at Z {:.4f}", behind->position_mm.z())
                        : fmt::format("its pole is at Z {:.4f}", -eye.axial_length_mm()));
}

}  // namespace

void declare_eye_options(CLI::App& app, EyeOptions& options) {
  app.add_option("--accommodation", options.accommodation_D, "Change of refraction from the relaxed eye (D)")
      ->type_name("D");
  app.add_option("--accommodation-parameter", options.accommodation_parameter,
                 "The schematic eye's own accommodation parameter, instead")
      ->type_name("A");
  app.add_option("--pupil", options.pupil_mm, "Diameter of the iris aperture (mm)")
      ->check(CLI::Range(iris_aperture_mm.low, iris_aperture_mm.high))
      ->type_name("MM");
}

std::string schematic_eyes_line() { return fmt::format("{}", fmt::join(schematic_eye_names(), ", ")); }

Answer describe_eye(const EyeQuery& query) {
  const EyeModel eye = make_eye(query.eye, query.options);
  const double nm = query.wavelength_nm.value_or(eye.reference_wavelength_nm);
  warn_of_extrapolation(eye, nm);
  if (const std::string doubt = implausible_eye(eye); !doubt.empty()) spdlog::warn("{}", doubt);
  if (eye.stop() == nullptr)
    spdlog::warn("{} has no stop and so no pupils: give it a surface of type \"stop\"", query.eye);
  const CardinalPoints points = cardinal_points(eye, nm);
  const PowerVector refraction = paraxial_refraction(eye, nm);
  Answer answer;
  answer.json = {
      {"name", eye.name},
      {"wavelength_nm", nm},
      {"power_D", points.power_D == 0 ? 0 : points.power_D},  // without the sign of a zero
      {"object_focal_mm", points.object_focal_mm},
      {"image_focal_mm", points.image_focal_mm},
      {"object_principal_mm", points.object_principal_mm},
      {"image_principal_mm", points.image_principal_mm},
      {"object_nodal_mm", points.object_nodal_mm},
      {"image_nodal_mm", points.image_nodal_mm},
      {"entrance_pupil", pupil_json(eye, entrance_pupil(eye, nm))},
      {"exit_pupil", pupil_json(eye, exit_pupil(eye, nm))},
      {"axial_length_mm", eye.axial_length_mm()},
      {"refraction", {{"M_D", refraction.M_D}, {"J0_D", refraction.J0_D}, {"J45_D", refraction.J45_D}}},
      {"refraction_D", refraction.M_D}};
  answer.text = text_of(eye, answer.json);
  if (!query.output.empty()) {
    const WrittenEye written = write_eye_file(query.output, eye);
    if (!written.warning.empty()) spdlog::warn("{}", written.warning);
    for (const std::filesystem::path& file : written.files) {
      answer.text += "written: " + file.string() + "\n";
      answer.json["files"].push_back(file.string());
    }
    for (const std::string& note : written.notes) {
      answer.text += "note: " + note + "\n";
      answer.json["notes"].push_back(note);
    }
  }
  return answer;
}

Answer describe_ray(const RayQuery& query) {
  EyeOptions options = query.options;
  if (!options.pupil_mm && is_schematic_eye(query.eye)) options.pupil_mm = open_iris_mm;
  const EyeModel eye = make_eye(query.eye, options);
  const Eigen::Vector3d from = point(query.from_mm, "--from"), to = point(query.to_mm, "--to");
  if ((to - from).norm() < 1e-12) throw usage_error("--to is the point of --from: the ray has no direction");
  const Eigen::Vector3d direction = (to - from).normalized();
  if (direction.z() == 0)
    throw usage_error("the ray runs across the eye's axis and neither into the eye nor out of it");
  if (direction.z() > 0 && from.z() < 0) check_is_on_retina(eye, from);
  // From far off, which is how infinity is written, intersections would lose their digits: the same line from near.
  constexpr double near_mm = 1000;
  const double skipped_mm = std::max(0.0, -from.dot(direction) - near_mm);
  const Eigen::Vector3d& nearer = to.norm() < from.norm() ? to : from;
  const Eigen::Vector3d start =
      skipped_mm > 0 ? Eigen::Vector3d(nearer - (nearer.dot(direction) + near_mm) * direction) : from;
  const double nm = query.wavelength_nm.value_or(eye.reference_wavelength_nm);
  warn_of_extrapolation(eye, nm);
  const RayPath path = trace_exact(eye, {start, direction}, nm);
  Answer answer;
  Json hits = Json::array();
  for (const RayHit& hit : path.hits) {
    hits.push_back({{"surface", hit.surface},
                    {"position_mm", to_json_vector(hit.position_mm)},
                    {"direction", to_json_vector(hit.direction)},
                    {"opl_mm", skipped_mm + hit.opl_mm}});
    answer.text += fmt::format(
        "{:<18} {:11.6f} {:11.6f} {:11.6f}   direction {:10.7f} {:10.7f} {:10.7f}   path {:.6f}\n",
        hit.surface, hit.position_mm.x(), hit.position_mm.y(), hit.position_mm.z(), hit.direction.x(),
        hit.direction.y(), hit.direction.z(), skipped_mm + hit.opl_mm);
  }
  answer.json = {{"hits", hits}, {"state", to_string(path.state)}, {"at", path.at}};
  answer.text += fmt::format("{} at {}\n", to_string(path.state), path.at);
  return answer;
}

}  // namespace emmetrope
