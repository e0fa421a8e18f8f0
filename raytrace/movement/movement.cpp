#include "raytrace/movement/movement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <sstream>

#include "pipeline/base/csv_cells.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/typed_number.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "raytrace/movement/models.hpp"

namespace emmetrope::raytrace {
namespace {

struct Column {
  const char* name;
  void (*set)(EyeMoment& moment, double value);
};
constexpr std::array<Column, 6> columns{
    {{"time_s", [](EyeMoment& moment, double value) { moment.time_s = value; }},
     {"horizontal_deg", [](EyeMoment& moment, double value) { moment.gaze.horizontal_deg = value; }},
     {"vertical_deg", [](EyeMoment& moment, double value) { moment.gaze.vertical_deg = value; }},
     {"vergence_deg", [](EyeMoment& moment, double value) { moment.vergence_deg = value; }},
     {"accommodation_D", [](EyeMoment& moment, double value) { moment.accommodation_D = value; }},
     {"pupil_mm", [](EyeMoment& moment, double value) { moment.pupil_mm = value; }}}};

std::string column_names() {
  std::string names;
  for (const Column& column : columns) names += (names.empty() ? "" : ", ") + std::string(column.name);
  return names;
}

std::vector<const Column*> columns_of(const std::vector<std::string>& head, const std::string& file) {
  std::vector<const Column*> found;
  for (const std::string& name : head) {
    const auto* column =
        std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.name == name; });
    if (column == columns.end())
      throw input_error(fmt::format("{}: column \"{}\" is unknown", file, name),
                        "known are " + column_names());
    if (std::find(found.begin(), found.end(), column) != found.end())
      throw input_error(fmt::format("{}: column \"{}\" stands there twice", file, name));
    found.push_back(column);
  }
  if (std::find(found.begin(), found.end(), &columns[0]) == found.end())
    throw input_error(file + ": the first line names no column time_s", "known are " + column_names());
  return found;
}

EyeMoment moment_of(const std::vector<std::string>& cells, const std::vector<const Column*>& named,
                    const std::string& where) {
  if (cells.size() != named.size())
    throw input_error(fmt::format("{}: {} cells, the first line names {}", where, cells.size(), named.size()),
                      "separate cells by commas, decimals by points; leave no cell empty");
  EyeMoment moment;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const std::optional<double> value = typed_number(cells[k]);
    if (!value) throw input_error(fmt::format("{}: {} \"{}\" is no number", where, named[k]->name, cells[k]));
    named[k]->set(moment, *value);
  }
  return moment;
}

constexpr double longest_model_s = 600;
/// Refractors repeat to about this: a relaxed eye is recorded as that much less than relaxed. Beyond, it is another
/// sign or another zero.
constexpr double noise_of_accommodation_D = 0.5;

double between(double from, double to, double share) { return from + share * (to - from); }

void check(const EyeMoment& moment, const std::string& name) {
  const auto refuse = [&](const char* what, double value, const std::string& wanted) {
    throw input_error(
        fmt::format("movement {}: {} {:g} at {:g} s is out of range", name, what, value, moment.time_s),
        "give " + wanted);
  };
  for (const Laterality eye : both_eyes) {
    const Gaze gaze = moment.gaze_of(eye);
    if (!(std::abs(gaze.horizontal_deg) <= 60)) refuse("horizontal_deg", gaze.horizontal_deg, "-60 to 60");
    if (!(std::abs(gaze.vertical_deg) <= 60)) refuse("vertical_deg", gaze.vertical_deg, "-60 to 60");
  }
  if (!(moment.accommodation_D >= -noise_of_accommodation_D))
    refuse("accommodation_D", moment.accommodation_D,
           fmt::format("0 or more from the relaxed eye; down to {:g} is taken for 0",
                       -noise_of_accommodation_D));
  if (moment.pupil_mm && !iris_aperture_mm.contains(*moment.pupil_mm))
    refuse("pupil_mm", *moment.pupil_mm,
           fmt::format("{:g} to {:g}", iris_aperture_mm.low, iris_aperture_mm.high));
}

