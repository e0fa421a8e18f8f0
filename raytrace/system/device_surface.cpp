#include "raytrace/system/device_surface.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "raytrace/system/paper_method.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/system/triangle_walk.hpp"

namespace emmetrope::raytrace {
namespace {

DeviceSurface quadric(double cx, double cy, double cz, double axis_deg) {
  DeviceSurface form;
  form.kind = Operation::quadric;
  form.axis_deg = axis_deg;
  form.parameters = {cx, cy, cz};
  return form;
}

DeviceSurface sphere(double curvature) {
  constexpr double least_per_mm = 0.02;  // flatter ones, planes too, lose digits in the sphere's own kernel
  if (std::abs(curvature) < least_per_mm) return quadric(curvature, curvature, curvature, 0);
  DeviceSurface form;
  form.kind = Operation::sphere;
  form.parameters = {curvature, 1 / curvature};
  return form;
}

DeviceSurface biconic(const BiconicFormula& formula) {
  const double cx = 1 / formula.radius_mm.x(), cy = 1 / formula.radius_mm.y();
  const double qx = formula.q.x(), qy = formula.q.y();
  if (cx == cy && qx == qy) return quadric(cx, cx, cx * (1 + qx), 0);
  const double mean = (cx + cy) / 2, mean_q = (qx + qy) / 2;
  DeviceSurface form;
  form.kind = Operation::biconic;
  form.axis_deg = formula.axis_deg;
  form.parameters = {cx, cy, (1 + qx) * cx * cx, (1 + qy) * cy * cy, mean, mean * (1 + mean_q)};
  return form;
}

/// Uniform cubic B-spline on 4 control values as powers of the cell's coordinate: row p gives the coefficient
/// of u^p.
constexpr double power_from_controls[4][4] = {
    {1 / 6., 4 / 6., 1 / 6., 0}, {-.5, 0, .5, 0}, {.5, -1, .5, 0}, {-1 / 6., .5, -.5, 1 / 6.}};

/// The largest circle about the origin inside the field's outline.
double inner_radius_mm(const HeightField& field) {
  double least = field.reach_mm();
  for (int k = 0; k < 72; ++k) {
    const double x = std::cos(k * 5 * degree), y = std::sin(k * 5 * degree);
    double low = 0, high = least;
    if (field.covers(high * x, high * y)) continue;
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (low + high);
      (field.covers(middle * x, middle * y) ? low : high) = middle;
    }
    least = low;
  }
  return least;
}

DeviceSurface patches(const HeightField& field) {
  DeviceSurface form;
  form.kind = Operation::patch;
  form.columns = field.columns() - 3;
  const int rows = field.rows() - 3;
  const double spacing = field.spacing_mm();
  const auto& controls = field.controls_mm();
  form.records.reserve(static_cast<std::size_t>(form.columns) * rows * 16);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < form.columns; ++i)
      for (int q = 0; q < 4; ++q)      // power of v
        for (int p = 0; p < 4; ++p) {  // power of u
          double sum = 0;
          for (int b = 0; b < 4; ++b)
            for (int a = 0; a < 4; ++a)
              sum += power_from_controls[q][b] * power_from_controls[p][a] *
                     controls[static_cast<std::size_t>(j + b) * field.columns() + i + a];
          form.records.push_back(static_cast<float>(sum));
        }
  const double curvature = field.base_curvature_per_mm().trace() / 2;
  form.clear_radius_mm = inner_radius_mm(field);
  form.parameters = {curvature,
                     curvature * (1 + field.base_q()),
                     field.origin_mm().x() + spacing,
                     field.origin_mm().y() + spacing,
                     1 / spacing,
                     form.columns - 0.001,
                     rows - 0.001,
                     0,
                     0,
                     field.base_offset_mm()};
  return form;
}

std::string deviation(const HeightField& field) {
  return fmt::format("smooth patch, at most {:.4f} um from the vertices", field.max_deviation_um());
}

DeviceSurface smooth(const Surface& surface, const TriangleMesh& mesh) {
  const auto field = HeightField::fit(mesh);
  if (!field)
    throw unsupported_error("surface \"" + surface.name + "\" is no height field along its axis",
                            "use --surfaces triangles");
  DeviceSurface form = patches(*field);
  form.note = deviation(*field);
  return form;
}

/// The kernel that a formula has of its own; nothing for the others.
struct FormulaOnDevice {
  std::optional<DeviceSurface> operator()(const PlaneFormula&) const { return sphere(0); }
  std::optional<DeviceSurface> operator()(const SphereFormula& formula) const {
    return sphere(1 / formula.radius_mm);
  }
  std::optional<DeviceSurface> operator()(const ConicFormula& formula) const {
    const double c = 1 / formula.radius_mm;
    return quadric(c, c, c * (1 + formula.q), 0);
  }
  std::optional<DeviceSurface> operator()(const EllipsoidFormula& formula) const {
    const double x = formula.semi_axes_mm.x(), y = formula.semi_axes_mm.y(), z = formula.semi_axes_mm.z();
    return quadric(z / (x * x), z / (y * y), 1 / z, formula.axis_deg);
  }
  std::optional<DeviceSurface> operator()(const BiconicFormula& formula) const { return biconic(formula); }
  std::optional<DeviceSurface> operator()(const ZernikeFormula&) const { return std::nullopt; }
  std::optional<DeviceSurface> operator()(std::monostate) const { return std::nullopt; }
};

/// A formula as a sheet of triangles.
TriangleMesh meshed(const Surface& surface, int vertices) {
  return sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), vertices, 0.25);
}

DeviceSurface mesh_on_device(const MeshShape& mesh, Representation representation) {
  const HeightField* patch = mesh.patch();
  if (representation == Representation::every_triangle) return every_triangle(mesh.mesh());
  if (patch == nullptr) return sheet_hierarchy(mesh.mesh());
  if (representation == Representation::triangles || mesh.interpolation() == MeshInterpolation::triangles)
    return triangle_walk(
        mesh.mesh(), {patch->base_curvature_per_mm().trace() / 2, patch->base_q(), patch->base_offset_mm()});
  DeviceSurface form = patches(*patch);
  form.note = deviation(*patch);
  return form;
}

DeviceSurface formula_on_device(const Surface& surface, Representation representation, int vertices) {
  switch (representation) {
    case Representation::smooth:
      return smooth(surface, meshed(surface, vertices));
    case Representation::every_triangle:
      return every_triangle(meshed(surface, vertices));
    case Representation::triangles:
      return triangle_walk(meshed(surface, vertices), {surface.shape->vertex_curvature().trace() / 2,
                                                       surface.shape->asphericity().x(), 0});
    case Representation::analytic:
    case Representation::fast:  // what its map is fitted to
      break;
  }
  if (auto form = std::visit(FormulaOnDevice(), surface.shape->formula())) return *std::move(form);
  // Whatever else is smooth: a patch through 12 000 points with the surface's own slopes.
  return smooth(surface, sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), 12000, 0));
}

}  // namespace

DeviceSurface device_surface(const Surface& surface, Representation representation, int vertices) {
  const MeshShape* mesh = mesh_of(surface);
  DeviceSurface form = mesh != nullptr ? mesh_on_device(*mesh, representation)
                                       : formula_on_device(surface, representation, vertices);
  if (surface.semi_diameter_mm > 0)
    form.clear_radius_mm = std::min(form.clear_radius_mm, surface.semi_diameter_mm);
  return form;
}

}  // namespace emmetrope::raytrace
