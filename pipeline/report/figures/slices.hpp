#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/report/document/document.hpp"

/// MR slices with the surfaces' contours over them, by VTK without OpenGL.
namespace emmetrope::report {

/// A NIfTI volume with its place in the patient.
class Volume {
 public:
  /// \throw Error (input_invalid) when the file cannot be read or says nothing of its place
  explicit Volume(const std::filesystem::path& nifti_file);
  ~Volume();
  Volume(Volume&&) noexcept;
  Volume& operator=(Volume&&) noexcept;

  struct Impl;
  const Impl& impl() const { return *impl_; }
  /// Share of the voxels of a cube of this half width around a point (LPS, mm) that lie inside the volume.
  double coverage(const Eigen::Vector3d& centre_lps, double half_width_mm) const;
  /// Product of the voxel spacings' largest two: small where in-plane detail is fine in a given plane.
  Eigen::Vector3i size() const;
  Eigen::Matrix4d lps_from_voxel() const;
  float at(int i, int j, int k) const;

 private:
  std::unique_ptr<Impl> impl_;
};

enum class Plane { axial, coronal, sagittal };

struct Contour {
  TriangleMesh mesh_lps;
  std::string colour;
  std::string name;
};

/// A square slice through `centre_lps`, resampled in the patient's axes: radiological convention (patient's
/// right on the image's left; anterior up in axial slices), letters at its edges, a scale bar, contours as
/// vectors.
Figure slice_figure(const Volume& volume, Plane plane, const Eigen::Vector3d& centre_lps, double field_mm,
                    const std::vector<Contour>& contours, const std::string& id);

}  // namespace emmetrope::report
