#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/report/case/series.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/figures/chart.hpp"
#include "pipeline/report/figures/cornea_map.hpp"
#include "pipeline/report/figures/encoding.hpp"
#include "pipeline/report/figures/picture_figure.hpp"
#include "pipeline/report/figures/slices.hpp"
#include "pipeline/report/figures/still.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

constexpr double slice_field_mm = 46;
constexpr double map_half_width_mm = 4;
constexpr int map_cells = 81;

struct SurfaceStyle {
  const char *name, *colour, *label;
};
// The colours of the overlays (segmentation/output/overlay.cpp).
constexpr std::array<SurfaceStyle, 5> surfaces{{{"cornea_anterior", "#00d2e6", "cornea front (cyan)"},
                                                {"cornea_posterior", "#00d2e6", "cornea back (cyan)"},
                                                {"lens_anterior", "#ff8c00", "lens front (orange)"},
                                                {"lens_posterior", "#ff8c00", "lens back (orange)"},
                                                {"retina", "#3cdc50", "retina (green)"}}};

std::vector<Contour> contours_of(const EyeData& eye) {
  std::vector<Contour> contours;
  for (const auto& surface : surfaces)
    if (fs::exists(eye.mesh(surface.name)))
      contours.push_back({read_mesh(eye.mesh(surface.name)).mesh, surface.colour, surface.label});
  return contours;
}

/// Voxel spacings of a volume along the patient's axes: the finest stack for a plane shows it best.
double blur_in_plane_mm(const Volume& volume, Plane plane) {
  const Eigen::Matrix3d columns = volume.lps_from_voxel().block<3, 3>(0, 0).cwiseAbs();
  const Eigen::Vector3d extent = columns.rowwise().maxCoeff();
  switch (plane) {
    case Plane::axial:
      return extent.x() * extent.y();
    case Plane::coronal:
      return extent.x() * extent.z();
    case Plane::sagittal:
      break;
  }
  return extent.y() * extent.z();
}

using NamedPlane = std::pair<Plane, const char*>;

FigureRow slices_of(const EyeData& eye, const std::vector<std::pair<std::string, Volume>>& volumes,
                    const Eigen::Vector3d& centre, const std::vector<NamedPlane>& planes) {
  FigureRow row;
  const auto fitted = contours_of(eye);
  for (const auto& [plane, name] : planes) {
    const std::pair<std::string, Volume>* best = nullptr;
    for (const auto& candidate : volumes) {
      if (!is_fitted_to(eye, candidate.first) || candidate.second.coverage(centre, 11) < 0.9) continue;
      if (best == nullptr ||
          blur_in_plane_mm(candidate.second, plane) < blur_in_plane_mm(best->second, plane))
        best = &candidate;
    }
    if (best == nullptr) continue;
    const Eigen::Vector3d shift = head_shift(eye, best->first);
    std::vector<Contour> contours = fitted;
    for (auto& contour : contours)
      for (auto& vertex : contour.mesh_lps.vertices) vertex -= shift;
    Figure figure = slice_figure(best->second, plane, centre - shift, slice_field_mm, contours,
                                 fmt::format("slice-{}-{}", eye.id(), name));
    figure.title = std::string(eye.laterality == Laterality::od ? "OD" : "OS") + ", " + figure.title;
    figure.caption = best->first + ".";
    row.figures.push_back(std::move(figure));
  }
  if (fitted.empty())
    for (auto& figure : row.figures) figure.caption += " No surfaces were fitted.";
  return row;
}

constexpr std::size_t most_pictures = 6;

