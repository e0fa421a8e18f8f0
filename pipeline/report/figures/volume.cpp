#include <vtkImageData.h>
#include <vtkMatrix4x4.h>
#include <vtkNIFTIImageHeader.h>
#include <vtkNIFTIImageReader.h>
#include <vtkNew.h>

#include "pipeline/base/error.hpp"
#include "pipeline/report/figures/slices.hpp"
#include "pipeline/report/figures/volume_impl.hpp"

namespace emmetrope::report {
namespace {

/// The reader's matrices map its own coordinates (index times spacing) to RAS.
Eigen::Matrix4d lps_from_index(vtkMatrix4x4* ras_from_scaled, const double* spacing) {
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      matrix(row, column) =
          ras_from_scaled->GetElement(row, column) * (row < 2 ? -1 : 1) * (column < 3 ? spacing[column] : 1);
  return matrix;
}

}  // namespace

Volume::Volume(const std::filesystem::path& nifti_file) : impl_(std::make_unique<Impl>()) {
  vtkNew<vtkNIFTIImageReader> reader;
  if (reader->CanReadFile(nifti_file.c_str()) == 0)
    throw input_error(nifti_file.string() + " is no NIfTI volume", "run emmetrope segment again");
  reader->SetFileName(nifti_file.c_str());
  reader->Update();
  vtkImageData* image = reader->GetOutput();
  if (reader->GetErrorCode() != 0 || image->GetNumberOfPoints() == 0)
    throw input_error(nifti_file.string() + " cannot be read to its end", "run emmetrope segment again");
  vtkMatrix4x4* place =
      reader->GetSFormMatrix() != nullptr ? reader->GetSFormMatrix() : reader->GetQFormMatrix();
  if (place == nullptr)
    throw input_error(nifti_file.string() + " has neither sform nor qform", "run emmetrope segment again");
  impl_->lps_from_voxel = lps_from_index(place, image->GetSpacing());
  impl_->image = image;
  // From here on the image's own coordinates are voxel indices.
  image->SetSpacing(1, 1, 1);
  image->SetOrigin(0, 0, 0);
}

Volume::~Volume() = default;
Volume::Volume(Volume&&) noexcept = default;
Volume& Volume::operator=(Volume&&) noexcept = default;

Eigen::Vector3i Volume::size() const { return Eigen::Map<Eigen::Vector3i>(impl_->image->GetDimensions()); }

Eigen::Matrix4d Volume::lps_from_voxel() const { return impl_->lps_from_voxel; }

float Volume::at(int i, int j, int k) const {
  return static_cast<float>(impl_->image->GetScalarComponentAsDouble(i, j, k, 0));
}

double Volume::coverage(const Eigen::Vector3d& centre_lps, double half_width_mm) const {
  const Eigen::Matrix4d voxel_from_lps = impl_->lps_from_voxel.inverse();
  const Eigen::Vector3i dimensions = size();
  constexpr int steps = 9;
  int inside = 0;
  for (int i = 0; i < steps * steps * steps; ++i) {
    const Eigen::Vector3d grid(i % steps, i / steps % steps, i / (steps * steps));
    const Eigen::Vector3d point =
        centre_lps + half_width_mm * (grid / (steps - 1) * 2 - Eigen::Vector3d::Ones());
    const Eigen::Vector4d voxel = voxel_from_lps * point.homogeneous();
    bool in = true;
    for (int axis = 0; axis < 3; ++axis)
      in = in && voxel[axis] >= -0.5 && voxel[axis] <= dimensions[axis] - 0.5;
    inside += in ? 1 : 0;
  }
  return static_cast<double>(inside) / (steps * steps * steps);
}

}  // namespace emmetrope::report
