#include "segmentation/labels/hand_labels.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/even_points.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/observation.hpp"
#include "segmentation/intake/decoder.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

std::string grid_of(const Stack& stack) {
  const Vector3d first = stack.slice_position.front();
  return fmt::format(
      "{} x {} x {} voxels of {:.3f} x {:.3f} x {:.3f} mm, the first at ({:.1f}, {:.1f}, {:.1f}) mm LPS",
      stack.columns, stack.rows, stack.slices(), stack.column_spacing_mm, stack.row_spacing_mm,
      stack.slice_spacing_mm(), first.x(), first.y(), first.z());
}

/// A NIfTI volume as a regular grid of values.
struct Grid {
  explicit Grid(const Stack& volume) : stack(volume), size(volume.columns, volume.rows, volume.slices()) {
    Eigen::Matrix3d lps_from_index;
    lps_from_index << volume.along_row * volume.column_spacing_mm,
        volume.along_column * volume.row_spacing_mm, volume.normal * volume.slice_spacing_mm();
    index_from_lps = lps_from_index.inverse();
  }
  /// The voxel with this centre, within a tenth of a voxel.
  std::optional<Eigen::Vector3i> voxel_at(const Vector3d& lps) const {
    const Vector3d index = index_from_lps * (lps - stack.slice_position.front());
    const Vector3d nearest = index.array().round();
    if (!index.allFinite() || (index - nearest).cwiseAbs().maxCoeff() > 0.1 || nearest.minCoeff() < 0 ||
        (size.cast<double>() - nearest).minCoeff() < 1)
      return std::nullopt;
    return nearest.cast<int>();
  }
  /// How many voxels lie along this direction, which must be a step of one voxel; else 0.
  int size_along(const Vector3d& step) const {
    const Vector3d index = (index_from_lps * step).cwiseAbs();
    Eigen::Index axis = 0;
    if (std::abs(index.maxCoeff(&axis) - 1) > 1e-3) return 0;
    return size[axis];
  }

  const Stack& stack;
  Eigen::Vector3i size;
  Eigen::Matrix3d index_from_lps;
};

/// The volume's values at the stack's voxels; nothing where it is on another grid.
std::optional<std::vector<std::vector<float>>> values_on(const Stack& stack, const Stack& volume) {
  const Grid grid(volume);
  if (grid.size_along(stack.along_row * stack.column_spacing_mm) != stack.columns ||
      grid.size_along(stack.along_column * stack.row_spacing_mm) != stack.rows)
    return std::nullopt;
  std::vector<std::vector<float>> values;
  for (int s = 0; s < stack.slices(); ++s) {
    values.emplace_back();
    for (int r = 0; r < stack.rows; ++r) {
      for (int c = 0; c < stack.columns; ++c) {
        const auto voxel = grid.voxel_at(stack.position(c, r, s));
        if (!voxel) return std::nullopt;
        values.back().push_back(volume.at(voxel->x(), voxel->y(), voxel->z()));
      }
    }
  }
  return values;
}

constexpr int first_label = static_cast<int>(Label::cornea), last_label = static_cast<int>(Label::wall);

/// Label of this eye, none for background and the other eye.
Label label_of(std::uint8_t value, Laterality laterality) {
  const int label = value - (laterality == Laterality::os ? left_eye_offset : 0);
  return label >= first_label && label <= last_label ? static_cast<Label>(label) : Label::none;
}

std::uint8_t checked(float value, const std::filesystem::path& file) {
  const int whole = static_cast<int>(std::lround(std::clamp(value, -1.0F, 255.0F)));
  const bool known =
      whole >= 0 && static_cast<float>(whole) == value &&
      (whole == 0 || label_of(static_cast<std::uint8_t>(whole), Laterality::od) != Label::none ||
       label_of(static_cast<std::uint8_t>(whole), Laterality::os) != Label::none);
  if (!known)
    throw input_error(fmt::format("{}: the label value {} is not known", file.string(), value),
                      "values are 0, 1 to 6 (right eye) and 11 to 16 (left eye) as in labels.json");
  return static_cast<std::uint8_t>(whole);
}

