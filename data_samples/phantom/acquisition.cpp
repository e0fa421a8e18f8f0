#include "data_samples/phantom/acquisition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Directions that a plan starts from: the eye's frame, or the scanner's as one looks along it.
struct Planes {
  Vector3d left, posterior, superior;
  Vector3d centre;
};

Planes planes_of(const PlacedEye& eye) {
  const Matrix3d& frame = eye.lps_from_eye.linear();
  return {frame.col(0), -frame.col(2), frame.col(1), eye.globe_centre_lps()};
}

Planes planes_of_head(const Anatomy& anatomy) {
  return {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ(), anatomy.between_globes()};
}

void orient(StackPlan& plan, const std::string& plane, const Planes& planes) {
  if (plane == "axial") {
    plan.along_row = planes.left;
    plan.along_column = planes.posterior;
  } else if (plane == "coronal") {
    plan.along_row = planes.left;
    plan.along_column = -planes.superior;
  } else if (plane == "sagittal") {
    plan.along_row = planes.posterior;
    plan.along_column = -planes.superior;
  } else {
    throw usage_error(fmt::format("unknown plane \"{}\"", plane), "use axial, coronal or sagittal");
  }
}

void tilt(StackPlan& plan, double about_row_deg, double about_column_deg) {
  const Matrix3d turn = (AngleAxisd(about_column_deg * degree, plan.along_column) *
                         AngleAxisd(about_row_deg * degree, plan.along_row))
                            .toRotationMatrix();
  plan.along_row = turn * plan.along_row;
  plan.along_column = turn * plan.along_column;
}

/// The nominal echo and repetition times of the tissue table.
void set_contrast(StackPlan& plan, Contrast contrast) {
  plan.contrast = contrast;
  plan.repetition_time_ms = contrast == Contrast::T2 ? 3500 : 550;
  plan.echo_time_ms = contrast == Contrast::T2 ? 90 : 12;
}

StackPlan plan_at(const std::string& at, const std::string& plane, const Anatomy& anatomy) {
  StackPlan plan;
  set_contrast(plan, Contrast::T2);
  plan.name = at + " " + plane;
  if (at == "head") {
    const Planes planes = planes_of_head(anatomy);
    orient(plan, plane, planes);
    plan.centre = planes.centre;
    plan.coil = Coil::head;
    return plan;
  }
  if (at != "od" && at != "os")
    throw usage_error(fmt::format("a stack is placed at od, os or head, not at \"{}\"", at));
  plan.coil_eye = at == "od" ? Laterality::od : Laterality::os;
  plan.coil = Coil::surface;
  const Planes planes = planes_of(anatomy.eye(plan.coil_eye));
  orient(plan, plane, planes);
  plan.centre = planes.centre;
  return plan;
}

std::vector<double> numbers(const std::string& value, char separator, std::size_t count,
                            const std::string& key) {
  std::vector<double> list;
  const char* at = value.data();
  const char* const end = at + value.size();
  while (true) {
    double number = 0;
    const auto [next, fault] = std::from_chars(at, end, number);
    if (fault != std::errc{} || !std::isfinite(number)) break;
    list.push_back(number);
    at = next;
    if (at == end || *at != separator) break;
    ++at;
  }
  if (list.size() != count || at != end)
    throw usage_error(fmt::format("stack key \"{}\": \"{}\" found", key, value),
                      count == 1 ? "write one number" : fmt::format("write two numbers as A{}B", separator));
  return list;
}

template <class Value>
Value choice(const std::string& value, const std::vector<std::pair<const char*, Value>>& known,
             const std::string& key) {
  std::string list;
  for (const auto& [name, meaning] : known) {
    if (value == name) return meaning;
    list += fmt::format(" {}", name);
  }
  throw usage_error(fmt::format("stack key \"{}\": \"{}\" found", key, value), "use one of" + list);
}