/// Below the picture of the residuals, what its colours are (segmentation/output/overlay.cpp).
void add_scale(Figure& figure) {
  const double top = figure.height_px + 8, width = std::min(300.0, figure.width_px - 80), left = 30;
  const auto label = [&](double share, const char* text) {
    return fmt::format(
        "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\" font-family=\"DejaVu Sans\" font-size=\"14\" "
        "fill=\"currentColor\">{}</text>",
        left + share * width, top + 32, text);
  };
  const std::string scale =
      fmt::format(
          "<defs><linearGradient id=\"scale-{0}\"><stop offset=\"0\" stop-color=\"#00f\"/><stop offset=\"0.5\" "
          "stop-color=\"#fff\"/><stop offset=\"1\" stop-color=\"#f00\"/></linearGradient></defs><rect x=\"{1}\" "
          "y=\"{2}\" width=\"{3}\" height=\"14\" fill=\"url(#scale-{0})\" stroke=\"currentColor\"/>",
          figure.id, left, top, width) +
      label(0, "-4 \u03c3") + label(0.5, "0") + label(1, "+4 \u03c3");
  const auto box = fmt::format("viewBox=\"0 0 {} {}\"", figure.width_px, figure.height_px);
  figure.height_px += 46;
  figure.svg.replace(figure.svg.find(box), box.size(),
                     fmt::format("viewBox=\"0 0 {} {}\"", figure.width_px, figure.height_px));
  figure.svg.insert(figure.svg.rfind("</svg>"), scale);
}

/// "stack1" of overlay_stack1.png, with a comma before it
std::string stack_of(const fs::path& file) {
  const std::string stem = file.stem().string();
  const auto underscore = stem.find('_');
  return underscore == std::string::npos ? std::string() : ", " + stem.substr(underscore + 1);
}

/// Of segmentation/output/overlay.cpp.
constexpr const char* overlay_colours =
    "cornea cyan, iris violet, lens orange, inner wall green, outer wall yellow; red surrounds what lies in "
    "the vitreous and is none. What is withheld is grey; blue is the globe by edges, with crosses on its "
    "axis, where these are told instead.";

/// Pictures that segmentation left of an eye, as figures.
FigureRow overlays_of(const EyeData& eye) {
  FigureRow row;
  for (const auto& file : eye.overlays) {
    if (row.figures.size() == most_pictures) break;
    Figure figure = picture_figure(file, fmt::format("overlay-{}-{}", eye.id(), row.figures.size() + 1));
    const std::string stem = file.stem().string();
    const bool is_residual = stem.rfind("residual", 0) == 0;
    const std::string of_stack = stem.substr(std::min(stem.size(), stem.find('_')));
    const bool is_fitted = fs::exists(file.parent_path() / ("residual" + of_stack + ".png"));
    figure.title = std::string(eye.laterality == Laterality::od ? "OD, " : "OS, ") +
                   (is_residual ? "residuals of the fit"
                    : is_fitted ? "contours"
                                : "a stack that was not fitted") +
                   stack_of(file);
    figure.caption =
        is_residual
            ? "Measured minus modelled signal in units of the noise. It should look like noise; a rim "
              "of one colour is an edge that was missed."
        : is_fitted
            ? std::string("The fit's contours on the slices as they were acquired: ") + overlay_colours
            : "Not fitted to. What other stacks show is placed where the globe was found in this one, to about a "
              "millimetre: " +
                  std::string(overlay_colours);
    if (is_residual) add_scale(figure);
    figure.alt =
        is_residual ? "Residuals of the fit on the MR slices" : "Contours of the eye on the MR slices";
    row.figures.push_back(std::move(figure));
  }
  return row;
}

/// Stacks in which no eye was found: what a reader needs to see why.
FigureRow eyeless_stacks(const CaseData& data) {
  FigureRow row;
  for (const auto& file : data.overlays) {
    if (row.figures.size() == most_pictures) break;
    Figure figure = picture_figure(file, fmt::format("overlay-{}", row.figures.size() + 1));
    figure.title = "No eye found" + stack_of(file);
    figure.alt = "Slices of a stack in which no eye was found";
    row.figures.push_back(std::move(figure));
  }
  if (!row.figures.empty())
    row.caption = "Slices as they were acquired. Look whether they reach an eye at all.";
  return row;
}

