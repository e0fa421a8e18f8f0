#include "tests/support/fixture_case.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <zlib.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::test {
namespace {

namespace fs = std::filesystem;
using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr const char* fixture_series = "1.2.826.0.1.3680043.10.1.2";
constexpr double axial_length_mm = 23.4, globe_radius_mm = 11.5;
constexpr double lens_front_mm = 3.4, lens_back_mm = 7.2;
constexpr int columns = 140, rows = 70, slices = 60;
constexpr double voxel_mm = 0.8;
const Vector3d first_voxel_lps{-56, -60, -24};

struct TrueEye {
  Laterality laterality;
  double flat_radius_mm, steep_radius_mm, flat_axis_deg;
  double sphere_D, cylinder_D, axis_deg;
};
const TrueEye right{Laterality::od, 7.95, 7.55, 178, -2.31, -1.12, 176};
const TrueEye left{Laterality::os, 7.80, 7.74, 4, 0.31, -0.38, 92};

Isometry3d place(const TrueEye& eye) {
  const double side = eye.laterality == Laterality::od ? -1 : 1;
  return lps_from_eye({side * 31, -50, 3}, {side * -0.05, -1, 0.03});
}

double cornea_depth(const TrueEye& eye, double x, double y) {
  const double a = eye.flat_axis_deg * degree;
  const double u = x * std::cos(a) + y * std::sin(a), v = -x * std::sin(a) + y * std::cos(a);
  const double cu = 1 / eye.flat_radius_mm, cv = 1 / eye.steep_radius_mm;
  return (u * u * cu + v * v * cv) / (1 + std::sqrt(1 - 0.8 * (u * u * cu * cu + v * v * cv * cv)));
}

double sphere_depth(double radius, double x, double y) {
  const double r2 = x * x + y * y;
  return r2 / radius / (1 + std::sqrt(1 - r2 / (radius * radius)));
}

/// A polar sheet of a depth function, LPS, with normals out of the eye.
TriangleMesh sheet(const Isometry3d& lps_from_eye, double reach_mm,
                   const std::function<double(double, double)>& depth) {
  constexpr int rings = 14, spokes = 40;
  TriangleMesh mesh;
  const auto add = [&](double x, double y) {
    constexpr double h = 1e-4;
    const Vector3d normal((depth(x + h, y) - depth(x - h, y)) / (2 * h),
                          (depth(x, y + h) - depth(x, y - h)) / (2 * h), 1);
    mesh.vertices.push_back(lps_from_eye * Vector3d(x, y, -depth(x, y)));
    mesh.normals.push_back(lps_from_eye.linear() * normal.normalized());
  };
  add(0, 0);
  for (int ring = 1; ring <= rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double r = reach_mm * ring / rings, a = 2 * pi * spoke / spokes;
      add(r * std::cos(a), r * std::sin(a));
    }
  const auto at = [&](int ring, int spoke) { return 1 + (ring - 1) * spokes + spoke % spokes; };
  for (int spoke = 0; spoke < spokes; ++spoke) mesh.triangles.push_back({0, at(1, spoke), at(1, spoke + 1)});
  for (int ring = 1; ring < rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      mesh.triangles.push_back({at(ring, spoke), at(ring + 1, spoke), at(ring + 1, spoke + 1)});
      mesh.triangles.push_back({at(ring, spoke), at(ring + 1, spoke + 1), at(ring, spoke + 1)});
    }
  return mesh;
}

void write_meshes(const fs::path& folder, const TrueEye& eye) {
  const Isometry3d lps = place(eye);
  const auto write = [&](const char* name, double reach, const std::function<double(double, double)>& depth) {
    write_mesh(folder / (std::string(name) + ".ply"), sheet(lps, reach, depth), true);
  };
  write("cornea_anterior", 5.8, [&](double x, double y) { return cornea_depth(eye, x, y); });
  write("cornea_posterior", 5.4, [&](double x, double y) { return 0.55 + sphere_depth(6.5, x, y); });
  write("lens_anterior", 4.0, [](double x, double y) { return lens_front_mm + sphere_depth(10.5, x, y); });
  write("lens_posterior", 4.0, [](double x, double y) { return lens_back_mm - sphere_depth(6.0, x, y); });
  write("retina", 11.2, [](double x, double y) {
    return axial_length_mm - globe_radius_mm + std::sqrt(globe_radius_mm * globe_radius_mm - x * x - y * y);
  });
}

/// 1 cornea, 2 aqueous, 3 lens, 4 vitreous, 5 wall; 0 elsewhere.
int tissue_at(const TrueEye& eye, const Vector3d& p_eye) {
  const double depth = -p_eye.z(), x = p_eye.x(), y = p_eye.y(), r = std::hypot(x, y);
  const double from_centre = std::hypot(r, depth - (axial_length_mm - globe_radius_mm));
  if (r < 4.2 && depth > lens_front_mm + sphere_depth(10.5, x, y) &&
      depth < lens_back_mm - sphere_depth(6.0, x, y))
    return 3;
  if (from_centre < globe_radius_mm && depth > lens_front_mm) return 4;
  if (r < 5.8 && depth < 5 && depth > cornea_depth(eye, x, y))
    return r < 5.5 && depth > 0.55 + sphere_depth(6.5, x, y) ? 2 : 1;
  return from_centre < globe_radius_mm + 1 && depth > 2 ? 5 : 0;
}

void append(std::string& bytes, const void* data, std::size_t count) {
  bytes.append(static_cast<const char*>(data), count);
}

/// A NIfTI-1 file, written field by field, with both transforms set (RAS).
void write_nifti(const fs::path& file, std::int16_t datatype, std::int16_t bits, const std::string& voxels) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, auto value) { std::memcpy(header.data() + at, &value, sizeof value); };
  put(0, std::int32_t{348});
  const std::array<std::int16_t, 8> dim{3, columns, rows, slices, 1, 1, 1, 1};
  for (std::size_t i = 0; i < 8; ++i) put(40 + 2 * i, dim[i]);
  put(70, datatype);
  put(72, bits);
  put(76, 1.0F);
  for (std::size_t i = 1; i <= 3; ++i) put(76 + 4 * i, static_cast<float>(voxel_mm));
  put(108, 352.0F);
  put(112, 1.0F);
  header[123] = 2;
  put(252, std::int16_t{1});
  put(254, std::int16_t{1});
  // LPS axes are columns, rows, slices; RAS turns x and y: a rotation by 180 degrees about z, quaternion (0,
  // 0, 1).
  put(256, 0.0F);
  put(260, 0.0F);
  put(264, 1.0F);
  const std::array<float, 3> origin{static_cast<float>(-first_voxel_lps.x()),
                                    static_cast<float>(-first_voxel_lps.y()),
                                    static_cast<float>(first_voxel_lps.z())};
  for (std::size_t i = 0; i < 3; ++i) put(268 + 4 * i, origin[i]);
  const std::array<float, 12> sform{static_cast<float>(-voxel_mm), 0,        0,         origin[0], 0,
                                    static_cast<float>(-voxel_mm), 0,        origin[1], 0,         0,
                                    static_cast<float>(voxel_mm),  origin[2]};
  for (std::size_t i = 0; i < 12; ++i) put(280 + 4 * i, sform[i]);
  std::memcpy(header.data() + 344, "n+1", 4);
  gzFile out = gzopen(file.c_str(), "wb6");
  gzwrite(out, header.data(), static_cast<unsigned>(header.size()));
  gzwrite(out, voxels.data(), static_cast<unsigned>(voxels.size()));
  gzclose(out);
}

