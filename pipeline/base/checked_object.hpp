#pragma once
#include <Eigen/Core>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope {

/// A JSON object whose every key must be asked for: reads values with checks and, in the end, refuses keys
/// that nobody read. Errors name the place ("surfaces[2] (lens_anterior)") and the key.
/// \throw Error (input_invalid) from every member
class CheckedObject {
 public:
  CheckedObject(const Json& object, std::string place);

  bool has(const std::string& key) const;
  /// The value itself, marked as read; an error where it is missing.
  const Json& get(const std::string& key);

  double number(const std::string& key);
  double number(const std::string& key, double otherwise);
  double positive(const std::string& key);
  /// From low to high, both included.
  double within(const std::string& key, double low, double high);
  std::string text(const std::string& key);
  std::string text(const std::string& key, const std::string& otherwise);
  /// A list of numbers, its length checked where `count` > 0.
  std::vector<double> numbers(const std::string& key, std::size_t count = 0);
  Eigen::Vector2d pair(const std::string& key, const Eigen::Vector2d& otherwise);
  /// One number for both meridians, or a list of two.
  Eigen::Vector2d one_or_two(const std::string& key);
  /// \throw Error where the key's value, or one of its values, has a magnitude outside low to high
  void require_magnitude(const std::string& key, const Eigen::Vector2d& values, double low,
                         double high) const;

  /// The place and key with what is wrong, to be thrown.
  Error fault(const std::string& key, const std::string& what) const;
  const std::string& place() const { return place_; }
  /// \throw Error naming the first key that was not read
  void finish() const;

 private:
  const Json& object_;
  std::string place_;
  std::set<std::string> read_;
};

}  // namespace emmetrope