std::size_t stack_of(const std::filesystem::path& file, const Stack& volume,
                     const std::vector<const Stack*>& stacks, std::vector<std::vector<float>>& values) {
  std::string expected;
  for (std::size_t i = 0; i < stacks.size(); ++i) {
    if (auto found = values_on(*stacks[i], volume)) {
      values = std::move(*found);
      return i;
    }
    expected += fmt::format("\n  {}: {}", stacks[i]->name, grid_of(*stacks[i]));
  }
  throw input_error(fmt::format("{}: its grid is no stack's: {}; expected one of{}", file.string(),
                                grid_of(volume), expected),
                    "edit CASE/segmentation/<stack>_labels.nii.gz and save it elsewhere without resampling");
}

void for_each_label(const HandLabels& labels, const Stack& stack, Laterality laterality,
                    const std::function<void(Label, const Vector3d&)>& visit) {
  for (int s = 0; s < stack.slices(); ++s)
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c) {
        const Label label =
            label_of(labels.values[s][static_cast<std::size_t>(r) * stack.columns + c], laterality);
        if (label != Label::none) visit(label, stack.position(c, r, s));
      }
}

/// Where the labels of one eye are in one stack.
struct LabelledEye {
  EyeCandidate globe;
  Vector3d axis;
};

LabelledEye locate(const HandLabels& labels, const Stack& stack, Laterality laterality) {
  std::array<int, last_label + 1> count{};
  Vector3d lens = Vector3d::Zero(), reference = Vector3d::Zero();
  for_each_label(labels, stack, laterality, [&](Label label, const Vector3d& x) {
    ++count[static_cast<std::size_t>(label)];
    if (label == Label::lens) lens += x;
    if (label == Label::vitreous) reference += x;
  });
  for (const auto& [label, name] : {std::pair{Label::cornea, "cornea"},
                                    {Label::anterior_chamber, "anterior chamber"},
                                    {Label::lens, "lens"},
                                    {Label::vitreous, "vitreous body"},
                                    {Label::wall, "wall"}}) {
    if (count[static_cast<std::size_t>(label)] < 20)
      throw input_error(
          fmt::format("{} ({}): the {} has {} voxels with the label {} ({}); 20 are the least", labels.input,
                      stack.name, clinical_name(laterality), count[static_cast<std::size_t>(label)],
                      static_cast<int>(label) + (laterality == Laterality::os ? left_eye_offset : 0), name),
          "an eye is labelled in all its tissues or not at all");
  }
  lens /= count[static_cast<std::size_t>(Label::lens)];
  reference /= count[static_cast<std::size_t>(Label::vitreous)];

  // The sphere through the wall: |x|^2 = 2 c.x + k, about a point near its centre.
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for_each_label(labels, stack, laterality, [&](Label label, const Vector3d& x) {
    if (label != Label::wall) return;
    const Vector3d d = x - reference;
    const Eigen::Vector4d row(2 * d.x(), 2 * d.y(), 2 * d.z(), 1);
    normal += row * row.transpose();
    right += row * d.squaredNorm();
  });
  const Eigen::Vector4d sphere = normal.colPivHouseholderQr().solve(right);
  LabelledEye eye;
  eye.globe.centre = reference + sphere.head<3>();
  constexpr double half_wall_mm = 0.55;
  eye.globe.radius_mm = std::clamp(
      std::sqrt(std::max(0.0, sphere[3] + sphere.head<3>().squaredNorm())) - half_wall_mm, 7.0, 17.0);
  eye.globe.agreement = 1;
  constexpr int directions = 240;
  const Sampler sampler(stack);
  int inside = 0;
  for (int i = 0; i < directions; ++i) {
    const Vector3d wall = eye.globe.centre + eye.globe.radius_mm * fibonacci_direction(i, directions);
    inside += sampler.voxel_coordinates(wall) ? 1 : 0;
  }
  eye.globe.inside = static_cast<double>(inside) / directions;
  eye.axis = (lens - eye.globe.centre).normalized();
  return eye;
}

}  // namespace

bool HandLabels::shows(Laterality laterality) const {
  return std::any_of(values.begin(), values.end(), [&](const std::vector<std::uint8_t>& slice) {
    return std::any_of(slice.begin(), slice.end(),
                       [&](std::uint8_t value) { return label_of(value, laterality) != Label::none; });
  });
}

