#include "raytrace/system/device_surface.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/mesh_shape.hpp"
#include "raytrace/system/paper_method.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/system/triangle_walk.hpp"

namespace emmetrope::raytrace {
namespace {

double number(const Json& json, const char* key, int index) {
  const Json& value = json.at(key);
  return value.is_array() ? value.at(index).get<double>() : value.get<double>();
}

/// The first number under a key that may be missing.
double number_or(const Json& json, const char* key, double otherwise) {
  return json.contains(key) ? number(json, key, 0) : otherwise;
}

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

DeviceSurface biconic(double cx, double cy, double qx, double qy, double axis_deg) {
  const double mean = (cx + cy) / 2, mean_q = (qx + qy) / 2;
  DeviceSurface form;
  form.kind = Operation::biconic;
  form.axis_deg = axis_deg;
  form.parameters = {cx, cy, (1 + qx) * cx * cx, (1 + qy) * cy * cy, mean, mean * (1 + mean_q)};
  return form;
}

DeviceSurface biconic(const Json& json) {
  const double c[2] = {1 / number(json, "radius_mm", 0), 1 / number(json, "radius_mm", 1)};
  const double q[2] = {number(json, "q", 0), number(json, "q", 1)};
  if (c[0] == c[1] && q[0] == q[1]) return quadric(c[0], c[0], c[0] * (1 + q[0]), 0);
  return biconic(c[0], c[1], q[0], q[1], json.value("axis_deg", 0.0));
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

DeviceSurface formula(const Surface& surface) {
  const std::string type = surface.shape->type();
  const Json json = surface.shape->to_json();
  if (type == "plane") return sphere(0);
  if (type == "sphere") return sphere(1 / number(json, "radius_mm", 0));
  if (type == "conic") {
    const double c = 1 / number(json, "radius_mm", 0);
    return quadric(c, c, c * (1 + number(json, "q", 0)), 0);
  }
  if (type == "ellipsoid") {
    const Json& a = json.at("semi_axes_mm");
    const double x = a[0], y = a[1], z = a[2];
    return quadric(z / (x * x), z / (y * y), 1 / z, json.value("axis_deg", 0.0));
  }
  if (type == "biconic") return biconic(json);
  // Whatever else is smooth: a patch through 12 000 points with the surface's own slopes.
  return smooth(surface, sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), 12000, 0));
}

}  // namespace

DeviceSurface device_surface(const Surface& surface, Representation representation, int vertices) {
  DeviceSurface form;
  if (const auto* mesh = dynamic_cast<const MeshShape*>(surface.shape.get())) {
    const HeightField* patch = mesh->patch();
    if (representation == Representation::every_triangle) {
      form = every_triangle(mesh->mesh());
    } else if (patch == nullptr) {
      form = sheet_hierarchy(mesh->mesh());
    } else if (representation == Representation::triangles) {
      form = triangle_walk(mesh->mesh(), {patch->base_curvature_per_mm().trace() / 2, patch->base_q(),
                                          patch->base_offset_mm()});
    } else {
      form = patches(*patch);
      form.note = deviation(*patch);
    }
  } else if (representation == Representation::smooth) {
    form = smooth(surface, sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), vertices, 0.25));
  } else if (representation == Representation::every_triangle) {
    form = every_triangle(sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), vertices, 0.25));
  } else if (representation == Representation::triangles) {
    const double q = number_or(surface.shape->to_json(), "q", 0);
    form = triangle_walk(sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), vertices, 0.25),
                         {surface.shape->vertex_curvature().trace() / 2, q, 0});
  } else {  // analytic; what a fast map is fitted to
    form = formula(surface);
  }
  if (surface.semi_diameter_mm > 0)
    form.clear_radius_mm = std::min(form.clear_radius_mm, surface.semi_diameter_mm);
  return form;
}

}  // namespace emmetrope::raytrace
