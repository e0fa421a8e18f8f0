#include "segmentation/fit/curved_edges.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/eye_drawing.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::MatrixXf;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// How far from the globe's centre the eye with its lid is drawn, as far as voxels are compared; over so many
/// pixels more the drawing fades into what surrounds the globe.
constexpr double drawn_mm = 19;
constexpr int fading_pixels = 6;

/// In smaller pixels straight edges move no border by more than 0.03 mm, and the drawing would take minutes.
constexpr double coarse_pixel_mm = 0.6;

/// So many that what folds back into the image is 0.005 of a border's step at most.
constexpr Index cells_per_pixel = 6;

/// One direction of a slice's lattice: pixels, cut into cells.
struct Axis {
  Vector3d along;  ///< LPS, unit
  double pixel_mm;
  Index pixels;

  Axis(Vector3d direction, double spacing_mm, double reach_mm)
      : along(std::move(direction)),
        pixel_mm(spacing_mm),
        pixels(2 * static_cast<Index>(std::ceil(reach_mm / spacing_mm)) + 1) {}

  double cell_mm() const { return pixel_mm / static_cast<double>(cells_per_pixel); }
};

/// Of a cell within its pixel or slice, in cells from the middle.
double offset(Index cell, Index cells) {
  return static_cast<double>(cell) - 0.5 * static_cast<double>(cells - 1);
}

/// By how much a cell (column) adds to a pixel (row): the k-space window's transform, sharpened by what the
/// mean over a cell blurs.
MatrixXf window_response(const Axis& axis, double cutoff_per_mm, double filter) {
  constexpr int steps = 400;
  const auto response = [&](double x_mm) {
    double sum = 0;
    for (int i = 0; i < steps; ++i) {
      const double of_cutoff = (i + 0.5) / steps, k = of_cutoff * cutoff_per_mm,
                   blur = pi * k * axis.cell_mm();
      const double window = 1 - filter / 2 * (1 - std::cos(pi * of_cutoff));
      sum += window * std::cos(2 * pi * k * x_mm) * blur / std::sin(blur);
    }
    return 2 * sum * cutoff_per_mm / steps * axis.cell_mm();
  };
  // Of the distance alone, counted in half cells.
  std::map<Index, float> known;
  const Index cells = axis.pixels * cells_per_pixel;
  MatrixXf window(axis.pixels, cells);
  for (Index i = 0; i < axis.pixels; ++i)
    for (Index j = 0; j < cells; ++j) {
      const Index half_cells = std::abs(2 * cells_per_pixel * i + cells_per_pixel - 1 - 2 * j);
      const auto [at, is_new] = known.try_emplace(half_cells, 0.0F);
      if (is_new)
        at->second = static_cast<float>(response(0.5 * axis.cell_mm() * static_cast<double>(half_cells)));
      window(i, j) = at->second;
    }
  return window;
}

/// One stack's eye, drawn and imaged slice by slice; what surrounds the globe counts as 0.
class StackImage {
 public:
  StackImage(const ForwardModel& model, const ForwardModel::AtParameters& at, const VectorXd& a,
             const Stack& stack, int index)
      : at_(at),
        index_(index),
        background_(a[surround]),
        fading_mm_(fading_pixels * std::max(stack.column_spacing_mm, stack.row_spacing_mm)),
        row_(stack.along_row, stack.column_spacing_mm, drawn_mm + fading_mm_),
        column_(stack.along_column, stack.row_spacing_mm, drawn_mm + fading_mm_),
        slice_(stack.normal, stack.slice_spacing_mm(), drawn_mm + fading_mm_),
        globe_(a.segment<3>(apex_x) - (a[axial_length] - a[globe_z]) * model.axis(a) -
               a.segment<3>(model.layout().stack(index) + shift_first)),
        slice_mm_(slice_mm_of(model, index)),
        layers_(layers_of(model, index)),
        cell_(cell_of(model, at, index)),
        drawing_(model, at, a, index, cell_, voxel_reach_mm()) {
    const StackSampling& sampling = model.stacks()[static_cast<std::size_t>(index)];
    const int at_stack = model.layout().stack(index);
    const double filter = a[at_stack + k_space_filter], of_filter = log_cutoff_per_filter * filter,
                 ratio = a[at_stack + log_sharpness_ratio], reach = a[at_stack + log_sharpness] + of_filter,
                 through = a[at_stack + log_sharpness_through] + of_filter;
    along_row_ =
        window_response(row_, sampling.row_cutoff_per_mm * std::exp(reach + ratio / 2), filter).transpose();
    along_column_ =
        window_response(column_, sampling.column_cutoff_per_mm * std::exp(reach - ratio / 2), filter);
    if (sampling.slice_cutoff_per_mm > 0)
      along_slice_ = window_response(slice_, sampling.slice_cutoff_per_mm * std::exp(through), filter);
  }

