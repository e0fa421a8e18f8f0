#include "raytrace/case/measured_eye.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/population/limits.hpp"

namespace emmetrope::raytrace {
namespace {

Surface sphere(const std::string& name, double position_mm, double radius_mm,
               const std::string& medium_after) {
  Surface surface;
  surface.name = name;
  surface.shape = make_sphere(radius_mm);
  surface.position_mm = position_mm;
  surface.medium_after = medium_after;
  return surface;
}

/// Gullstrand's core scaled to the lens.
void add_core(EyeModel& eye) {
  const auto front = std::find_if(eye.surfaces.begin(), eye.surfaces.end(),
                                  [](const auto& s) { return s.name == "lens_anterior"; });
  const auto back = std::next(front);
  const double thickness = back->position_mm - front->position_mm;
  const double front_radius = 2 / front->shape->vertex_curvature().trace(),
               back_radius = 2 / back->shape->vertex_curvature().trace();
  const Surface core_front =
      sphere("core_anterior", front->position_mm + 0.1517 * thickness, 0.7911 * front_radius, "core");
  const Surface core_back =
      sphere("core_posterior", front->position_mm + 0.8236 * thickness, 0.96 * back_radius, "cortex");
  front->medium_after = "cortex";
  eye.surfaces.insert(back, {core_front, core_back});
  eye.media.erase("lens");
  eye.media["cortex"] = lens_medium(lens_cortex_index);
  eye.media["core"] = lens_medium(lens_core_index);
}

/// By which the optical length differs from the one to the interface.
double meshed_retinal_depth_mm(const std::filesystem::path& file, const Json& biometry) try {
  const auto length_mm = [&](const char* key) -> std::optional<double> {
    const Json length = biometry.value(key, Json());
    return length.is_object() && !is_withheld(length) ? std::optional(length.get<Measured>().value)
                                                      : std::nullopt;
  };
  const auto inner = length_mm("axial_length_mm"), optical = length_mm("optical_axial_length_mm");
  if (!inner || !optical) return usual_retinal_depth_mm;
  const double depth_mm = std::round(1e6 * (*optical - *inner)) / 1e6;  // as it was typed
  if (!(depth_mm >= 0 && depth_mm <= most_retinal_depth_mm))
    throw input_error(
        fmt::format("the optical length is {:g} mm more than the length to the interface, not 0 "
                    "to {:g}",
                    depth_mm, most_retinal_depth_mm));
  return depth_mm;
} catch (Error& error) {
  error.add_context("reading " + file.string());
  throw;
}

}  // namespace

MeasuredEye read_measured_eye(const std::filesystem::path& case_folder, Laterality laterality,
                              const MeasuredEyeOptions& options) {
  const auto folder = case_folder / "meshing" / to_string(laterality);
  const std::filesystem::path biometry_file = folder / "biometry.json";
  const Json biometry = read_json(biometry_file);
  if (!biometry.contains("lps_from_eye"))
    throw input_error(biometry_file.string() + " has no lps_from_eye", "run emmetrope mesh again");

  MeasuredEye result;
  EyeModel& eye = result.eye;
  eye.name = to_string(laterality);
  eye.reference_wavelength_nm = sodium_nm;
  eye.lps_from_eye = isometry_from_json(biometry["lps_from_eye"]);

  const std::optional<double> of_study = subject_age_years(case_folder),
                              age = of_study ? of_study : options.age_years;
  result.warning = age_warning(of_study, options.age_years);
  const LensIndex index = options.lens_index ? LensIndex{*options.lens_index, 0}
                                             : lens_index_at_age(age.value_or(usual_age_years));
  result.lens_index = index.mean;
  result.lens_index_sigma = index.sigma;
  result.lens_source = options.lens_core    ? "Gullstrand's cortex and core"
                       : options.lens_index ? "--lens-index"
                       : !age               ? fmt::format("age unknown, taken as {:g} years", usual_age_years)
                              : fmt::format("age {:.0f} years{}", *age, of_study ? "" : " (--age)");
  // lens_index_at_age gives 1.434 to 1.414.
  constexpr double least_usual = 1.39, most_usual = 1.45;
  if (!human_lens_index.contains(result.lens_index))
    throw usage_error(
        fmt::format("a lens of index {:.4f} is no human lens", result.lens_index),
        fmt::format("{} to {}; check --lens-index or --age", human_lens_index.low, human_lens_index.high));
  if (result.warning.empty() && (result.lens_index < least_usual || result.lens_index > most_usual))
    result.warning =
        fmt::format("a lens of index {:.4f} is none of any age ({} to {}): a hundredth is about 1.5 D",
                    result.lens_index, least_usual, most_usual);
  eye.media = ocular_media(result.lens_index);

  const auto mesh = [&](const char* name, const char* medium_after) {
    return read_mesh_surface(name, folder / (std::string(name) + ".ply"), eye.lps_from_eye, medium_after);
  };
  const Surface lens_anterior = mesh("lens_anterior", "lens");
  Surface iris;
  iris.name = "iris";
  iris.position_mm = lens_anterior.position_mm;
  iris.stop_diameter_mm = options.pupil_mm;
  eye.surfaces = {mesh("cornea_anterior", "cornea"), mesh("cornea_posterior", "aqueous"), iris, lens_anterior,
                  mesh("lens_posterior", "vitreous")};

  const auto interface = read_mesh(folder / "retina.ply");
  TriangleMesh in_eye =
      interface.says_lps ? transformed(eye.lps_from_eye->inverse(), interface.mesh) : interface.mesh;
  const double retinal_depth_mm = meshed_retinal_depth_mm(biometry_file, biometry);
  if (options.retinal_depth_mm && std::abs(*options.retinal_depth_mm - retinal_depth_mm) > 1e-6)
    throw usage_error(
        fmt::format("--retinal-depth {:g}: the case was meshed with {:g} mm, by which its optical length "
                    "is told",
                    *options.retinal_depth_mm, retinal_depth_mm),
        fmt::format("give it to emmetrope mesh: emmetrope mesh {} --retinal-depth {:g}", case_folder.string(),
                    *options.retinal_depth_mm));
  for (auto& vertex : in_eye.vertices) vertex.z() -= retinal_depth_mm;
  result.photoreceptors_in_lps = transformed(*eye.lps_from_eye, in_eye);
  eye.surfaces.push_back(make_mesh_surface("retina", in_eye, {}));
  if (options.lens_core) add_core(eye);
  return result;
}

void write_measured_eye(const std::filesystem::path& folder, const MeasuredEye& measured,
                        Laterality laterality) {
  const std::string photoreceptors = "photoreceptors.ply";
  write_mesh(folder / photoreceptors, measured.photoreceptors_in_lps, true);
  Json json = to_json(measured.eye);
  for (auto& surface : json["surfaces"]) {
    if (surface["type"] != "mesh") continue;
    const std::string name = surface["name"];
    if (name == "retina") {
      surface["file"] = photoreceptors;
      surface["sha256"] = sha256_of_file(folder / photoreceptors);
    } else {
      surface["file"] = "../../meshing/" + std::string(to_string(laterality)) + "/" + name + ".ply";
    }
  }
  write_json(folder / "eye.json", json);
}

}  // namespace emmetrope::raytrace
