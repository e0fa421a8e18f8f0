#include "data_samples/phantom/render.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <random>

#include "data_samples/phantom/k_space.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double surface_coil_radius_mm = 35;
constexpr double surface_coil_in_front_mm = 12;  // of the corneal apex
constexpr double head_coil_reach_mm = 95;

std::uint64_t mixed(std::uint64_t seed, std::uint64_t salt) {  // splitmix64
  std::uint64_t z = seed + 0x9E3779B97F4A7C15ULL * (salt + 1);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

/// Points across a slice and their weights, which sum to 1. `at_mm` is where each layer begins.
struct Layers {
  std::vector<double> begin_mm, weight;
  std::vector<double> shift_x, shift_y;  ///< within a fine cell, -0.5 to 0.5
  double step_mm = 0;
};

/// \param per_thickness  layers within the slice's thickness
Layers layers_of(SliceProfile profile, double thickness_mm, int per_thickness) {
  // Half extent in thicknesses and the profile at t thicknesses off the centre.
  const double reach = profile == SliceProfile::box ? 0.5 : profile == SliceProfile::trapezoid ? 0.6 : 1.25;
  const auto value = [profile](double t) {
    t = std::abs(t);
    if (profile == SliceProfile::box) return 1.0;
    if (profile == SliceProfile::trapezoid) return std::clamp((0.6 - t) / 0.2, 0.0, 1.0);
    return std::exp(-4 * std::log(2.0) * t * t);
  };
  const int count = static_cast<int>(std::lround(2 * per_thickness * reach));
  Layers layers;
  layers.step_mm = 2 * reach * thickness_mm / count;
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    const double t = -reach + 2 * reach * (i + 0.5) / count;
    layers.begin_mm.push_back(-reach * thickness_mm + i * layers.step_mm);
    layers.weight.push_back(value(t));
    layers.shift_x.push_back(std::fmod(0.5 + 0.7548776662466927 * i, 1.0) - 0.5);  // R2 sequence
    layers.shift_y.push_back(std::fmod(0.5 + 0.5698402909980532 * i, 1.0) - 0.5);
    sum += layers.weight.back();
  }
  for (double& weight : layers.weight) weight /= sum;
  return layers;
}

/// Sensitivity of the coil at a point of the scanner.
class Sensitivity {
 public:
  Sensitivity(const StackPlan& plan, const Anatomy& anatomy) : coil_(plan.coil) {
    const PlacedEye& eye = anatomy.eye(plan.coil_eye);
    const Vector3d between = 0.5 * (anatomy.eye(Laterality::od).globe_centre_lps() +
                                    anatomy.eye(Laterality::os).globe_centre_lps());
    if (coil_ == Coil::surface) centre_ = eye.lps_from_eye * Vector3d(0, 0, surface_coil_in_front_mm);
    if (coil_ == Coil::head) centre_ = between + Vector3d(0, 85, 20);
    at_reference_ = raw(coil_ == Coil::surface ? eye.globe_centre_lps() : between);
  }
  double operator()(const Vector3d& p) const { return raw(p) / at_reference_; }

 private:
  double raw(const Vector3d& p) const {
    if (coil_ == Coil::uniform) return 1;
    const double d2 = (p - centre_).squaredNorm();
    if (coil_ == Coil::head) return 1 + 0.25 * d2 / (head_coil_reach_mm * head_coil_reach_mm);
    const double t = 1 + d2 / (surface_coil_radius_mm * surface_coil_radius_mm);
    return 1 / (t * std::sqrt(t));
  }
  Coil coil_;
  Vector3d centre_ = Vector3d::Zero();
  double at_reference_ = 1;
};

/// Samples the object on the fine grid of one slice.
class SliceSampler {
 public:
  SliceSampler(const Anatomy& anatomy, const StackPlan& plan, const Sensitivity& sensitivity,
               const Isometry3d& object_from_image, double scale, const Vector3d& first_voxel, int columns,
               int rows)
      : anatomy_(anatomy),
        plan_(plan),
        sensitivity_(sensitivity),
        object_from_image_(object_from_image),
        inverse_scale_(1 / scale),
        first_(first_voxel),
        columns_(columns),
        rows_(rows),
        layers_(layers_of(plan.profile, plan.slice_thickness_mm, 10)),
        far_layers_(layers_of(plan.profile, plan.slice_thickness_mm, 4)) {
    for (std::size_t i = 0; i < tissue_count; ++i)
      signal_[i] = reference_intensity * signal_of(static_cast<Tissue>(i), plan.contrast);
  }