  /// Intensities at samples of one slice.
  std::vector<double> at(const std::vector<Sample*>& slice) {
    // A lattice that holds the slice's voxels, with the globe in its middle.
    const Vector3d& some = slice.front()->position;
    const auto to_globe = [&](const Axis& axis) {
      const Index pixels = std::lround((globe_ - some).dot(axis.along) / axis.pixel_mm) - axis.pixels / 2;
      return static_cast<double>(pixels) * axis.pixel_mm * axis.along;
    };
    Vector3d first = some + to_globe(row_) + to_globe(column_);
    MatrixXf image;
    if (along_slice_.size() > 0) {
      if (encoded_.empty()) encode_slices(first + to_globe(slice_));
      first = encoded_from_;
      const Index at_slice = std::lround((some - first).dot(slice_.along) / slice_.pixel_mm);
      image = encoded_[static_cast<std::size_t>(std::clamp(at_slice, Index{0}, slice_.pixels - 1))];
    } else {
      image = along_column_ * (drawn_from(first, 0, layers_) * along_row_);
    }
    std::vector<double> intensity;
    for (const Sample* sample : slice) {
      const auto place = [&](const Axis& axis) {
        // A pass may move the globe so far that voxels chosen before it lie beyond the lattice, whose rim is
        // background as they are.
        const Index pixel = std::lround((sample->position - first).dot(axis.along) / axis.pixel_mm);
        return std::clamp(pixel, Index{0}, axis.pixels - 1);
      };
      intensity.push_back(background_ + image(place(column_), place(row_)));
    }
    return intensity;
  }

 private:
  /// Encoded slices follow on each other, however thick the header calls them.
  double slice_mm_of(const ForwardModel& model, int index) const {
    const StackSampling& sampling = model.stacks()[static_cast<std::size_t>(index)];
    return sampling.slice_cutoff_per_mm > 0 ? slice_.pixel_mm : sampling.thickness_mm;
  }
  /// No thicker than a cell is wide.
  int layers_of(const ForwardModel& model, int index) const {
    if (model.stacks()[static_cast<std::size_t>(index)].slice_cutoff_per_mm > 0)
      return static_cast<int>(cells_per_pixel);
    return static_cast<int>(std::ceil(slice_mm_ / std::min(row_.cell_mm(), column_.cell_mm())));
  }
  Eigen::Matrix3d cell_of(const ForwardModel& model, const ForwardModel::AtParameters& at, int index) const {
    Eigen::Matrix3d edges;
    edges << row_.cell_mm() * row_.along, column_.cell_mm() * column_.along,
        slice_mm_ / layers_ * model.stacks()[static_cast<std::size_t>(index)].normal;
    for (int i = 0; i < 3; ++i)
      edges.col(i) = at.to_eye(edges.col(i), index) - at.to_eye(Vector3d::Zero(), index);
    return edges;
  }
  double voxel_reach_mm() const {
    return 0.5 * Vector3d(row_.pixel_mm, column_.pixel_mm, slice_mm_).norm() + 0.1;
  }