constexpr std::array<float, 6> intensity{120, 300, 900, 250, 1000, 200};

void write_volumes(const fs::path& folder) {
  std::string values, labels;
  const Isometry3d right_from_lps = place(right).inverse(), left_from_lps = place(left).inverse();
  for (int k = 0; k < slices; ++k)
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) {
        const Vector3d p = first_voxel_lps + voxel_mm * Vector3d(i, j, k);
        const bool is_right = p.x() < 0;
        const int tissue =
            is_right ? tissue_at(right, right_from_lps * p) : tissue_at(left, left_from_lps * p);
        const float value =
            intensity[static_cast<std::size_t>(tissue)] + static_cast<float>((i * 7 + j * 13 + k * 29) % 31);
        append(values, &value, sizeof value);
        labels.push_back(static_cast<char>(tissue == 0 ? 0 : is_right ? tissue : tissue + 10));
      }
  write_nifti(folder / "stack1.nii.gz", 16, 32, values);
  write_nifti(folder / "stack1_labels.nii.gz", 2, 8, labels);
  Json names = Json::array();
  const std::array<const char*, 5> tissues{"cornea", "anterior chamber", "lens", "vitreous body",
                                           "sclera, choroid and retina"};
  for (const auto& [side, first] : {std::pair("right ", 1), std::pair("left ", 11)})
    for (std::size_t i = 0; i < tissues.size(); ++i)
      names.push_back({{"value", first + static_cast<int>(i)}, {"name", side + std::string(tissues[i])}});
  write_json(folder / "labels.json", {{"labels", names}});
}