  FineSlice sample() const {
    constexpr unsigned char mixed_label = 255;
    std::vector<unsigned char> label(static_cast<std::size_t>(columns_) * rows_);
    for (int row = 0; row < rows_; ++row)
      for (int column = 0; column < columns_; ++column) {
        Tissue tissue{};
        label[index(column, row)] =
            homogeneous(column, row, tissue) ? static_cast<unsigned char>(tissue) : mixed_label;
      }
    FineSlice slice;
    slice.columns = columns_;
    slice.rows = rows_;
    slice.water.resize(static_cast<std::size_t>(fine) * fine * columns_ * rows_);
    slice.fat = slice.water;
    for (int row = 0; row < rows_; ++row)
      for (int column = 0; column < columns_; ++column) {
        const unsigned char own = label[index(column, row)];
        bool border = own == mixed_label;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx) {
            const int x = std::clamp(column + dx, 0, columns_ - 1);
            const int y = std::clamp(row + dy, 0, rows_ - 1);
            border = border || label[index(x, y)] != own;
          }
        if (border || own != static_cast<unsigned char>(Tissue::air)) fill(slice, column, row, border, own);
      }
    return slice;
  }

 private:
  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * columns_ + column; }

  Vector3d in_image(double column, double row, double across_mm) const {
    return first_ + column * plan_.pixel_mm * plan_.along_row + row * plan_.pixel_mm * plan_.along_column +
           across_mm * plan_.normal();
  }
  Tissue tissue_at(const Vector3d& image_point) const {
    return anatomy_.tissue_at(object_from_image_ * (inverse_scale_ * image_point));
  }

  bool near_globe(int column, int row) const {
    return anatomy_.detail_mm(object_from_image_ * (inverse_scale_ * in_image(column, row, 0))) < 1;
  }

  /// Looks on a grid as fine as the smallest structures there.
  bool homogeneous(int column, int row, Tissue& tissue) const {
    const double detail =
        anatomy_.detail_mm(object_from_image_ * (inverse_scale_ * in_image(column, row, 0)));
    const double extent = layers_.step_mm * static_cast<double>(layers_.weight.size());
    const int across = std::max(1, static_cast<int>(std::ceil(plan_.pixel_mm / (1.1 * detail))));
    const int deep = std::max(2, static_cast<int>(std::ceil(extent / detail)) + 1);
    tissue = tissue_at(in_image(column, row, 0));
    for (int k = 0; k < deep; ++k)
      for (int j = 0; j < across; ++j)
        for (int i = 0; i < across; ++i) {
          const Vector3d p = in_image(column + (i + 0.5) / across - 0.5, row + (j + 0.5) / across - 0.5,
                                      extent * (double(k) / (deep - 1) - 0.5));
          if (tissue_at(p) != tissue) return false;
        }
    return true;
  }

  void fill(FineSlice& slice, int column, int row, bool border, unsigned char label) const {
    const Layers& through = near_globe(column, row) ? layers_ : far_layers_;
    const std::size_t layers = through.weight.size();
    for (int j = 0; j < fine; ++j)
      for (int i = 0; i < fine; ++i) {
        double water = 0;
        double fat = 0;
        const auto add = [&](std::size_t tissue, double weight) {
          (tissue_table()[tissue].is_fat ? fat : water) += weight * signal_[tissue];
        };
        const double x = column + (i + 0.5) / fine - 0.5;
        const double y = row + (j + 0.5) / fine - 0.5;
        if (border) {
          // One point in each layer of each fine cell; depth staggered from cell to cell and place within the
          // cell from layer to layer (R2 sequence), so that no border, however it lies, meets the points in
          // step.
          static constexpr double order[fine * fine] = {0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5};
          const double stagger = (order[fine * j + i] + 0.5) / (fine * fine);
          for (std::size_t k = 0; k < layers; ++k) {
            const double u = std::fmod(0.5 + 0.7548776662466927 * static_cast<double>(k), 1.0) - 0.5;
            const double v = std::fmod(0.5 + 0.5698402909980532 * static_cast<double>(k), 1.0) - 0.5;
            const Vector3d p =
                in_image(x + u / fine, y + v / fine, through.begin_mm[k] + stagger * through.step_mm);
            add(static_cast<std::size_t>(tissue_at(p)), through.weight[k]);
          }
        } else {
          add(label, 1);
        }
        const double sensitivity = sensitivity_(in_image(x, y, 0));
        const std::size_t at =
            (static_cast<std::size_t>(row) * fine + j) * (static_cast<std::size_t>(columns_) * fine) +
            static_cast<std::size_t>(column) * fine + i;
        slice.water[at] = sensitivity * water;
        slice.fat[at] = sensitivity * fat;
      }
  }

  const Anatomy& anatomy_;
  const StackPlan& plan_;
  const Sensitivity& sensitivity_;
  Isometry3d object_from_image_;
  double inverse_scale_;
  Vector3d first_;
  int columns_, rows_;
  Layers layers_, far_layers_;  ///< around the globes; in the rest of the head
  std::array<double, tissue_count> signal_{};
};