void set_key(StackPlan& plan, const std::string& key, const std::string& value) {
  const auto positive = [&](double low, double high) {
    const double number = numbers(value, '/', 1, key)[0];
    if (!(number >= low && number <= high))
      throw usage_error(fmt::format("stack key \"{}\" is {}", key, value),
                        fmt::format("choose between {} and {}", low, high));
    return number;
  };
  if (key == "pixel_mm") {
    plan.pixel_mm = positive(0.1, 5);
  } else if (key == "slice_mm") {
    const double gap = plan.slice_spacing_mm - plan.slice_thickness_mm;
    plan.slice_thickness_mm = positive(0.1, 10);
    plan.slice_spacing_mm = plan.slice_thickness_mm + gap;
  } else if (key == "gap_mm") {
    plan.slice_spacing_mm = plan.slice_thickness_mm + numbers(value, '/', 1, key)[0];
    if (plan.slice_spacing_mm <= 0.05)
      throw usage_error("stack key \"gap_mm\": slices would lie on each other");
  } else if (key == "slices") {
    plan.slices = static_cast<int>(positive(1, 1000));
  } else if (key == "matrix") {
    const auto size = numbers(value, 'x', 2, key);
    if (size[0] < 8 || size[1] < 8 || size[0] > 1024 || size[1] > 1024)
      throw usage_error(fmt::format("stack key \"matrix\" is {}", value), "choose between 8 and 1024");
    plan.columns = static_cast<int>(size[0]);
    plan.rows = static_cast<int>(size[1]);
  } else if (key == "tilt_deg") {
    const auto angles = numbers(value, '/', 2, key);
    tilt(plan, angles[0], angles[1]);
  } else if (key == "contrast") {
    set_contrast(plan, choice<Contrast>(value, {{"t1", Contrast::T1}, {"t2", Contrast::T2}}, key));
  } else if (key == "profile") {
    plan.profile = choice<SliceProfile>(value,
                                        {{"box", SliceProfile::box},
                                         {"trapezoid", SliceProfile::trapezoid},
                                         {"gaussian", SliceProfile::gaussian},
                                         {"encoded", SliceProfile::encoded}},
                                        key);
  } else if (key == "coil") {
    plan.coil = choice<Coil>(
        value, {{"uniform", Coil::uniform}, {"surface", Coil::surface}, {"head", Coil::head}}, key);
  } else if (key == "fat_left") {
    plan.fat_left = positive(0, 1);
  } else if (key == "acquired") {
    const auto fraction = numbers(value, 'x', 2, key);
    for (const double f : fraction)
      if (!(f >= 0.2 && f <= 1))
        throw usage_error(fmt::format("stack key \"acquired\" is {}", value),
                          "choose fractions between 0.2 and 1");
    plan.acquired_readout = fraction[0];
    plan.acquired_phase = fraction[1];
  } else {
    throw usage_error(
        fmt::format("unknown stack key \"{}\"", key),
        "use pixel_mm, slice_mm, gap_mm, slices, matrix, tilt_deg, contrast, profile, coil, fat_left, "
        "acquired");
  }
}

}  // namespace

StackPlan make_stack(const std::string& words, const Anatomy& anatomy) {
  const std::size_t colon = std::min(words.find(':'), words.size());
  const std::string place = words.substr(0, colon);
  const std::size_t dash = place.find('-');
  if (dash == std::string::npos)
    throw usage_error(fmt::format("stack \"{}\" names no place and plane", words),
                      "write od-coronal or head-axial:...");
  StackPlan plan = plan_at(place.substr(0, dash), place.substr(dash + 1), anatomy);
  for (std::size_t begin = colon + 1; begin < words.size();) {
    const std::size_t end = std::min(words.find(',', begin), words.size());
    const std::string item = words.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t equals = std::min(item.find('='), item.size());
    set_key(plan, item.substr(0, equals), item.substr(std::min(equals + 1, item.size())));
  }
  if (plan.profile == SliceProfile::encoded && plan.slice_spacing_mm != plan.slice_thickness_mm)
    throw usage_error(fmt::format("stack \"{}\": encoded slices have no gaps", words), "leave gap_mm out");
  plan.name += std::string(" ") + to_string(plan.contrast);
  return plan;
}

bool all_encoded(const Protocol& protocol) {
  return std::all_of(protocol.stacks.begin(), protocol.stacks.end(),
                     [](const StackPlan& plan) { return plan.profile == SliceProfile::encoded; });
}

Protocol make_protocol(const std::string& name, const Anatomy& anatomy) {
  Protocol protocol;
  protocol.name = name;
  if (name == "surface-coil") {
    for (const Laterality laterality : both_eyes) {
      const std::string eye = to_string(laterality);
      const double side = laterality == Laterality::od ? 1 : -1;
      protocol.stacks.push_back(make_stack(fmt::format("{}-coronal:tilt_deg=3/{}", eye, -2 * side), anatomy));
      protocol.stacks.push_back(make_stack(fmt::format("{}-sagittal:tilt_deg=2/{}", eye, 3 * side), anatomy));
    }
    // Planned on a coarse localiser: not quite on the globe's centre.
    for (StackPlan& plan : protocol.stacks) plan.centre += Vector3d(0.4, -0.9, 0.6);
    protocol.disturbances.snr = 20;
  } else if (name == "head-t2") {
    StackPlan plan =
        make_stack("head-axial:pixel_mm=0.6,slice_mm=0.6,matrix=224x160,slices=64,tilt_deg=-6/0", anatomy);
    plan.centre += Vector3d(0, 12, 0);
    plan.profile = SliceProfile::encoded;
    plan.repetition_time_ms = 3200;
    plan.echo_time_ms = 120;
    protocol.stacks.push_back(plan);
    protocol.disturbances.snr = 18;
  } else if (name == "head-t1") {
    StackPlan plan = make_stack(
        "head-sagittal:pixel_mm=1,slice_mm=1,matrix=256x256,slices=176,contrast=t1,tilt_deg=2/1", anatomy);
    plan.centre += Vector3d(0, 72, 18);
    plan.profile = SliceProfile::encoded;
    plan.repetition_time_ms = 2300;
    plan.echo_time_ms = 3;
    plan.flip_angle_deg = 9;
    protocol.stacks.push_back(plan);
    protocol.disturbances.snr = 25;
  } else {
    throw usage_error(fmt::format("unknown protocol \"{}\"", name), "use surface-coil, head-t2 or head-t1");
  }
  return protocol;
}

}  // namespace emmetrope::phantom