Json measured(double value, double sigma, const char* source = "mri") {
  return Measured::from_sigma(value, sigma, source);
}

/// Oblate, with a bulge 20 degrees from the pole in the meridian of 300 degrees.
Json retina_map() {
  Json eccentricity = Json::array(), meridian = Json::array(), height = Json::array(), half = Json::array();
  for (int m = 0; m < 12; ++m) meridian.push_back(30 * m);
  for (int e = 0; e < 7; ++e) {
    eccentricity.push_back(10 * e);
    Json heights = Json::array(), halves = Json::array();
    for (int m = 0; m < (e == 0 ? 1 : 12); ++m) {
      const double x = 10 * e * std::cos(30 * m * degree), y = 10 * e * std::sin(30 * m * degree);
      const double from_bulge_deg2 = std::pow(x - 10, 2) + std::pow(y + 17.3, 2);
      heights.push_back(0.25 * std::exp(-from_bulge_deg2 / 300) + 0.15 * (std::pow(e / 6.0, 2) - 0.5));
      halves.push_back(0.03 + 0.01 * e);
    }
    height.push_back(heights);
    half.push_back(halves);
  }
  return {{"eccentricity_deg", eccentricity},
          {"meridian_deg", meridian},
          {"height_mm", height},
          {"height_half_ci95_mm", half}};
}

Json biometry_of(const TrueEye& eye) {
  const double flat_D = 337.5 / eye.flat_radius_mm, steep_D = 337.5 / eye.steep_radius_mm;
  const double steep_axis = normalise_axis_deg(eye.flat_axis_deg + 90), half = (steep_D - flat_D) / 2;
  Json json{{"laterality", to_string(eye.laterality)},
            {"lps_from_eye", to_json_matrix(place(eye))},
            {"head_roll_deg", 0.4},
            {"axial_length_mm", measured(axial_length_mm, 0.02)},
            {"optical_axial_length_mm", measured(axial_length_mm + 0.2, 0.03)},
            {"corneal_thickness_mm", measured(0.55, 0.03, "prior")},
            {"anterior_chamber_depth_mm", measured(lens_front_mm, 0.05)},
            {"lens_thickness_mm", measured(lens_back_mm - lens_front_mm, 0.04)},
            {"lens_anterior_radius_mm", measured(10.5, 0.8)},
            {"lens_posterior_radius_mm", measured(6.0, 0.3)},
            {"globe_width_mm", measured(23.1, 0.06)},
            {"globe_height_mm", measured(22.9, 0.06)},
            {"globe_depth_mm", measured(21.8, 0.1)},
            {"interpupillary_distance_mm", measured(62.4, 0.05)}};
  json["keratometry"] = {{"flat",
                          {{"radius_mm", measured(eye.flat_radius_mm, 0.06)},
                           {"power_D", measured(flat_D, 0.33)},
                           {"axis_deg", measured(eye.flat_axis_deg, 6)}}},
                         {"steep",
                          {{"radius_mm", measured(eye.steep_radius_mm, 0.06)},
                           {"power_D", measured(steep_D, 0.35)},
                           {"axis_deg", measured(steep_axis, 6)}}},
                         {"cylinder_D", measured(steep_D - flat_D, 0.3)},
                         {"asphericity_q", measured(-0.2, 0.1, "prior")}};
  json["astigmatism"] = {
      {"M_D", measured((flat_D + steep_D) / 2, 0.3)},
      {"J0_D", measured(half * std::cos(2 * eye.flat_axis_deg * degree), 0.15)},
      {"J45_D", measured(half * std::sin(2 * eye.flat_axis_deg * degree), 0.15)},
      {"type", "with-the-rule"},
      {"irregularity_um", measured(1.4, 0.5)},
      {"section_2p3mm", {{"vertical_mm", measured(10.9, 0.1)}, {"horizontal_mm", measured(11.1, 0.1)}}}};
  json["retina"] = {
      {"vertex_radius_mm", {{"horizontal", measured(12.3, 0.05)}, {"vertical", measured(12.0, 0.05)}}},
      {"q_240", measured(0.11, 0.01)},
      {"q_120", measured(0.12, 0.03)},
      {"tilt_deg", {{"horizontal", measured(-0.6, 0.2)}, {"vertical", measured(0.4, 0.2)}}},
      {"area_mm2", measured(1224, 8)},
      {"volume_mm3", measured(5719, 56)},
      {"staphyloma_index", measured(28.9, 0.5)},
      {"map", retina_map()}};
  return json;
}