Vector3d gaussian_vector(std::mt19937_64& random, double sigma) {
  std::normal_distribution<double> normal(0, 1);
  const double x = normal(random);
  const double y = normal(random);
  return sigma * Vector3d(x, y, normal(random));
}

/// The head's movement between the first stack and this one, about the point midway between the globes.
Isometry3d movement(const Anatomy& anatomy, const Disturbances& disturbances, std::size_t index) {
  if (index == 0) return Isometry3d::Identity();
  std::mt19937_64 random(mixed(disturbances.seed, 1000 + index));
  const Vector3d shift = gaussian_vector(random, disturbances.motion_mm);
  const Vector3d turn = gaussian_vector(random, disturbances.motion_deg * degree);
  const Vector3d pivot =
      0.5 * (anatomy.eye(Laterality::od).globe_centre_lps() + anatomy.eye(Laterality::os).globe_centre_lps());
  const double angle = turn.norm();
  const Eigen::AngleAxisd rotation(angle, angle > 0 ? Vector3d(turn / angle) : Vector3d::UnitX());
  return Eigen::Translation3d(pivot + shift) * rotation * Eigen::Translation3d(-pivot);
}

/// Even margin around the image, so that the field of view's edge does not ring into it.
int margin_of(int pixels) { return std::max(8, pixels / 32); }

}  // namespace

RenderedStack render(const Anatomy& anatomy, const Protocol& protocol, std::size_t index, int threads,
                     const std::function<void()>& advance) {
  const Disturbances& disturbances = protocol.disturbances;
  RenderedStack stack;
  stack.plan = protocol.stacks.at(index);
  stack.scanner_from_reference = movement(anatomy, disturbances, index);
  stack.sigma = disturbances.snr > 0 ? reference_intensity / disturbances.snr : 0;
  const StackPlan& plan = stack.plan;
  stack.slices.resize(plan.slices);

  const Sensitivity sensitivity(plan, anatomy);
  const int margin_x = margin_of(plan.columns);
  const int margin_y = margin_of(plan.rows);
  const int columns = plan.columns + 2 * margin_x;
  const int rows = plan.rows + 2 * margin_y;

  const auto render_slice = [&](int number) {
    std::mt19937_64 random(mixed(disturbances.seed, 1000000 * (index + 1) + number));
    const Isometry3d moved = Eigen::Translation3d(gaussian_vector(random, disturbances.slice_motion_mm)) *
                             stack.scanner_from_reference;
    const SliceSampler sampler(anatomy, plan, sensitivity, moved.inverse(), 1 + disturbances.scale_error,
                               stack.position(-margin_x, -margin_y, number), columns, rows);
    KSpace k_space;
    k_space.acquired_readout = plan.acquired_readout;
    k_space.acquired_phase = plan.acquired_phase;
    k_space.fat_shift_px = disturbances.chemical_shift_px;
    k_space.sigma = stack.sigma;
    k_space.seed = random();
    const std::vector<float> image = magnitude_image(sampler.sample(), k_space);
    std::vector<float>& out = stack.slices[number];
    out.reserve(static_cast<std::size_t>(plan.rows) * plan.columns);
    for (int row = 0; row < plan.rows; ++row) {
      const auto* begin = image.data() + static_cast<std::size_t>(row + margin_y) * columns + margin_x;
      out.insert(out.end(), begin, begin + plan.columns);
    }
    if (advance) advance();
  };

  std::atomic<int> next{0};
  std::vector<std::future<void>> workers;
  for (int i = 0; i < std::max(1, threads); ++i)
    workers.push_back(std::async(std::launch::async, [&] {
      for (int number = next++; number < plan.slices; number = next++) render_slice(number);
    }));
  for (auto& worker : workers) worker.get();
  return stack;
}

}  // namespace emmetrope::phantom