TriangleMesh in_eye_frame(const EyeData& eye, const std::string& surface) {
  TriangleMesh mesh = read_mesh(eye.mesh(surface)).mesh;
  const Eigen::Isometry3d eye_from_lps = isometry_from_json(eye.biometry.at("lps_from_eye")).inverse();
  for (auto& vertex : mesh.vertices) vertex = eye_from_lps * vertex;
  for (auto& normal : mesh.normals) {
    normal = eye_from_lps.linear() * normal;
    if (normal.z() < 0) normal = -normal;
  }
  return mesh;
}

/// Nothing where an eye has no surfaces.
std::optional<Figure> still_of(const EyeData& eye) {
  constexpr std::array<double, 3> cyan{0.0, 0.82, 0.9}, orange{1.0, 0.55, 0.0}, green{0.24, 0.86, 0.31};
  if (!eye.biometry.is_object() || !fs::exists(eye.mesh("retina"))) return std::nullopt;
  std::vector<StillSurface> bodies;
  for (const auto& [name, rgb, opacity, is_cut] :
       {std::tuple{"cornea_anterior", cyan, 0.45, true}, std::tuple{"lens_anterior", orange, 0.85, false},
        std::tuple{"lens_posterior", orange, 0.85, false}, std::tuple{"retina", green, 1.0, true}})
    if (fs::exists(eye.mesh(name))) bodies.push_back({in_eye_frame(eye, name), rgb, opacity, is_cut});
  Figure figure =
      still_figure(bodies, eye.laterality, value_of(eye.biometry, "axial_length_mm").value_or(24));
  figure.id = "still-" + eye.id();
  figure.title = std::string(eye.laterality == Laterality::od ? "OD" : "OS") + ", surfaces in space";
  return figure;
}

/// As the table of keratometry tells them: nothing of a cylinder that may be none.
std::optional<Meridians> meridians_of(const Json& biometry) {
  const auto flat = value_at(biometry, "/keratometry/flat/axis_deg"),
             steep = value_at(biometry, "/keratometry/steep/axis_deg");
  if (!flat || !steep || !has_axis(biometry.value(Json::json_pointer("/keratometry/cylinder_D"), Json())))
    return std::nullopt;
  return Meridians{*flat, *steep};
}

}  // namespace