/// 5 x 5 directions, more hyperopic outwards and to the patient's left, the field's meridian the more myopic;
/// the left eye does not see its lower left corner.
Json peripheral_of(const TrueEye& eye, const PowerVector& power) {
  Json field = Json::array();
  for (int row = 2; row >= -2; --row)
    for (int column = -2; column <= 2; ++column) {
      if (eye.laterality == Laterality::os && row == -2 && column == 2) continue;
      const double horizontal_deg = 10 * column, vertical_deg = 10 * row;
      const double x2 = horizontal_deg * horizontal_deg, y2 = vertical_deg * vertical_deg;
      field.push_back({{"horizontal_deg", horizontal_deg},
                       {"vertical_deg", vertical_deg},
                       {"M_D", power.M_D + 0.0009 * (x2 + y2) + 0.013 * horizontal_deg},
                       {"J0_D", power.J0_D - 0.0012 * (x2 - y2)},
                       {"J45_D", power.J45_D - 0.0024 * horizontal_deg * vertical_deg}});
    }
  return field;
}

Json prescription_of(const TrueEye& eye) {
  const PowerVector power = to_power_vector({eye.sphere_D, eye.cylinder_D, eye.axis_deg});
  const auto plain = [](const PowerVector& p) {
    return Json{{"M_D", p.M_D}, {"J0_D", p.J0_D}, {"J45_D", p.J45_D}};
  };
  Json json{{"laterality", to_string(eye.laterality)},
            {"vertex_distance_mm", 12},
            {"pupil_mm", 3},
            {"criterion", "gradient energy"},
            {"withheld", nullptr},
            {"sphere_D", measured(eye.sphere_D, 0.84)},
            {"cylinder_D", measured(eye.cylinder_D, 0.31)},
            {"axis_deg", measured(eye.axis_deg, 8)},
            {"M_D", measured(power.M_D, 0.82)},
            {"J0_D", measured(power.J0_D, 0.16)},
            {"J45_D", measured(power.J45_D, 0.15)}};
  json["rounded"] = {{"sphere_D", std::round(eye.sphere_D * 4) / 4},
                     {"cylinder_D", std::round(eye.cylinder_D * 4) / 4},
                     {"axis_deg", eye.laterality == Laterality::od ? 175 : 90}};
  json["plano_cylinder"] = {{"radius_mm", 212.5},
                            {"axis_deg", 90},
                            {"index", 1.5},
                            {"vertex_distance_mm", 10},
                            {"sharpness", 0.8125}};
  json["wavefront_check"] = {
      {"paraxial", plain({power.M_D + 0.21, power.J0_D + 0.02, power.J45_D})},
      {"minimum_rms_wavefront", plain({power.M_D - 0.05, power.J0_D, power.J45_D + 0.01})},
      {"minimum_rms_spot", plain({power.M_D - 0.11, power.J0_D, power.J45_D})},
      {"visual_strehl", plain({power.M_D + 0.06, power.J0_D, power.J45_D})}};
  json["budget"] = {{{"source", "lens index (prior)"}, {"M_D", 0.78}, {"J0_D", 0.0}, {"J45_D", 0.0}},
                    {{"source", "cornea"}, {"M_D", 0.24}, {"J0_D", 0.15}, {"J45_D", 0.14}},
                    {{"source", "axial length"}, {"M_D", 0.08}, {"J0_D", 0.0}, {"J45_D", 0.0}}};
  json["if_measured"] = {
      {{"measurement", "keratometry +-0.25 D"}, {"M_D", 0.71}, {"J0_D", 0.09}, {"J45_D", 0.11}}};
  json["sharpness"] = {{"without_lens", 0.1432}, {"with_lens", 0.9361}};
  const Json rounded = json["rounded"];
  json["contact_lens"] = {{"sphere_D", eye.sphere_D + 0.06},
                          {"cylinder_D", eye.cylinder_D + 0.03},
                          {"axis_deg", eye.axis_deg},
                          {"vertex_distance_mm", 0},
                          {"rounded", rounded}};
  const auto lens = [&](const char* kind, double vertex_mm, double shift_D, double sharpness) {
    return Json{{"kind", kind},
                {"vertex_distance_mm", vertex_mm},
                {"sphere_D", eye.sphere_D + shift_D},
                {"cylinder_D", eye.cylinder_D - shift_D},
                {"axis_deg", eye.axis_deg},
                {"rounded_text", "-2.00 / -0.75 x 170"},
                {"sharpness", sharpness}};
  };
  Json meniscus = lens("toric meniscus", 12, 0.02, 0.9374);
  meniscus.update({{"material", "cr39"},
                   {"index", 1.498},
                   {"abbe", 58.2},
                   {"base_D", 4.67},
                   {"centre_thickness_mm", 2.1}});
  json["lenses"] = {lens("thin lens", 12, 0, 0.9361), meniscus, lens("contact lens", 0, 0.07, 0.9482)};
  json["peripheral"] = peripheral_of(eye, power);
  json["what_if"] = {
      {"pupil",
       {{{"pupil_mm", 4.0}, {"M_D", power.M_D - 0.33}, {"J0_D", power.J0_D + 0.05}, {"J45_D", 0.17}}}},
      {"accommodation",
       {{"age_years", 41},
        {"amplitude_D", 6.2},
        {"minimum_amplitude_D", 4.75},
        {"near_point_mm", 113.0},
        {"near_point_with_lens_mm", 134.0}}},
      {"intra_ocular_lens",
       {{"target_M_D", 0},
        {"a_constant", 118.4},
        {"position_mm", 5.46},
        {"ray_traced_D", 18.65},
        {"ray_traced_ci95_D", {15.98, 21.32}},
        {"srkt_D", 18.03},
        {"srkt_ci95_D", {15.41, 20.65}},
        {"holladay_1_D", 17.93},
        {"holladay_1_ci95_D", {15.26, 20.60}},
        {"hoffer_q_D", 17.69},
        {"hoffer_q_ci95_D", {15.13, 20.25}},
        {"haigis_D", 18.69},
        {"haigis_ci95_D", {15.88, 21.50}}}},
      {"ablation",
       {{"optical_zone_mm", 6.0},
        {"central_depth_um", 52.7},
        {"deepest_um", 53.9},
        {"residual", {{"M_D", 0.12}, {"J0_D", -0.22}, {"J45_D", -0.08}}}}}};
  return json;
}

