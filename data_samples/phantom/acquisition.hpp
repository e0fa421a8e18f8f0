#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "data_samples/phantom/anatomy.hpp"

namespace emmetrope::phantom {

/// How a slice weighs what lies across it.
enum class SliceProfile {
  box,        ///< 1 within the thickness
  trapezoid,  ///< full width at half maximum = thickness, ramps of a fifth of it: a good selective pulse
  gaussian,   ///< full width at half maximum = thickness
  encoded,    ///< 3-D: slices are cut off in k-space as rows are, all of it acquired
};

/// Sensitivity of the receive coil.
enum class Coil {
  uniform,
  surface,  ///< a loop of 35 mm radius 12 mm in front of the eye; 1 at the globe's centre
  head,     ///< rises by a quarter from the head's centre to its surface; 1 midway between the globes
};

/// One stack of parallel slices, placed. Spacing and extent as in DICOM; LPS, mm.
struct StackPlan {
  std::string name;                           ///< SeriesDescription: "od coronal T2"
  Eigen::Vector3d centre = {0, 0, 0};         ///< of the whole stack
  Eigen::Vector3d along_row = {1, 0, 0};      ///< unit: column index grows
  Eigen::Vector3d along_column = {0, 0, -1};  ///< unit: row index grows
  int columns = 208, rows = 208, slices = 16;
  double pixel_mm = 0.3125;
  double slice_thickness_mm = 2;
  double slice_spacing_mm = 2;  ///< between centres
  SliceProfile profile = SliceProfile::box;
  Contrast contrast = Contrast::T2;
  Coil coil = Coil::uniform;
  Laterality coil_eye = Laterality::od;  ///< in front of which a surface coil lies
  /// Fraction of k-space that is acquired along rows (readout) and columns (phase); the rest is zero-filled.
  double acquired_readout = 1, acquired_phase = 1;
  double fat_left = 1;  ///< of fat's signal; below 1: fat suppression
  double repetition_time_ms = 2500, echo_time_ms = 90, flip_angle_deg = 90;

  Eigen::Vector3d normal() const { return along_row.cross(along_column); }
  /// Centre of the first voxel of a slice.
  Eigen::Vector3d slice_position(int slice) const {
    return centre - 0.5 * (columns - 1) * pixel_mm * along_row - 0.5 * (rows - 1) * pixel_mm * along_column +
           (slice - 0.5 * (slices - 1)) * slice_spacing_mm * normal();
  }
};

/// How a scanner's console weighs k-space.
enum class Window {
  none,
  hann,   ///< to 0 at the edge of what was acquired
  fermi,  ///< flat to 0.8 of it
};

/// What disturbs a whole study.
struct Disturbances {
  /// Vitreous (T2) or fat (T1) over sigma of one channel, where the coil's sensitivity is 1
  double snr = 20;
  double motion_mm = 0;        ///< rms per axis of the head's shift of every stack but the first
  double motion_deg = 0;       ///< rms per axis of its rotation about the point midway between the globes
  double slice_motion_mm = 0;  ///< rms per axis of shifts between the slices of a stack
  double scale_error = 0;  ///< images show lengths (1 + this) times too long about the isocentre (gradients)
  double chemical_shift_px = 0;  ///< fat appears this many pixels further along the rows (readout)
  Window window = Window::none;  ///< with which the scanner's console smooths the images, noise included
  double noise_variation = 0;    ///< relative amplitude with which the noise varies over the picture
  double echo_train = 0;  ///< the signal falls by exp(-this) towards the edge of k-space, along columns
  double ghost = 0;       ///< amplitude of two ghosts, a third of the field of view off along columns
  double slice_gain = 0;  ///< rms of relative differences in brightness between slices
  std::uint64_t seed = 1;
};

struct Protocol {
  std::string name;
  std::vector<StackPlan> stacks;
  Disturbances disturbances;
};

/// Whether no slice is excited on its own: none moves or brightens singly.
bool all_encoded(const Protocol& protocol);

/// "surface-coil", "head-t2" or "head-t1", planned on this head as a technologist would: near the eyes' axes,
/// not on them.
/// \throw Error (usage) for another name
Protocol make_protocol(const std::string& name, const Anatomy& anatomy);

/// A stack from words:
/// "od-coronal:pixel_mm=0.4,slice_mm=2,gap_mm=0,matrix=192x160,slices=16,tilt_deg=4/-3,contrast=t2,
/// profile=box,coil=surface,acquired=1x0.8". Planes: axial, coronal, sagittal; at: od, os, head. The tilt
/// turns the stack about its rows, then about its columns.
/// \throw Error (usage) naming the key
StackPlan make_stack(const std::string& words, const Anatomy& anatomy);

}  // namespace emmetrope::phantom
