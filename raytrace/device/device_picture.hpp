#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/base/progress.hpp"
#include "raytrace/device/device_rays.hpp"
#include "raytrace/device/fast_map.hpp"
#include "raytrace/device/image_change.hpp"
#include "raytrace/retina/retina_pixels.hpp"

namespace emmetrope::raytrace {

/// What every device is given for a picture. It outlives the devices' pictures, which may use its memory.
struct PictureJob {
  OpticalSystem system;
  DeviceScene view;
  RetinaPixels pixels;
  RetinalGrid grid;
  KernelForm form;  ///< but for lanes, tiles, waves, which a device decides
  int samples = 1;  ///< rays a pixel that are wanted
  double aim_plane_z_mm = 0;
  std::vector<float> colours;          ///< `colour` in kernels/trace.cl
  std::vector<float> cap;              ///< where RANDOM_CAP: the paper's aim
  std::optional<float> pupil_falloff;  ///< Stiles-Crawford
  std::vector<float> airy;             ///< where DIFFRACTION
  std::optional<ImageChange> change;   ///< where there are derivatives
  std::optional<FastMap> map;
};

/// Sums over samples, pixels row after row.
struct PictureSums {
  std::vector<float> light;               ///< 3 a pixel, weighted
  std::vector<float> weight;              ///< 1 a pixel
  std::vector<float> derivatives;         ///< 3 a pixel and derivative, weighted
  std::array<std::uint64_t, 4> counts{};  ///< vignetted, tir, missed_surface, missed_scene
  int samples = 0;
};

/// Rows of the picture, as rows of blocks (`block_edges` of its height): [first, end).
struct Band {
  int first = 0, end = 0;
};

/// A picture on one device: its buffers, its kernel and its order of pixels.
class DevicePicture {
 public:
  /// \throw cl::Error
  DevicePicture(OpenCl& cl, const PictureJob& job);

  /// Samples of a pass must be a multiple of this.
  int multiple() const;
  std::uint64_t bytes() const { return bytes_; }
  /// Kernel calls of a pass over these rows.
  std::size_t calls(const std::vector<Band>& bands, int samples) const;

  /// Traces samples first_sample ... first_sample + samples - 1 of the sequence that `seed` starts.
  /// \throw cl::Error
  void trace(const std::vector<Band>& bands, std::uint64_t seed, int first_sample, int samples,
             Progress& progress);
  /// Adds what the last pass found in these rows.
  /// \throw cl::Error
  void add_to(PictureSums& sums, const std::vector<Band>& bands);

 private:
  struct Slice {
    std::size_t first = 0, end = 0;  ///< items
  };
  Slice items_of(const Band& band) const;
  /// Work-items of a work-group.
  std::size_t group() const { return work_group / order_.together; }
  std::size_t items_a_call(int samples) const;

  OpenCl& cl_;
  const PictureJob& job_;
  KernelForm form_;
  PixelOrder order_;
  std::vector<std::size_t> first_items_;
  std::uint64_t bytes_ = 0;
  int last_samples_ = 0;
  cl::Kernel kernel_;
  SystemBuffers system_;
  SceneBuffers scene_;
  std::vector<cl::Buffer> kept_;  ///< a kernel does not keep its arguments
  cl::Buffer image_, states_, derivatives_;
  cl_uint place_of_slice_ = 0;
};

}  // namespace emmetrope::raytrace