Json wavefront_of(const TrueEye& eye) {
  constexpr double pupil_mm = 3.4;
  const PowerVector power =
      move_towards_eye(to_power_vector({eye.sphere_D, eye.cylinder_D, eye.axis_deg}), 12);
  const double r2 = pupil_mm * pupil_mm / 4;
  std::vector<double> zernike(28, 0);
  zernike[3] = -power.J45_D * r2 / (2 * std::sqrt(6.0));
  zernike[4] = -power.M_D * r2 / (4 * std::sqrt(3.0));
  zernike[5] = -power.J0_D * r2 / (2 * std::sqrt(6.0));
  zernike[7] = 0.03;
  zernike[12] = 0.02;
  double sum = 0;
  for (const double c : zernike) sum += c * c;
  std::vector<double> cpd, falling;
  for (int f = 0; f <= 60; f += 2) {
    cpd.push_back(f);
    falling.push_back(std::exp(-f / 4.0));
  }
  return {{"pupil_mm", pupil_mm},
          {"wavelength_nm", 589.3},
          {"zernike_um", zernike},
          {"rms_um", std::sqrt(sum)},
          {"strehl", 0.012},
          {"vsotf", 0.021},
          {"mtf", {{"cpd", cpd}, {"tangential", falling}, {"sagittal", falling}}}};
}

