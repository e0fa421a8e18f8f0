#include "pipeline/report/figures/slices.hpp"

#include <fmt/format.h>
#include <vtkCellArray.h>
#include <vtkCutter.h>
#include <vtkImageReslice.h>
#include <vtkMatrix4x4.h>
#include <vtkMatrixToLinearTransform.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkPlane.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStripper.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>

#include "pipeline/report/figures/encoding.hpp"
#include "pipeline/report/figures/volume_impl.hpp"

namespace emmetrope::report {
namespace {

constexpr int side_px = 360;

/// What a slice shows: directions (LPS) in which its columns and rows grow, and the axis across it.
struct View {
  const char* name;
  Eigen::Vector3d right, down, across;

  /// Left and right change places in neurological convention.
  bool flips() const { return right.x() != 0; }
};

View view_of(Plane plane) {
  const Eigen::Vector3d left{1, 0, 0}, posterior{0, 1, 0}, superior{0, 0, 1};
  switch (plane) {
    case Plane::axial:
      return {"axial", left, posterior, superior};
    case Plane::coronal:
      return {"coronal", left, -superior, posterior};
    case Plane::sagittal:
      break;
  }
  return {"sagittal", posterior, -superior, left};
}

/// "L", "R", "P", "A", "S" or "I".
const char* anatomical_letter(const Eigen::Vector3d& along_axis) {
  if (along_axis.x() != 0) return along_axis.x() > 0 ? "L" : "R";
  if (along_axis.y() != 0) return along_axis.y() > 0 ? "P" : "A";
  return along_axis.z() > 0 ? "S" : "I";
}

vtkSmartPointer<vtkImageData> resliced(const Volume& volume, const View& view,
                                       const Eigen::Vector3d& corner_lps, double pixel_mm) {
  Eigen::Matrix4d lps_from_pixel = Eigen::Matrix4d::Identity();
  lps_from_pixel.block<3, 1>(0, 0) = view.right * pixel_mm;
  lps_from_pixel.block<3, 1>(0, 1) = view.down * pixel_mm;
  lps_from_pixel.block<3, 1>(0, 2) = view.right.cross(view.down) * pixel_mm;
  lps_from_pixel.block<3, 1>(0, 3) = corner_lps;
  const Eigen::Matrix4d voxel_from_pixel = volume.impl().lps_from_voxel.inverse() * lps_from_pixel;

  vtkNew<vtkMatrixToLinearTransform> transform;
  vtkNew<vtkMatrix4x4> matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix->SetElement(row, column, voxel_from_pixel(row, column));
  transform->SetInput(matrix);
  vtkNew<vtkImageReslice> reslice;
  reslice->SetInputData(volume.impl().image);
  reslice->SetResliceTransform(transform);
  reslice->SetOutputSpacing(1, 1, 1);
  reslice->SetOutputOrigin(0, 0, 0);
  reslice->SetOutputExtent(0, side_px - 1, 0, side_px - 1, 0, 0);
  reslice->SetInterpolationModeToLinear();
  reslice->BorderOn();
  reslice->SetBackgroundLevel(0);
  reslice->SetOutputScalarType(VTK_FLOAT);
  reslice->Update();
  return reslice->GetOutput();
}

/// 8 bits between the 1st and the 99.5th percentile of what the slice shows; PNG rows run downwards, VTK's
/// upwards.
std::string windowed_png(vtkImageData* slice) {
  const auto* values = static_cast<const float*>(slice->GetScalarPointer());
  const std::size_t count = static_cast<std::size_t>(side_px) * side_px;
  std::vector<float> sorted;
  std::copy_if(values, values + count, std::back_inserter(sorted), [](float v) { return std::isfinite(v); });
  if (sorted.empty()) sorted.push_back(0);
  const auto percentile = [&](double share) {
    const auto at =
        sorted.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
    std::nth_element(sorted.begin(), at, sorted.end());
    return *at;
  };
  const float low = percentile(0.01), high = std::max(percentile(0.995), low + 1e-6F);
  vtkNew<vtkImageData> grey;
  grey->SetDimensions(side_px, side_px, 1);
  grey->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  auto* bytes = static_cast<unsigned char*>(grey->GetScalarPointer());
  for (int row = 0; row < side_px; ++row)
    for (int column = 0; column < side_px; ++column) {
      const float value = values[row * side_px + column];
      const float level = std::isfinite(value) ? std::clamp((value - low) / (high - low), 0.0F, 1.0F) : 0.0F;
      bytes[(side_px - 1 - row) * side_px + column] = static_cast<unsigned char>(std::lround(255 * level));
    }
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputData(grey);
  writer->WriteToMemoryOn();
  writer->Write();
  vtkUnsignedCharArray* png = writer->GetResult();
  return {reinterpret_cast<const char*>(png->GetPointer(0)),
          static_cast<std::size_t>(png->GetNumberOfTuples())};
}

vtkSmartPointer<vtkPolyData> poly_data_of(const TriangleMesh& mesh) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const auto& vertex : mesh.vertices) points->InsertNextPoint(vertex.data());
  vtkNew<vtkCellArray> cells;
  for (const auto& triangle : mesh.triangles) {
    const std::array<vtkIdType, 3> corners{triangle[0], triangle[1], triangle[2]};
    cells->InsertNextCell(3, corners.data());
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(points);
  data->SetPolys(cells);
  return data;
}

/// The cut of the mesh with the slice as one SVG path.
std::string contour_path(const Contour& contour, const View& view, const Eigen::Vector3d& centre_lps,
                         double pixel_mm) {
  if (contour.mesh_lps.triangles.empty()) return {};
  vtkNew<vtkPlane> plane;
  const Eigen::Vector3d normal = view.right.cross(view.down);
  plane->SetOrigin(centre_lps.x(), centre_lps.y(), centre_lps.z());
  plane->SetNormal(normal.x(), normal.y(), normal.z());
  vtkNew<vtkCutter> cutter;
  cutter->SetInputData(poly_data_of(contour.mesh_lps));
  cutter->SetCutFunction(plane);
  vtkNew<vtkStripper> stripper;
  stripper->SetInputConnection(cutter->GetOutputPort());
  stripper->JoinContiguousSegmentsOn();
  stripper->Update();
  vtkPolyData* lines = stripper->GetOutput();
  std::string path;
  vtkIdType count = 0;
  const vtkIdType* ids = nullptr;
  for (lines->GetLines()->InitTraversal(); lines->GetLines()->GetNextCell(count, ids) != 0;)
    for (vtkIdType i = 0; i < count; ++i) {
      const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3d>(lines->GetPoint(ids[i])) - centre_lps;
      path +=
          fmt::format("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", point.dot(view.right) / pixel_mm + side_px / 2.0,
                      point.dot(view.down) / pixel_mm + side_px / 2.0);
    }
  if (path.empty()) return {};
  return fmt::format("<path d=\"{}\" class=\"contour\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\"/>",
                     path, contour.colour);
}

std::string letter(const char* text, int x, int y, const char* convention) {
  const std::string hidden = std::string(convention) == "neurological" ? " display=\"none\"" : "";
  return fmt::format(
      "<text class=\"{}\"{} x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-family=\"DejaVu Sans\" "
      "font-size=\"16\" font-weight=\"bold\" fill=\"#ffe066\" stroke=\"#000\" stroke-width=\"3\" "
      "paint-order=\"stroke\">{}</text>",
      convention, hidden, x, y, text);
}

std::string letters(const View& view) {
  constexpr int middle = side_px / 2, near = 14, far = side_px - 14, lift = 6;
  const char *left = anatomical_letter(-view.right), *right = anatomical_letter(view.right),
             *top = anatomical_letter(-view.down), *bottom = anatomical_letter(view.down);
  std::string svg = letter(top, middle, near + 5, "both") + letter(bottom, middle, far, "both");
  if (!view.flips())
    return svg + letter(left, near, middle + lift, "both") + letter(right, far, middle + lift, "both");
  svg += letter(left, near, middle + lift, "radiological");
  svg += letter(right, far, middle + lift, "radiological");
  svg += letter(right, near, middle + lift, "neurological");
  return svg + letter(left, far, middle + lift, "neurological");
}

std::string scale_bar(double pixel_mm) {
  constexpr double length_mm = 10;
  const double length_px = length_mm / pixel_mm, y = side_px - 30;
  return fmt::format(
      "<path d=\"M12 {0:.1f}h{1:.1f}\" stroke=\"#fff\" stroke-width=\"3\"/><text x=\"12\" y=\"{2:.1f}\" "
      "font-family=\"DejaVu Sans\" font-size=\"12\" fill=\"#fff\">10 mm</text>",
      y, length_px, y + 16);
}

}  // namespace

