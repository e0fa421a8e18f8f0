#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/series_checks.hpp"
#include "segmentation/intake/series_warnings.hpp"
#include "segmentation/intake/slice_grid.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// Images nearer than this along the normal show the same place.
constexpr double same_place_mm = 0.01;
/// Angle between the normal and the line through the slices' first voxels.
constexpr double largest_shear_deg = 0.1;

/// What may tell images of one place apart, the most telling first.
constexpr Tag distinguishing_tags[] = {tag::image_type,
                                       tag::frame_type,
                                       tag::complex_image_component,
                                       tag::echo_time,
                                       tag::effective_echo_time,
                                       tag::echo_numbers,
                                       tag::temporal_position_identifier,
                                       tag::temporal_position_index,
                                       tag::diffusion_b_value,
                                       tag::inversion_time,
                                       tag::inversion_times,
                                       tag::flip_angle,
                                       tag::acquisition_number,
                                       tag::stack_id,
                                       tag::trigger_time};

/// Index ranges [first, last) of images at one place.
std::vector<std::pair<std::size_t, std::size_t>> shared_places(const std::vector<double>& along_normal) {
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (std::size_t first = 0, next = 1; first < along_normal.size(); first = next, next = first + 1) {
    while (next < along_normal.size() && along_normal[next] - along_normal[first] < same_place_mm) ++next;
    if (next - first > 1) places.emplace_back(first, next);
  }
  return places;
}

[[noreturn]] void refuse_shared_places(const std::vector<SeriesImage>& images,
                                       const std::vector<std::pair<std::size_t, std::size_t>>& places,
                                       const std::string& uid) {
  std::vector<std::string> differences;
  std::string choice;
  for (const auto& tag : distinguishing_tags) {
    std::set<std::string> values;
    bool tells_apart = true;
    for (const auto& [first, last] : places) {
      std::set<std::string> here;
      for (std::size_t i = first; i < last; ++i) here.insert(images[i].value(tag));
      tells_apart = tells_apart && here.size() > 1;
      values.insert(here.begin(), here.end());
    }
    if (!tells_apart || values.size() > 20) continue;
    std::vector<std::string> shown;
    for (const auto& value : values) shown.push_back(in_quotes(value));
    differences.push_back(fmt::format("{} ({})", to_string(tag), fmt::join(shown, ", ")));
    if (choice.empty()) choice = fmt::format("{},{}={}", uid, tag.keyword, *values.begin());
    if (differences.size() == 3) break;
  }
  const auto& [first, last] = places.front();
  throw input_error(fmt::format(
      "{} and {}: the same {} {:.3f}\\{:.3f}\\{:.3f}, {} such places in the series; {}", images[first].name(),
      images[first + 1].name(), to_string(tag::image_position), images[first].position_mm.x(),
      images[first].position_mm.y(), images[first].position_mm.z(), places.size(),
      differences.empty() ? std::string("no tag tells the images apart")
                          : fmt::format("the images differ in {}; choose with --series '{}'",
                                        fmt::join(differences, ", "), choice)));
}

/// The straight line that fits the positions best, as a function of the position along the normal.
struct PositionLine {
  Eigen::Vector3d drift_per_mm = Eigen::Vector3d::Zero();
  double largest_residual_mm = 0;
};

PositionLine fit_line(const std::vector<SeriesImage>& images, const std::vector<double>& along_normal) {
  const auto count = static_cast<double>(images.size());
  double mean_s = 0;
  Eigen::Vector3d mean_p = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < images.size(); ++i) {
    mean_s += along_normal[i] / count;
    mean_p += images[i].position_mm / count;
  }
  double ss = 0;
  Eigen::Vector3d sp = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < images.size(); ++i) {
    ss += (along_normal[i] - mean_s) * (along_normal[i] - mean_s);
    sp += (along_normal[i] - mean_s) * (images[i].position_mm - mean_p);
  }
  PositionLine line{sp / ss, 0};
  for (std::size_t i = 0; i < images.size(); ++i)
    line.largest_residual_mm =
        std::max(line.largest_residual_mm,
                 (images[i].position_mm - mean_p - line.drift_per_mm * (along_normal[i] - mean_s)).norm());
  return line;
}

/// A slice that alone is off the grid of all others.
struct StraySlice {
  std::size_t index;
  double off_mm;
  SliceGrid grid;  ///< of the others; the stray one on the nearest plane that is free
};