Section images_section(const CaseData& data, Notes& notes) {
  Section section{"images", "MR images and fitted surfaces", {}};
  std::vector<std::pair<std::string, Volume>> volumes;
  for (const auto& file : data.stacks) {
    const std::string name = file.filename().string();
    try {
      volumes.emplace_back(name.substr(0, name.size() - 7), Volume(file));
    } catch (const Error& error) {
      notes.push_back(std::string("A stack could not be shown: ") + error.what());
    }
  }
  const bool any_surface = std::any_of(data.eyes.begin(), data.eyes.end(),
                                       [](const EyeData& eye) { return fs::exists(eye.mesh("retina")); });
  const std::string look =
      any_surface ? "Contours should follow the edges: cornea cyan, lens orange, inner retina green." : "";
  if (const Table series = series_table(data); !series.rows.empty())
    section.blocks.push_back({series, Paper::if_room});
  FigureRow printed{{}, look, true}, more{{}, look, true};
  for (const auto& eye : data.eyes) {
    const auto centre = globe_centre(eye);
    if (!centre) continue;
    for (auto& [row, planes] : {std::pair<FigureRow*, std::vector<NamedPlane>>{
                                    &printed, {{Plane::axial, "axial"}, {Plane::sagittal, "sagittal"}}},
                                {&more, {{Plane::coronal, "coronal"}}}}) {
      FigureRow slices = slices_of(eye, volumes, *centre, planes);
      std::move(slices.figures.begin(), slices.figures.end(), std::back_inserter(row->figures));
    }
  }
  if (!printed.figures.empty()) section.blocks.push_back({printed});
  if (!more.figures.empty()) section.blocks.push_back({more, Paper::if_room});
  FigureRow stills;
  stills.caption =
      "Cornea cyan, lens orange, inner retina green, seen from the temporal side, somewhat from the front and "
      "above; the temporal half of cornea and retina is cut away.";
  for (const auto& eye : data.eyes)
    if (auto still = still_of(eye)) stills.figures.push_back(std::move(*still));
  if (!stills.figures.empty()) section.blocks.push_back({stills, Paper::if_room});
  for (const auto& eye : data.eyes) {
    FigureRow overlays = overlays_of(eye);
    // On paper only where there are no surfaces to show: then they are the evidence for the refusal, or for edges.
    const bool has_surfaces = fs::exists(eye.mesh("retina"));
    overlays.folded = has_surfaces ? (eye.laterality == Laterality::od ? "OD" : "OS") +
                                         std::string(": contours and residuals of the fit, slice by slice")
                                   : std::string();
    if (!overlays.figures.empty())
      section.blocks.push_back({overlays, has_surfaces ? Paper::never : Paper::always});
  }
  if (FigureRow eyeless = eyeless_stacks(data); !eyeless.figures.empty())
    section.blocks.push_back({std::move(eyeless)});
  if (!printed.figures.empty())
    section.blocks.push_back(
        {Paragraph{"Slices are in the patient's axes through the middle of the globe, in radiological "
                   "convention: the patient's right is on the left of the picture. R right, L left, A "
                   "anterior, P posterior, S superior, I inferior."}});
  return section;
}

Section cornea_section(const CaseData& data, Notes& notes) {
  Section section{"cornea", "Front of the cornea", {}};
  FigureRow powers, elevations;
  bool has_lines = false;
  for (const auto& eye : data.eyes) {
    if (!eye.biometry.is_object() || !fs::exists(eye.mesh("cornea_anterior"))) continue;
    const CorneaGrid grid = cornea_grid(in_eye_frame(eye, "cornea_anterior"), map_half_width_mm, map_cells);
    const bool is_right = eye.laterality == Laterality::od;
    const std::string name = is_right ? "OD" : "OS";
    Figure power;
    power.id = "axial-power-" + eye.id();
    power.width_px = 400;
    power.height_px = 300;
    power.title = name + ", axial power";
    power.alt = "Colour map of the axial power of the cornea";
    Figure elevation = power;
    elevation.id = "elevation-" + eye.id();
    elevation.title = name + ", elevation over a sphere of " + fixed(grid.best_sphere_radius_mm, 2) + " mm";
    elevations.caption =
        "Red lies above the best-fit sphere, blue below. A toric cornea shows a saddle, a cone one red "
        "island.";
    elevation.alt = "Colour map of corneal elevation over the best-fit sphere";
    const std::optional<Meridians> meridians = meridians_of(eye.biometry);
    has_lines = has_lines || meridians;
    const bool has_power = draw_axial_power(power, grid, meridians, is_right);
    const bool has_elevation = draw_elevation(elevation, grid, is_right);
    if (has_power) powers.figures.push_back(power);
    if (has_elevation) elevations.figures.push_back(elevation);
    if (!has_power || !has_elevation)
      notes.push_back(name + ": corneal maps are missing, because gnuplot is not installed or failed.");
  }
  powers.caption =
      std::string("Colours step by 1.5 D on a scale that is the same for all eyes. ") +
      (has_lines ? "Solid line: steep meridian; dashed: flat; none where the axis is not determined. " : "") +
      "A bow tie is regular astigmatism; asymmetry is irregular. N nasal, T temporal.";
  if (!powers.figures.empty()) section.blocks.push_back({powers});
  if (!elevations.figures.empty()) section.blocks.push_back({elevations, Paper::if_room});
  return section;
}

}  // namespace emmetrope::report