  void encode_slices(const Vector3d& first) {
    encoded_from_ = first;
    encoded_.assign(static_cast<std::size_t>(slice_.pixels), MatrixXf::Zero(column_.pixels, row_.pixels));
    for (Index s = 0; s < slice_.pixels; ++s)
      for (int l = 0; l < layers_; ++l) {
        const MatrixXf layer =
            along_column_ *
            (drawn_from(first + static_cast<double>(s) * slice_.pixel_mm * slice_.along, l, l + 1) *
             along_row_);
        for (Index to = 0; to < slice_.pixels; ++to)
          encoded_[static_cast<std::size_t>(to)] += along_slice_(to, s * cells_per_pixel + l) * layer;
      }
  }

  MatrixXf drawn_from(const Vector3d& first, int layer_begin, int layer_end) {
    MatrixXf fine = MatrixXf::Zero(column_.pixels * cells_per_pixel, row_.pixels * cells_per_pixel);
    for (Index r = 0; r < column_.pixels; ++r)
      for (Index c = 0; c < row_.pixels; ++c) {
        const Vector3d voxel = first + static_cast<double>(c) * row_.pixel_mm * row_.along +
                               static_cast<double>(r) * column_.pixel_mm * column_.along;
        const double drawn = 1 - smooth_step((voxel - globe_).norm(), drawn_mm, drawn_mm + fading_mm_);
        if (drawn <= 0) continue;
        auto block = fine.block<cells_per_pixel, cells_per_pixel>(r * cells_per_pixel, c * cells_per_pixel);
        const Vector3d p = at_.to_eye(voxel, index_);
        if (!drawing_.enter(p)) {
          block.setConstant(static_cast<float>(drawn * (drawing_(p) - background_)));
          continue;
        }
        for (Index j = 0; j < cells_per_pixel; ++j)
          for (Index i = 0; i < cells_per_pixel; ++i) {
            double sum = 0;
            for (int l = layer_begin; l < layer_end; ++l)
              sum += drawing_(p + cell_ * Vector3d(offset(i, cells_per_pixel), offset(j, cells_per_pixel),
                                                   offset(l, layers_)));
            block(j, i) = static_cast<float>(drawn * (sum / (layer_end - layer_begin) - background_));
          }
      }
    return fine;
  }

  const ForwardModel::AtParameters& at_;
  int index_;
  double background_;
  double fading_mm_;  ///< from `drawn_mm` on
  Axis row_, column_, slice_;
  Vector3d globe_;   ///< its centre, in the stack's LPS
  double slice_mm_;  ///< what is drawn of one
  int layers_;       ///< of cells through it
  Eigen::Matrix3d cell_;
  EyeDrawing drawing_;
  MatrixXf along_row_, along_column_;  ///< cells to pixels, from the right and from the left
  MatrixXf along_slice_;               ///< empty: slices have a box profile
  std::vector<MatrixXf> encoded_;
  Vector3d encoded_from_;  ///< its first voxel
};

}  // namespace

void add_curved_edges(std::vector<Sample>& samples, const ForwardModel& model, const VectorXd& parameters,
                      const std::vector<ObservedStack>& stacks) {
  const ForwardModel::AtParameters at(model, parameters);
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    const Stack& stack = *stacks[k].stack;
    if (std::max(stack.column_spacing_mm, stack.row_spacing_mm) < coarse_pixel_mm) continue;
    StackImage image(model, at, parameters, stack, static_cast<int>(k));
    std::map<long, std::vector<Sample*>> slices;  // by height
    for (Sample& sample : samples)
      if (sample.stack == k && sample.zone == Zone::rear)
        slices[std::lround(100 * (sample.position - stack.slice_position.front()).dot(stack.normal))]
            .push_back(&sample);
    for (const auto& [height, slice] : slices) {
      const std::vector<double> intensity = image.at(slice);
      for (std::size_t i = 0; i < slice.size(); ++i) {
        slice[i]->curved = 0;
        const double planar = at.intensity(*slice[i], nullptr) / at.coil(*slice[i]);
        slice[i]->curved = static_cast<float>(intensity[i] - planar);
      }
    }
  }
}

}  // namespace emmetrope::segmentation
