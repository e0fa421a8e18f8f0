#include "pipeline/report/living/living_data.hpp"

#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/report/figures/encoding.hpp"
#include "raytrace/picture/airy.hpp"
#include "raytrace/picture/gaze.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/wavefront/seen_pupil.hpp"

namespace emmetrope::report {
namespace {

using raytrace::EyeMap;

/// Charts as wide as the picture that the page opens with.
constexpr double chart_extent_deg = 5;

template <typename Value>
std::string packed(const std::vector<Value>& values) {
  const std::vector<float> floats(values.begin(), values.end());
  return base64({reinterpret_cast<const char*>(floats.data()), floats.size() * sizeof(float)});
}

/// EyeMap::rays with the terms [accommodation][wave] that are kept.
Json state_terms(const EyeMap& map, std::vector<double>& kept) {
  Json terms = Json::array();
  const std::size_t a_term = map.rays.size() / (static_cast<std::size_t>(map.waves) * map.accommodations);
  for (int l = 0; l < map.accommodations; ++l)
    for (int k = 0; k < map.waves; ++k) {
      if (l + k > map.state_degree) continue;
      terms.push_back({l, k});
      const auto first = map.rays.begin() + static_cast<std::ptrdiff_t>((l * map.waves + k) * a_term);
      kept.insert(kept.end(), first, first + static_cast<std::ptrdiff_t>(a_term));
    }
  return terms;
}

Json map_json(const EyeMap& map) {
  std::vector<double> rays;
  Json json{{"field_mm", map.field_mm},
            {"pupil_mm", map.pupil_mm},
            {"shortest_nm", map.shortest_nm},
            {"longest_nm", map.longest_nm},
            {"reference_nm", map.reference_nm},
            {"largest_accommodation_D", map.largest_accommodation_D},
            {"accommodations", map.accommodations},
            {"pupil_degree", EyeMap::pupil_degree},
            {"field_degree", EyeMap::field_degree},
            {"weight_pupil_degree", EyeMap::weight_pupil_degree},
            {"weight_field_degree", EyeMap::weight_field_degree},
            {"path_degree", EyeMap::path_degree},
            {"surfaces", map.surfaces},
            {"note", map.note()}};
  json["terms"] = state_terms(map, rays);
  json["rays"] = packed(rays);
  json["weights"] = packed(map.weights);
  json["paths"] = packed(map.paths);
  return json;
}

constexpr int outline_rings = 12, outline_spokes = 24;

/// A surface as points in the eye's frame, mm: from its vertex outward, rings of spokes.
std::vector<double> outline_points(const Surface& surface, double reach_mm) {
  std::vector<double> points;
  const Eigen::Isometry3d eye_from_surface = surface.eye_from_surface();
  for (int ring = 0; ring <= outline_rings; ++ring)
    for (int spoke = 0; spoke < outline_spokes; ++spoke) {
      const double radius = reach_mm * std::sin(pi / 2 * ring / outline_rings),
                   angle = 2 * pi * spoke / outline_spokes;
      const double x = radius * std::cos(angle), y = radius * std::sin(angle);
      const auto depth = surface.shape->depth_mm(x, y);
      const Eigen::Vector3d point =
          depth ? eye_from_surface * Eigen::Vector3d(x, y, -*depth) : Eigen::Vector3d::Constant(NAN);
      points.insert(points.end(), {point.x(), point.y(), point.z()});
    }
  return points;
}

/// As far as the surface reaches, at most as far as an eye does: the retina to its equator, the lens to its own, the cornea
/// to the limbus.
double reach_of(const Surface& surface) {
  constexpr double globe_mm = 11.5, lens_mm = 4.7, cornea_mm = 6;
  double reach = surface.name == "retina"               ? globe_mm
                 : surface.name.rfind("cornea", 0) == 0 ? cornea_mm
                                                        : lens_mm;
  if (surface.semi_diameter_mm > 0) reach = std::min(reach, surface.semi_diameter_mm);
  const auto is_there = [&](double radius) {
    for (int k = 0; k < 8; ++k)
      if (!surface.shape->depth_mm(radius * std::cos(k * pi / 4), radius * std::sin(k * pi / 4)))
        return false;
    return true;
  };
  while (reach > 1 && !is_there(reach)) reach -= 0.1;
  return reach;
}

/// A surface of the eye at rest; "changes": how far its points have moved at half and at all of the accommodation.
Json outline_json(const Surface& surface, const std::vector<EyeModel>& accommodating) {
  const double reach_mm = reach_of(surface);
  Json json{{"name", surface.name},
            {"rings", outline_rings},
            {"spokes", outline_spokes},
            {"points", packed(outline_points(surface, reach_mm))}};
  std::vector<std::vector<double>> states;
  for (const EyeModel& eye : accommodating)
    for (const Surface& same : eye.surfaces)
      if (same.name == surface.name) states.push_back(outline_points(same, reach_mm));
  if (states.size() == 3 && (states[1] != states[0] || states[2] != states[0])) {
    json["changes"] = Json::array();
    for (const int state : {1, 2}) {
      for (std::size_t i = 0; i < states[state].size(); ++i) states[state][i] -= states[0][i];
      json["changes"].push_back(packed(states[state]));
    }
  }
  return json;
}

/// The axis, then rings outward: x, y, z on the retina and M less that of the axis; no numbers where it does not see.
Json retina_json(const raytrace::RetinaRefraction& refraction) {
  std::vector<double> numbers;
  const auto& axis = refraction.places.front();
  for (const auto& place : refraction.places)
    if (place && axis)
      numbers.insert(numbers.end(), {place->retina_mm.x(), place->retina_mm.y(), place->retina_mm.z(),
                                     place->M_D - axis->M_D});
    else
      numbers.insert(numbers.end(), 4, NAN);
  return {{"rings", raytrace::RetinaRefraction::rings},
          {"spokes", raytrace::RetinaRefraction::spokes},
          {"reach_deg", raytrace::RetinaRefraction::rings * raytrace::RetinaRefraction::ring_deg},
          {"places", packed(numbers)}};
}

Json lens_json(const NamedLens& lens) {
  return {{"name", lens.name},
          {"sphere_D", lens.power.sphere_D},
          {"cylinder_D", lens.power.cylinder_D},
          {"axis_deg", lens.power.axis_deg},
          {"vertex_distance_mm", lens.vertex_distance_mm}};
}

std::string linear_png_url(const raytrace::Texture& texture) {
  cv::Mat bytes(texture.height, texture.width, CV_8U);
  for (int row = 0; row < texture.height; ++row)
    for (int column = 0; column < texture.width; ++column)
      bytes.at<unsigned char>(row, column) = static_cast<unsigned char>(
          std::lround(255 * texture.values[static_cast<std::size_t>(row) * texture.width + column]));
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", bytes, png, {cv::IMWRITE_PNG_COMPRESSION, 9}))
    throw Error(ExitStatus::fault, "cannot encode a PNG");
  return png_url({reinterpret_cast<const char*>(png.data()), png.size()});
}

Json chart_json(const std::string& name) {
  raytrace::ChartSpec spec = raytrace::parse_chart(name);
  spec.extent_deg = chart_extent_deg;
  const raytrace::Scene scene = raytrace::draw_chart(spec);
  return {{"name", name},
          {"extent_deg", spec.extent_deg},
          {"linear_png", linear_png_url(*scene.planes[0].texture)}};
}

}  // namespace

Json living_json(const LivingSubject& subject, int threads) {
  const EyeModel& eye = subject.eye;
  const double wavelength_nm = subject.living.map.reference_nm;
  const Surface* stop = eye.stop();
  EyeModel seeing = eye;
  seeing.set_stop_diameter(subject.pupil_mm);
  const double seen_pupil_mm = 2 * std::sqrt(raytrace::seen_pupil_area_mm2(seeing, wavelength_nm) / pi);
  Json json{{"id", subject.id},
            {"name", subject.name},
            {"withheld", subject.withheld},
            {"map", map_json(subject.living.map)},
            {"axial_length_mm", eye.axial_length_mm()},
            {"has_prescription", subject.has_prescription},
            {"half_width_D", subject.half_width_D},
            {"pupil_mm", subject.pupil_mm},
            {"stop_depth_mm", stop->position_mm},
            {"rotation_centre_mm", raytrace::EyePose().rotation_centre_mm},
            {"entrance_pupil_magnification", seen_pupil_mm / subject.pupil_mm}};
  json["bands"] = Json::array();
  for (const auto& band : subject.living.bands)
    json["bands"].push_back({{"M_D", band.reach_D.M_D},
                             {"J0_D", band.reach_D.J0_D},
                             {"J45_D", band.reach_D.J45_D},
                             {"upper", packed(band.upper)},
                             {"lower", packed(band.lower)}});
  json["outlines"] = Json::array();
  for (const auto& surface : eye.surfaces)
    if (!surface.is_stop()) json["outlines"].push_back(outline_json(surface, subject.living.accommodating));
  json["retina"] = retina_json(raytrace::retina_refraction(seeing, threads));
  json["lenses"] = Json::array();
  for (const auto& lens : subject.lenses) json["lenses"].push_back(lens_json(lens));
  return json;
}

Json living_world_json() {
  const raytrace::Spectrum spectrum = raytrace::display_spectrum();
  Json wavelengths = Json::array();
  for (int k = 0; k < raytrace::wavelength_count; ++k) {
    Json rgb = Json::array();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) rgb.push_back(spectrum.rgb_from_rgb[k](row, column));
    wavelengths.push_back({{"nm", spectrum.wavelength_nm[k]}, {"rgb_from_rgb", rgb}});
  }
  // Behind the angles by wavelength, which the page makes itself: the table that they scale.
  const std::vector<float> airy = raytrace::airy_table(spectrum.wavelength_nm, 1);
  return {{"wavelengths", wavelengths},
          {"airy", packed(std::vector<float>(airy.begin() + raytrace::wavelength_count, airy.end()))},
          {"charts", {chart_json("letters"), chart_json("dial"), chart_json("siemens")}}};
}

}  // namespace emmetrope::report