/// A finer grid, on which it lies and others are missing, explains no more.
std::optional<StraySlice> find_stray_slice(const std::vector<double>& along_normal, const SliceGrid& grid) {
  constexpr std::size_t fewest = 5;  // of fewer any may be the stray one
  const double usual_mm = median_step_mm(along_normal);
  const bool is_regular = grid.deviation_mm <= on_grid_mm && grid.spacing_mm > usual_mm - on_grid_mm;
  if (is_regular || along_normal.size() < fewest) return {};
  for (std::size_t i = 0; i < along_normal.size(); ++i) {
    std::vector<double> others = along_normal;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    SliceGrid regular = slice_grid_of_step(others, usual_mm);
    if (regular.deviation_mm > on_grid_mm) continue;
    const double plane = (along_normal[i] - regular.start_mm) / regular.spacing_mm;
    const std::vector<int>& planes = regular.plane;
    const int first_free = i == 0 ? -1 : planes[i - 1] + 1,
              last_free = i == 0 || i == planes.size() ? first_free : std::max(first_free, planes[i] - 1);
    regular.plane.insert(regular.plane.begin() + static_cast<std::ptrdiff_t>(i),
                         std::clamp(static_cast<int>(std::lround(plane)), first_free, last_free));
    return StraySlice{i, std::abs(plane - std::round(plane)) * regular.spacing_mm, regular};
  }
  return {};
}

void warn_of_gaps(const std::vector<SeriesImage>& images, const std::vector<double>& along_normal,
                  const SliceGrid& grid, SeriesInfo& info) {
  constexpr int told_singly = 4;
  int gaps = 0, missing_more = 0;
  for (std::size_t i = 1; i < images.size(); ++i) {
    const int missing = grid.plane[i] - grid.plane[i - 1] - 1;
    if (missing <= 0) continue;
    if (++gaps > told_singly) {
      missing_more += missing;
      continue;
    }
    info.warnings.push_back(fmt::format(
        "{} {} missing between {} and {}: {} are {:.3f} mm apart where {:.3f} mm is usual; nothing is "
        "filled in",
        missing, missing == 1 ? "slice is" : "slices are", images[i - 1].name(), images[i].name(),
        to_string(tag::image_position), along_normal[i] - along_normal[i - 1], grid.spacing_mm));
  }
  if (gaps > told_singly)
    info.warnings.push_back(fmt::format("missing slices in other gaps: {}", missing_more));
}

void compare_stated_spacing(const SeriesImage& image, SeriesInfo& info) {
  const auto stated = parse_number(image.value(tag::spacing_between_slices));
  if (!stated || !info.slice_spacing_mm) return;
  if (std::abs(std::abs(*stated) - *info.slice_spacing_mm) > 0.01 * *info.slice_spacing_mm)
    info.warnings.push_back(
        fmt::format("{} says {:g} mm, but the positions {} are {:.4g} mm apart; the positions are used",
                    to_string(tag::spacing_between_slices), *stated, to_string(tag::image_position),
                    *info.slice_spacing_mm));
}

/// Sign and origin of SliceLocation are each vendor's, but along the normal it only rises or only falls, unless slices
/// were exchanged. InstanceNumber is not compared: it may follow the order of acquisition, odd slices before even ones.
void compare_slice_locations(const std::vector<SeriesImage>& images, const std::vector<double>& along_normal,
                             SeriesInfo& info) {
  struct Told {
    std::size_t index;  ///< of the image, in the order of positions
    double location_mm;
  };
  std::vector<Told> told;
  for (std::size_t i = 0; i < images.size(); ++i)
    if (const auto location = parse_number(images[i].value(tag::slice_location)))
      told.push_back({i, *location});
  std::size_t rises = 0, falls = 0;
  for (std::size_t i = 1; i < told.size(); ++i) {
    const double step = told[i].location_mm - told[i - 1].location_mm;
    if (step > same_place_mm) ++rises;
    if (step < -same_place_mm) ++falls;
  }
  if (rises == 0 || falls == 0) return;
  const double sign = rises < falls ? -1 : 1;
  std::vector<Told> by_location = told;
  std::stable_sort(by_location.begin(), by_location.end(), [sign](const Told& a, const Told& b) {
    return sign * a.location_mm < sign * b.location_mm;
  });
  const auto [here, there] = std::mismatch(told.begin(), told.end(), by_location.begin(),
                                           [](const Told& a, const Told& b) { return a.index == b.index; });
  info.warnings.push_back(fmt::format(
      "{} and {}: {} is {:g} and {:g} mm, but by {} they lie at {:.6g} and {:.6g} mm along the normal, in another "
      "order: slices may have been exchanged; the positions are used",
      images[here->index].name(), images[there->index].name(), to_string(tag::slice_location),
      here->location_mm, there->location_mm, to_string(tag::image_position), along_normal[here->index],
      along_normal[there->index]));
}

}  // namespace

