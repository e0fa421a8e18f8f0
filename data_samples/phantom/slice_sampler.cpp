#include "data_samples/phantom/slice_sampler.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

/// Depth of a fine cell's points within their layers, in sixteenths of it: an ordered dither, so that a
/// border parallel to the slice is met by all cells of a voxel at different depths.
constexpr std::array<double, std::size_t{fine} * fine> dither{0, 8,  2, 10, 12, 4, 14, 6,
                                                              3, 11, 1, 9,  15, 7, 13, 5};

/// Values in the order of these, evenly spaced about 0 within a cell: the mean of few quasi-random numbers is
/// not 0, and would displace the object.
void centre_by_rank(std::vector<double>& values) {
  const std::vector<double> sequence = values;
  const auto count = static_cast<double>(sequence.size());
  for (double& value : values) {
    const auto below =
        std::count_if(sequence.begin(), sequence.end(), [&](double other) { return other < value; });
    value = (static_cast<double>(below) + 0.5) / count - 0.5;
  }
}

/// The profile at t thicknesses off the slice's middle.
double profile_at(SliceProfile profile, double t) {
  t = std::abs(t);
  switch (profile) {
    case SliceProfile::box:
    case SliceProfile::encoded:  // its layers
      return 1;
    case SliceProfile::trapezoid:
      return std::clamp((0.6 - t) / 0.2, 0.0, 1.0);
    case SliceProfile::gaussian:
      return std::exp(-4 * std::log(2.0) * t * t);
  }
  return 0;
}

}  // namespace

Layers layers_of(SliceProfile profile, double thickness_mm, int per_thickness) {
  const double reach = profile == SliceProfile::trapezoid  ? 0.6
                       : profile == SliceProfile::gaussian ? 1.25
                                                           : 0.5;
  const int count = static_cast<int>(std::lround(2 * per_thickness * reach));
  Layers layers;
  layers.step_mm = 2 * reach * thickness_mm / count;
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    layers.begin_mm.push_back(-reach * thickness_mm + i * layers.step_mm);
    layers.weight.push_back(profile_at(profile, -reach + 2 * reach * (i + 0.5) / count));
    // R2 sequence (Roberts 2018): even in the plane however many layers there are.
    layers.shift_x.push_back(std::fmod(0.5 + 0.7548776662466927 * i, 1.0));
    layers.shift_y.push_back(std::fmod(0.5 + 0.5698402909980532 * i, 1.0));
    sum += layers.weight.back();
  }
  for (double& weight : layers.weight) weight /= sum;
  centre_by_rank(layers.shift_x);
  centre_by_rank(layers.shift_y);
  return layers;
}

SliceSampler::SliceSampler(const Anatomy& anatomy, const StackPlan& plan, const Sensitivity& sensitivity,
                           const SlicePose& pose, int columns, int rows, int layers_near_globe,
                           int layers_elsewhere)
    : anatomy_(anatomy),
      plan_(plan),
      sensitivity_(sensitivity),
      pose_(pose),
      columns_(columns),
      rows_(rows),
      layers_(layers_of(plan.profile, plan.slice_thickness_mm, layers_near_globe)),
      far_layers_(layers_of(plan.profile, plan.slice_thickness_mm, layers_elsewhere)) {
  for (std::size_t i = 0; i < tissue_count; ++i)
    signal_[i] = reference_intensity * signal_of(static_cast<Tissue>(i), plan.contrast) *
                 (tissue_table()[i].is_fat ? plan.fat_left : 1);
}

Vector3d SliceSampler::in_scanner(double column, double row, double across_mm) const {
  return pose_.first_voxel + column * plan_.pixel_mm * plan_.along_row +
         row * plan_.pixel_mm * plan_.along_column + across_mm * plan_.normal();
}

Vector3d SliceSampler::in_object(const Vector3d& scanner_point) const {
  return pose_.object_from_scanner * (scanner_point / pose_.scale);
}

FineSlice SliceSampler::sample() const {
  constexpr unsigned char mixed = 255;
  std::vector<unsigned char> label(static_cast<std::size_t>(columns_) * rows_);
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      Tissue tissue{};
      label[index(column, row)] =
          homogeneous(column, row, tissue) ? static_cast<unsigned char>(tissue) : mixed;
    }
  FineSlice slice;
  slice.columns = columns_;
  slice.rows = rows_;
  slice.water.resize(static_cast<std::size_t>(fine) * fine * columns_ * rows_);
  slice.fat = slice.water;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const unsigned char own = label[index(column, row)];
      bool border = own == mixed;
      for (int y = std::max(0, row - 1); y <= std::min(rows_ - 1, row + 1); ++y)
        for (int x = std::max(0, column - 1); x <= std::min(columns_ - 1, column + 1); ++x)
          border = border || label[index(x, y)] != own;
      if (border || static_cast<Tissue>(own) != Tissue::air)
        fill(slice, column, row, border, static_cast<Tissue>(own));
    }
  return slice;
}

/// Looks on a grid as fine as the smallest structures there.
bool SliceSampler::homogeneous(int column, int row, Tissue& tissue) const {
  const Vector3d middle = in_object(in_scanner(column, row, 0));
  const double detail = anatomy_.near_globe(middle) ? 0.3 : 1.0;
  const double extent = layers_.extent_mm();
  const int across = std::max(1, static_cast<int>(std::ceil(plan_.pixel_mm / (1.1 * detail))));
  const int deep = std::max(2, static_cast<int>(std::ceil(extent / detail)) + 1);
  tissue = anatomy_.tissue_at(middle);
  for (int k = 0; k < deep; ++k)
    for (int j = 0; j < across; ++j)
      for (int i = 0; i < across; ++i) {
        const Vector3d p = in_scanner(column + (i + 0.5) / across - 0.5, row + (j + 0.5) / across - 0.5,
                                      extent * (double(k) / (deep - 1) - 0.5));
        if (anatomy_.tissue_at(in_object(p)) != tissue) return false;
      }
  return true;
}

void SliceSampler::fill(FineSlice& slice, int column, int row, bool border, Tissue tissue) const {
  const bool near = anatomy_.near_globe(in_object(in_scanner(column, row, 0)));
  const Layers& layers = near ? layers_ : far_layers_;
  for (int j = 0; j < fine; ++j)
    for (int i = 0; i < fine; ++i) {
      double water = 0;
      double fat = 0;
      const auto add = [&](Tissue found, double weight) {
        const auto kind = static_cast<std::size_t>(found);
        (tissue_table()[kind].is_fat ? fat : water) += weight * signal_[kind];
      };
      const double x = column + (i + 0.5) / fine - 0.5;
      const double y = row + (j + 0.5) / fine - 0.5;
      if (!border) {
        add(tissue, 1);
      } else {
        const double depth = (dither[fine * j + i] + 0.5) / (fine * fine) * layers.step_mm;
        for (std::size_t k = 0; k < layers.weight.size(); ++k) {
          const Vector3d p = in_scanner(x + layers.shift_x[k] / fine, y + layers.shift_y[k] / fine,
                                        layers.begin_mm[k] + depth);
          add(anatomy_.tissue_at(in_object(p)), layers.weight[k]);
        }
      }
      const double sensitivity = sensitivity_(in_scanner(x, y, 0));
      const std::size_t at = (static_cast<std::size_t>(row) * fine + j) * fine * columns_ +
                             static_cast<std::size_t>(column) * fine + i;
      slice.water[at] = sensitivity * water;
      slice.fat[at] = sensitivity * fat;
    }
}

}  // namespace emmetrope::phantom
