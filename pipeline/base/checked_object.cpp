#include "pipeline/base/checked_object.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

bool is_finite_number(const Json& value) { return value.is_number() && std::isfinite(value.get<double>()); }

}  // namespace

CheckedObject::CheckedObject(const Json& object, std::string place)
    : object_(object), place_(std::move(place)) {
  if (!object_.is_object()) throw input_error(place_ + ": expected an object {...}, found " + object_.dump());
}

bool CheckedObject::has(const std::string& key) const { return object_.contains(key); }

const Json& CheckedObject::get(const std::string& key) {
  const auto found = object_.find(key);
  if (found == object_.end()) throw input_error(place_ + ": key \"" + key + "\" is missing");
  read_.insert(key);
  return *found;
}

double CheckedObject::number(const std::string& key) {
  const Json& value = get(key);
  if (!is_finite_number(value)) throw fault(key, "expected a number, found " + value.dump());
  return value.get<double>();
}

double CheckedObject::number(const std::string& key, double otherwise) {
  return has(key) ? number(key) : otherwise;
}

double CheckedObject::positive(const std::string& key) {
  const double value = number(key);
  if (!(value > 0)) throw fault(key, "must be greater than 0, found " + get(key).dump());
  return value;
}

double CheckedObject::within(const std::string& key, double low, double high) {
  const double value = number(key);
  if (value < low || value > high)
    throw fault(key, fmt::format("must lie between {:g} and {:g}, found {:g}", low, high, value));
  return value;
}

void CheckedObject::require_magnitude(const std::string& key, const Eigen::Vector2d& values, double low,
                                      double high) const {
  for (const double value : {values.x(), values.y()})
    if (std::abs(value) < low || std::abs(value) > high)
      throw fault(key, fmt::format("must have a magnitude from {:g} to {:g}, found {:g}", low, high, value));
}

std::string CheckedObject::text(const std::string& key) {
  const Json& value = get(key);
  if (!value.is_string() || value.get<std::string>().empty())
    throw fault(key, "expected a text, found " + value.dump());
  return value.get<std::string>();
}

std::string CheckedObject::text(const std::string& key, const std::string& otherwise) {
  return has(key) ? text(key) : otherwise;
}

std::vector<double> CheckedObject::numbers(const std::string& key, std::size_t count) {
  const Json& value = get(key);
  const std::string wanted = count > 0 ? std::to_string(count) + " numbers" : std::string("numbers");
  if (!value.is_array() || value.empty() || (count > 0 && value.size() != count))
    throw fault(key, "expected a list of " + wanted + ", found " + value.dump());
  std::vector<double> result;
  for (const Json& entry : value) {
    if (!is_finite_number(entry))
      throw fault(key, "expected a list of " + wanted + ", found " + value.dump());
    result.push_back(entry.get<double>());
  }
  return result;
}

Eigen::Vector2d CheckedObject::pair(const std::string& key, const Eigen::Vector2d& otherwise) {
  if (!has(key)) return otherwise;
  const std::vector<double> values = numbers(key, 2);
  return {values[0], values[1]};
}

Eigen::Vector2d CheckedObject::one_or_two(const std::string& key) {
  if (get(key).is_array()) return pair(key, {0, 0});
  const double value = number(key);
  return {value, value};
}

Error CheckedObject::fault(const std::string& key, const std::string& what) const {
  return input_error(place_ + ": key \"" + key + "\": " + what);
}

void CheckedObject::finish() const {
  for (const auto& [key, value] : object_.items())
    if (read_.count(key) == 0) throw input_error(place_ + ": unknown key \"" + key + "\"");
}

}  // namespace emmetrope