std::string too_few_slices(int slices) {
  constexpr const char* why = "it shows no eye in three dimensions";
  return slices == 1   ? fmt::format("one slice only: {}", why)
         : slices == 2 ? fmt::format("two slices only: {}", why)
                       : "";
}

void judge_positions(std::vector<SeriesImage> images, SeriesInfo& info) {
  const Eigen::Vector3d along_row(info.orientation.data()), along_column(info.orientation.data() + 3);
  const Eigen::Vector3d normal = along_row.cross(along_column);
  std::stable_sort(images.begin(), images.end(), [&](const SeriesImage& a, const SeriesImage& b) {
    return normal.dot(a.position_mm) < normal.dot(b.position_mm);
  });
  std::vector<double> along_normal;
  for (const auto& image : images) {
    info.slices.push_back({image.source->file, image.frame, image.position_mm, image.slope, image.intercept});
    along_normal.push_back(normal.dot(image.position_mm));
  }
  if (std::string few = too_few_slices(static_cast<int>(images.size())); !few.empty())
    info.warnings.push_back(std::move(few));
  if (images.size() == 1) return;
  if (const auto places = shared_places(along_normal); !places.empty())
    refuse_shared_places(images, places, info.uid);

  info.slice_spacing_mm = median_step_mm(along_normal);
  if (!is_plausible_spacing(*info.slice_spacing_mm))
    throw input_error(fmt::format("{} to {}: by {} the slices are {:g} mm apart; {:g} to {:g} mm are read",
                                  images.front().name(), images.back().name(), to_string(tag::image_position),
                                  *info.slice_spacing_mm, least_spacing_mm, largest_spacing_mm));

  const PositionLine line = fit_line(images, along_normal);
  const double shear_deg =
      std::atan((line.drift_per_mm - normal * normal.dot(line.drift_per_mm)).norm()) / degree;
  if (shear_deg > largest_shear_deg)
    throw input_error(
        fmt::format("{} to {}: {} runs {:.2f} degrees off the normal of {} (sheared stack, gantry tilt); at "
                    "most {} is read",
                    images.front().name(), images.back().name(), to_string(tag::image_position), shear_deg,
                    to_string(tag::image_orientation), largest_shear_deg));

  const SliceGrid grid = fit_slice_grid(along_normal);
  info.uniform =
      !grid.has_gaps() && grid.deviation_mm <= on_grid_mm && line.largest_residual_mm <= on_grid_mm;
  const auto stray = find_stray_slice(along_normal, grid);
  warn_of_gaps(images, along_normal, stray ? stray->grid : grid, info);
  if (stray)
    info.warnings.push_back(fmt::format(
        "uneven spacing: {}: {} is {:.3f} mm off the grid of {:.3f} mm on which all other slices lie; "
        "every slice keeps its own position",
        images[stray->index].name(), to_string(tag::image_position), stray->off_mm, stray->grid.spacing_mm));
  else if (grid.deviation_mm > on_grid_mm)
    info.warnings.push_back(fmt::format(
        "uneven spacing: {} is up to {:.3f} mm off a grid of {:.3f} mm; every slice keeps its own position",
        to_string(tag::image_position), grid.deviation_mm, grid.spacing_mm));
  else if (line.largest_residual_mm > on_grid_mm)
    info.warnings.push_back(
        fmt::format("{} is up to {:.3f} mm off one line along the normal; every slice keeps its own position",
                    to_string(tag::image_position), line.largest_residual_mm));
  compare_stated_spacing(images.front(), info);
  compare_slice_locations(images, along_normal, info);
  warn_of_sparse_slices(info);
  warn_of_slices(images, info);
}

}  // namespace emmetrope::segmentation
