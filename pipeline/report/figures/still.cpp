#include "pipeline/report/figures/still.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/surfaces/triangle_hierarchy.hpp"
#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report {
namespace {

using Eigen::Vector3d;

constexpr double cut_edge_mm = 0.12;  ///< drawn brighter, so that the section's outline shows

/// A surface where a ray meets it, as seen.
struct Layer {
  double distance_mm = 0, opacity = 0;
  Vector3d rgb;
};

/// A surface ready for rays.
class Body {
 public:
  Body(const StillSurface& surface, const StillView& view)
      : surface_(surface), view_(view), hierarchy_(surface.mesh_in_eye) {}

  void add_layers(const Ray& ray, std::vector<Layer>& layers) const {
    for (const auto& hit : hierarchy_.all(ray)) {
      const Vector3d place = ray.origin + hit.distance_mm * ray.direction;
      const double before_cut = place.x() * (view_.towards_viewer.x() > 0 ? 1 : -1);
      if (surface_.is_cut && before_cut > 0) continue;
      const bool is_edge = surface_.is_cut && before_cut > -cut_edge_mm;
      layers.push_back({hit.distance_mm, is_edge ? 1 : surface_.opacity, colour_at(hit, is_edge)});
    }
  }

 private:
  Vector3d colour_at(const TriangleHierarchy::Hit& hit, bool is_edge) const {
    const TriangleMesh& mesh = surface_.mesh_in_eye;
    const auto& corners = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
    Vector3d normal = Vector3d::Zero();
    if (mesh.normals.empty()) {
      normal = (mesh.vertices[corners[1]] - mesh.vertices[corners[0]])
                   .cross(mesh.vertices[corners[2]] - mesh.vertices[corners[0]]);
    } else {
      for (int corner = 0; corner < 3; ++corner)
        normal += hit.weights[corner] * mesh.normals[corners[corner]];
    }
    const Vector3d light = (view_.towards_viewer + 0.5 * view_.up).normalized();
    Vector3d own(surface_.rgb[0], surface_.rgb[1], surface_.rgb[2]);
    if (is_edge) return own;
    return own * (0.35 + 0.65 * std::abs(normal.normalized().dot(light)));
  }

  const StillSurface& surface_;
  const StillView& view_;
  TriangleHierarchy hierarchy_;
};

}  // namespace

StillView still_view(Laterality eye, double axial_length_mm) {
  StillView view;
  // The eye's +x is the patient's left: nasal of a right eye.
  const double temporal = eye == Laterality::od ? -1 : 1;
  view.towards_viewer = Vector3d(temporal * 0.8, 0.3, 0.45).normalized();
  view.right = Vector3d::UnitY().cross(view.towards_viewer).normalized();
  view.up = view.towards_viewer.cross(view.right);
  view.centre_mm = {0, 0, -axial_length_mm / 2};
  view.width_px = 360;
  view.height_px = 320;
  view.mm_per_pixel = 1.22 * axial_length_mm / view.height_px;
  return view;
}

std::string render_still(const std::vector<StillSurface>& surfaces, const StillView& view) {
  constexpr double beyond_mm = 100;
  std::vector<Body> bodies;
  for (const auto& surface : surfaces) bodies.emplace_back(surface, view);
  std::string pixels(static_cast<std::size_t>(view.width_px) * view.height_px * 4, '\0');
  std::vector<Layer> layers;
  for (int row = 0; row < view.height_px; ++row)
    for (int column = 0; column < view.width_px; ++column) {
      const double x = (column + 0.5 - view.width_px / 2.0) * view.mm_per_pixel;
      const double y = (view.height_px / 2.0 - row - 0.5) * view.mm_per_pixel;
      Ray ray;
      ray.origin = view.centre_mm + x * view.right + y * view.up + beyond_mm * view.towards_viewer;
      ray.direction = -view.towards_viewer;
      layers.clear();
      for (const auto& body : bodies) body.add_layers(ray, layers);
      std::sort(layers.begin(), layers.end(),
                [](const Layer& a, const Layer& b) { return a.distance_mm < b.distance_mm; });
      Vector3d colour = Vector3d::Zero();
      double through = 1;
      for (const auto& layer : layers) {
        colour += through * layer.opacity * layer.rgb;
        through *= 1 - layer.opacity;
      }
      if (layers.empty()) continue;
      const std::size_t at = 4 * (static_cast<std::size_t>(row) * view.width_px + column);
      const auto byte = [](double value) {
        return static_cast<char>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
      };
      for (int channel = 0; channel < 3; ++channel)
        pixels[at + static_cast<std::size_t>(channel)] = byte(colour[channel] / (1 - through));
      pixels[at + 3] = byte(1 - through);
    }
  return pixels;
}

Figure still_figure(const std::vector<StillSurface>& surfaces, Laterality eye, double axial_length_mm) {
  const StillView view = still_view(eye, axial_length_mm);
  std::string rgba = render_still(surfaces, view);
  for (std::size_t i = 0; i < rgba.size(); i += 4) std::swap(rgba[i], rgba[i + 2]);  // OpenCV writes BGRA
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", cv::Mat(view.height_px, view.width_px, CV_8UC4, rgba.data()), png,
                    {cv::IMWRITE_PNG_COMPRESSION, 9}))
    throw Error(ExitStatus::fault, "cannot encode a PNG");
  const bool front_is_right = view.right.z() > 0;
  const auto letter = [](const char* text, double x, double y) {
    return fmt::format(
        "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\" font-family=\"DejaVu Sans\" font-size=\"16\" "
        "font-weight=\"bold\" fill=\"currentColor\">{}</text>",
        x, y, text);
  };
  const double w = view.width_px, h = view.height_px;
  Figure figure;
  figure.width_px = w;
  figure.height_px = h;
  figure.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 "
      "{0} {1}\"><image width=\"{0}\" height=\"{1}\" xlink:href=\"{2}\"/>{3}<path d=\"M12 {4}h{5:.1f}\" "
      "stroke=\"currentColor\" stroke-width=\"3\"/><text x=\"12\" y=\"{6}\" font-family=\"DejaVu Sans\" "
      "font-size=\"12\" fill=\"currentColor\">5 mm</text></svg>",
      w, h, png_url({reinterpret_cast<const char*>(png.data()), png.size()}),
      letter("S", w / 2, 18) + letter("I", w / 2, h - 6) + letter(front_is_right ? "A" : "P", w - 12, h / 2) +
          letter(front_is_right ? "P" : "A", 12, h / 2),
      h - 26, 5 / view.mm_per_pixel, h - 10);
  figure.alt = "The eye's surfaces in space, seen from the temporal side, its temporal half cut away";
  return figure;
}

}  // namespace emmetrope::report