/// \param text  ":key=value,..." or nothing
ModelParameters parameters_of(const MovementModel& model, const std::string& text) {
  std::string remedy = "its keys and defaults are";
  for (const auto& [key, usual] : model.defaults) remedy += fmt::format(" {}={:g}", key, usual);
  ModelParameters parameters = model.defaults;
  if (text == ":" || (!text.empty() && text.back() == ','))
    throw usage_error("--movement " + model.name + text + ": a key and a number are missing at the end",
                      remedy);
  std::set<std::string> given;
  std::istringstream rest(text.empty() ? text : text.substr(1));
  for (std::string pair; std::getline(rest, pair, ',');) {
    const auto equals = std::min(pair.find('='), pair.size());
    const auto parameter = parameters.find(pair.substr(0, equals));
    const auto value = typed_number(pair.substr(std::min(equals + 1, pair.size())));
    if (parameter == parameters.end() || !value)
      throw usage_error("--movement " + model.name + ": \"" + pair + "\" is no key and number of it", remedy);
    if (!given.insert(parameter->first).second)
      throw usage_error("--movement " + model.name + ": " + parameter->first + " is given twice",
                        "give it once");
    parameter->second = *value;
  }
  for (const auto& [key, value] : parameters) {
    const bool positive = key == "duration_s" || key == "amplitude_deg" || key == "rate_hz";
    if (key != "direction_deg" && !(positive ? value > 0 : value >= 0))
      throw usage_error(fmt::format("--movement {}: {}={:g} is out of range", model.name, key, value),
                        remedy);
  }
  if (!(parameters.at("duration_s") >= 0.001 && parameters.at("duration_s") <= longest_model_s))
    throw usage_error(
        fmt::format("--movement {}: duration_s from 0.001 to {:g} is wanted", model.name, longest_model_s));
  for (const char* begin : {"start_s", "latency_s"}) {
    const auto at = parameters.find(begin);
    if (at != parameters.end() && at->second >= parameters.at("duration_s"))
      throw usage_error(fmt::format("--movement {}: {}={:g} is not before its end, duration_s={:g}",
                                    model.name, begin, at->second, parameters.at("duration_s")));
  }
  const auto rate = parameters.find("rate_hz");
  if (rate != parameters.end() && rate->second * least_microsaccade_interval_s >= 1)
    throw usage_error(fmt::format("--movement {}: rate_hz={:g}: they follow one another by {:g} s at least",
                                  model.name, rate->second, least_microsaccade_interval_s));
  return parameters;
}

}  // namespace

Gaze EyeMoment::gaze_of(Laterality eye) const {
  // +x is the patient's left: the right eye turns there to converge.
  const double inward = eye == Laterality::od ? 0.5 : -0.5;
  return {gaze.horizontal_deg + inward * vergence_deg, gaze.vertical_deg};
}

Movement::Movement(std::string name, std::vector<EyeMoment> moments)
    : name_(std::move(name)), moments_(std::move(moments)) {
  if (moments_.size() < 2) throw input_error("movement " + name_ + ": at least two moments are needed");
  for (std::size_t k = 0; k < moments_.size(); ++k) {
    check(moments_[k], name_);
    if (k > 0 && !(moments_[k].time_s > moments_[k - 1].time_s))
      throw input_error(fmt::format("movement {}: time does not rise at {:g} s", name_, moments_[k].time_s));
    least_accommodation_D_ = std::min(least_accommodation_D_, moments_[k].accommodation_D);
    moments_[k].accommodation_D = std::max(0.0, moments_[k].accommodation_D);
  }
}

EyeMoment Movement::at(double time_s) const {
  if (time_s <= first_s()) return moments_.front();
  if (time_s >= last_s()) return moments_.back();
  const auto after =
      std::upper_bound(moments_.begin(), moments_.end(), time_s,
                       [](double time, const EyeMoment& moment) { return time < moment.time_s; });
  const EyeMoment &a = *(after - 1), &b = *after;
  const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
  EyeMoment moment;
  moment.time_s = time_s;
  moment.gaze = {between(a.gaze.horizontal_deg, b.gaze.horizontal_deg, share),
                 between(a.gaze.vertical_deg, b.gaze.vertical_deg, share)};
  moment.vergence_deg = between(a.vergence_deg, b.vergence_deg, share);
  moment.accommodation_D = between(a.accommodation_D, b.accommodation_D, share);
  if (a.pupil_mm && b.pupil_mm) moment.pupil_mm = between(*a.pupil_mm, *b.pupil_mm, share);
  return moment;
}

bool Movement::accommodates() const {
  return std::any_of(moments_.begin(), moments_.end(),
                     [](const EyeMoment& moment) { return moment.accommodation_D != 0; });
}

Movement read_movement(const std::filesystem::path& file) {
  constexpr std::size_t most_rows = 1'000'000;
  std::istringstream text(read_file(file));
  std::string line;
  std::getline(text, line);
  const auto named = columns_of(csv_cells(without_byte_order_mark(line)), file.string());
  std::vector<EyeMoment> moments;
  for (int number = 2; std::getline(text, line); ++number) {
    if (line.find_first_not_of(" \r\t") == std::string::npos) continue;
    if (moments.size() == most_rows) throw input_error(file.string() + ": more than a million rows");
    moments.push_back(moment_of(csv_cells(line), named, fmt::format("{} line {}", file.string(), number)));
  }
  return {file.filename().string(), std::move(moments)};
}

Movement make_movement(const std::string& text, std::uint64_t seed) {
  const std::string ending = std::filesystem::path(text).extension().string();
  if (ending == ".csv" || ending == ".CSV") return read_movement(text);
  const std::string name = text.substr(0, text.find(':'));
  std::string known;
  for (const MovementModel& model : movement_models()) {
    if (model.name == name) return {text, model.make(parameters_of(model, text.substr(name.size())), seed)};
    known += (known.empty() ? "" : ", ") + model.name;
  }
  throw usage_error("--movement: \"" + name + "\" is neither a .csv file nor a model", "models are " + known);
}

}  // namespace emmetrope::raytrace