std::vector<HandLabels> read_hand_labels(const std::vector<std::filesystem::path>& files,
                                         const std::vector<const Stack*>& stacks) {
  std::vector<HandLabels> all;
  Decoder decoder{IntakeLimits{}};
  for (const std::filesystem::path& file : files) {
    const Stack volume = decoder.decode_volume(file).stack;
    HandLabels labels;
    std::vector<std::vector<float>> values;
    labels.stack = stack_of(file, volume, stacks, values);
    labels.input = fmt::format("labels/{}", all.size() + 1);
    for (const auto& slice : values) {
      labels.values.emplace_back();
      for (const float value : slice) labels.values.back().push_back(checked(value, file));
    }
    for (const HandLabels& other : all)
      if (other.stack == labels.stack)
        throw usage_error(
            fmt::format("{}: another --labels is of {} already", file.string(), stacks[labels.stack]->name),
            "give one file a stack");
    if (!labels.shows(Laterality::od) && !labels.shows(Laterality::os))
      throw input_error(file.string() + ": every voxel is 0",
                        "values are 1 to 6 (right eye) and 11 to 16 (left eye) as in labels.json");
    all.push_back(std::move(labels));
  }
  return all;
}

void place_labelled_eyes(const std::vector<HandLabels>& labels, const std::vector<const Stack*>& stacks,
                         FoundEyes& found) {
  const std::vector<FoundEye> seen = found.by_images = found.eyes;
  for (const Laterality laterality : both_eyes) {
    FoundEye eye;
    eye.laterality = laterality;
    eye.lens_contrast = 1;
    eye.axis = Vector3d::Zero();
    for (const HandLabels& one : labels) {
      if (!one.shows(laterality)) continue;
      const LabelledEye located = locate(one, *stacks[one.stack], laterality);
      eye.views.push_back({one.stack, located.globe, 0});
      eye.axis += located.axis;
      for (const FoundEye& other : seen)
        if (other.laterality != laterality &&
            (other.views.front().globe.centre - located.globe.centre).norm() < 15)
          throw input_error(
              fmt::format("{} ({}): the labels of the {} lie in the {}", one.input, stacks[one.stack]->name,
                          clinical_name(laterality), clinical_name(other.laterality)),
              "1 to 6 are the right eye's (at smaller LPS x), 11 to 16 the left eye's");
    }
    if (eye.views.empty()) continue;
    eye.axis.normalize();
    eye.radius_mm = eye.views.front().globe.radius_mm;
    const auto place = std::find_if(found.eyes.begin(), found.eyes.end(),
                                    [&](const FoundEye& f) { return f.laterality >= laterality; });
    if (place != found.eyes.end() && place->laterality == laterality)
      *place = eye;
    else
      found.eyes.insert(place, eye);
  }
  for (StackChoice& choice : found.choices) {
    bool used = false;
    for (const FoundEye& eye : found.eyes)
      for (const EyeView& view : eye.views) used = used || view.stack == choice.stack;
    if (choice.used && !used) choice.reason += "; in the end not used: labels of another stack were given";
    choice.used = used;
  }
  for (const HandLabels& one : labels) {
    StackChoice& choice = found.choices[one.stack];
    choice.reason += (choice.reason.empty() ? "" : "; ") + std::string("its labels were given");
  }
}

Stack label_image(const HandLabels& labels, const Stack& stack, Laterality laterality) {
  Stack image = stack;
  for (std::size_t s = 0; s < labels.values.size(); ++s) {
    for (std::size_t i = 0; i < labels.values[s].size(); ++i) {
      double level = outside_level;
      switch (label_of(labels.values[s][i], laterality)) {
        case Label::none:
          break;
        case Label::anterior_chamber:
        case Label::vitreous:
          level = fluid_level;
          break;
        case Label::iris:
          level = iris_level;
          break;
        case Label::cornea:
        case Label::lens:
        case Label::wall:
          level = solid_level;
      }
      image.slice_intensity[s][i] = static_cast<float>(level);
    }
  }
  return image;
}

}  // namespace emmetrope::segmentation