void write_picture(const fs::path& file, double blur_px) {
  cv::Mat picture(300, 300, CV_8UC3, cv::Scalar(255, 255, 255));
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      cv::putText(picture, "E", {30 + 65 * column, 70 + 65 * row}, cv::FONT_HERSHEY_SIMPLEX, 1.6 - 0.35 * row,
                  {0, 0, 0}, 3);
  if (blur_px > 0) cv::GaussianBlur(picture, picture, {0, 0}, blur_px);
  cv::imwrite(file.string(), picture);
}

void write_stage(const fs::path& folder, const std::string& stage, int status, const Json& reasons,
                 const Json& warnings) {
  write_json(folder / stage / "stage.json", {{"stage", stage},
                                             {"command_line", "emmetrope-" + stage + " x"},
                                             {"version", "0.1.0+test"},
                                             {"parameters", Json::object()},
                                             {"seed", 1},
                                             {"inputs", Json::object()},
                                             {"opencl_device", nullptr},
                                             {"wall_s", 1.5},
                                             {"warnings", warnings},
                                             {"verdict", {{"status", status}, {"reasons", reasons}}}});
}

Json fit_of(const TrueEye& eye, bool refused) {
  const Vector3d centre = place(eye) * Vector3d(0, 0, -(axial_length_mm - globe_radius_mm));
  Json quality = Json::array();
  quality.push_back(
      {{"name", "chi2_per_voxel"},
       {"value", refused ? 4.2 : 1.02},
       {"limit", 1.5},
       {"passed", !refused},
       {"reason", refused ? "The model explains the voxels badly: chi2 per voxel 4.2, at most 1.5." : ""}});
  return {{"laterality", to_string(eye.laterality)},
          {"globe_centre_lps_mm", {centre.x(), centre.y(), centre.z()}},
          {"quality", quality},
          {"status", refused ? "refused" : "measured"}};
}

}  // namespace