Figure slice_figure(const Volume& volume, Plane plane, const Eigen::Vector3d& centre_lps, double field_mm,
                    const std::vector<Contour>& contours, const std::string& id) {
  const View view = view_of(plane);
  const double pixel_mm = field_mm / side_px;
  const Eigen::Vector3d corner_lps = centre_lps - (view.right + view.down) * pixel_mm * (side_px / 2.0 - 0.5);
  const std::string png = windowed_png(resliced(volume, view, corner_lps, pixel_mm));

  Figure figure;
  figure.id = id;
  figure.width_px = figure.height_px = side_px;
  figure.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 "
      "{0} {0}\"><rect width=\"{0}\" height=\"{0}\" fill=\"#000\"/><g class=\"{1}\"><image width=\"{0}\" "
      "height=\"{0}\" xlink:href=\"{2}\"/>",
      side_px, view.flips() ? "anatomy flips" : "anatomy", png_url(png));
  for (const auto& contour : contours) figure.svg += contour_path(contour, view, centre_lps, pixel_mm);
  figure.svg += "</g>" + letters(view) + scale_bar(pixel_mm) + "</svg>";
  const double across_mm = centre_lps.dot(view.across);
  figure.title =
      fmt::format("{}, {} {:.1f} mm", view.name,
                  anatomical_letter(across_mm < 0 ? -view.across : view.across), std::abs(across_mm));
  figure.alt = fmt::format("{} MR slice through the eye with the contours of the fitted surfaces", view.name);
  return figure;
}

}  // namespace emmetrope::report
