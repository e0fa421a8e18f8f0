#pragma once
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace emmetrope::raytrace {

/// What is left to read of an option's text, from its front.
class TextReader {
 public:
  explicit TextReader(std::string_view text) : rest_(text) {}

  bool done() const { return rest_.empty(); }
  bool take(char expected) {
    if (rest_.empty() || rest_.front() != expected) return false;
    rest_.remove_prefix(1);
    return true;
  }
  /// A finite number; nothing where none stands there.
  std::optional<double> number() {
    take('+');
    double value = 0;
    const auto [end, fault] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (fault != std::errc() || !std::isfinite(value)) return std::nullopt;
    rest_.remove_prefix(end - rest_.data());
    return value;
  }
  /// What stands before `end`, which is read too; nothing where it does not come.
  std::optional<std::string_view> until(char end) {
    const std::size_t length = rest_.find(end);
    if (length == std::string_view::npos) return std::nullopt;
    const std::string_view text = rest_.substr(0, length);
    rest_.remove_prefix(length + 1);
    return text;
  }

 private:
  std::string_view rest_;
};

}  // namespace emmetrope::raytrace