void make_fixture_case(const fs::path& folder, const FixtureOptions& options) {
  std::vector<TrueEye> eyes{right};
  if (!options.only_right) eyes.push_back(left);
  for (const char* stage : {"segmentation", "meshing", "raytrace", "correction"})
    if (!options.refused || std::string(stage) == "segmentation")
      for (const auto& eye : eyes) fs::create_directories(folder / stage / to_string(eye.laterality));
  write_json(
      folder / "case.json",
      {{"subject", {{"id", options.subject}, {"age_years", 41}, {"sex", "F"}}},
       {"study_date", "2026-03-14"},
       {"series",
        {{{"name", "stack1"},
          {"number", 3},
          {"description", "AX T2"},
          {"slices", slices},
          {"column_spacing_mm", voxel_mm},
          {"slice_spacing_mm", voxel_mm},
          {"field_strength_T", 3.0},
          {"orientation", {1, 0, 0, 0, 1, 0}}}}},
       {"stacks", {{{"name", "stack1"}, {"used", true}, {"contrast", "T2"}, {"reason", "the only one"}}}}});
  write_volumes(folder / "segmentation");
  Json warnings = Json::array();
  if (!options.stage_warning.empty()) warnings.push_back(options.stage_warning);
  for (const auto& eye : eyes) {
    const std::string id = to_string(eye.laterality);
    write_json(folder / "segmentation" / id / "fit.json", fit_of(eye, options.refused));
    if (options.refused) continue;
    write_meshes(folder / "meshing" / id, eye);
    write_json(folder / "meshing" / id / "biometry.json", biometry_of(eye));
    write_json(folder / "raytrace" / id / "wavefront.json", wavefront_of(eye));
    write_picture(folder / "raytrace" / id / "uncorrected.png", eye.sphere_D < -1 ? 6 : 1.5);
    write_picture(folder / "correction" / id / "corrected.png", 0.6);
    write_json(folder / "correction" / id / "prescription.json", prescription_of(eye));
    std::string sweep = "radius_mm,sharpness\n";
    for (int radius = 60; radius <= 400; radius += 10)
      sweep += std::to_string(radius) + "," +
               std::to_string(0.8 / (1 + std::pow((1000.0 / radius - 4.7) / 2, 2))) + "\n";
    write_file(folder / "correction" / id / "sweep.csv", sweep);
  }
  const int status = options.refused ? 6 : options.only_right ? 8 : 0;
  Json reasons = Json::array();
  if (options.refused) reasons.push_back("Neither eye can be measured in these images.");
  if (options.only_right) reasons.push_back("os: the left eye is not in the images.");
  write_stage(folder, "segmentation", status, reasons, warnings);
  if (options.refused) return;
  for (const char* stage : {"meshing", "raytrace", "correction"})
    write_stage(folder, stage, status, Json::array(), Json::array());
}

void note_study(const fs::path& case_folder, const fs::path& study) {
  const fs::path file = case_folder / "segmentation" / "stage.json";
  Json stage = read_json(file);
  stage["study"] = study.string();
  stage["inputs"] = Json::object();
  for (const auto& entry : fs::directory_iterator(study))
    stage["inputs"]["study/" + std::to_string(stage["inputs"].size() + 1)] = sha256_of_file(entry.path());
  write_json(file, stage);
  Json case_json = read_json(case_folder / "case.json");
  case_json["series"][0]["uid"] = case_json["stacks"][0]["uid"] = fixture_series;
  case_json["series"][0]["files"] = stage["inputs"].size();
  write_json(case_folder / "case.json", case_json);
}

void make_fixture_study(const fs::path& folder, const std::string& patient_name) {
  fs::create_directories(folder);
  for (int k = 0; k < slices; ++k) {
    DcmFileFormat format;
    DcmDataset& set = *format.getDataset();
    const auto put = [&](const DcmTagKey& tag, const std::string& value) {
      set.putAndInsertString(tag, value.c_str());
    };
    put(DCM_SOPClassUID, UID_MRImageStorage);
    put(DCM_SOPInstanceUID, "1.2.826.0.1.3680043.10.1.3.7" + std::to_string(k));
    put(DCM_StudyInstanceUID, "1.2.826.0.1.3680043.10.1.1");
    put(DCM_SeriesInstanceUID, fixture_series);
    put(DCM_FrameOfReferenceUID, "1.2.826.0.1.3680043.10.1.4");
    put(DCM_Modality, "MR");
    put(DCM_PatientName, patient_name);
    put(DCM_SeriesDescription, "</td><script>alert(5)</script>../" + patient_name);
    put(DCM_PatientID, "MRN-4711");
    put(DCM_PatientBirthDate, "19610203");
    put(DCM_PatientSex, "F");
    put(DCM_StudyDate, "20260314");
    put(DCM_StudyTime, "101500");
    put(DCM_ReferringPhysicianName, "");
    put(DCM_StudyID, "1");
    put(DCM_AccessionNumber, "");
    put(DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
    put(DCM_ImagePositionPatient, "-56\\-60\\" + std::to_string(first_voxel_lps.z() + k * voxel_mm));
    format.saveFile((folder / ("slice" + std::to_string(k))).c_str(), EXS_LittleEndianExplicit);
  }
}

}  // namespace emmetrope::test
