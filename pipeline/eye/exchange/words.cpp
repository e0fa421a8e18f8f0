#include "pipeline/eye/exchange/words.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <sstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/typed_number.hpp"

namespace emmetrope {
namespace {

constexpr std::uintmax_t largest_bytes = 16'000'000;

std::string ascii_of_utf16(const std::string& bytes) {
  const bool little = bytes[0] == '\xff';
  std::string text;
  for (std::size_t k = 2; k + 1 < bytes.size(); k += 2) {
    const char low = bytes[little ? k : k + 1], high = bytes[little ? k + 1 : k];
    text += high == 0 ? low : '?';
  }
  return text;
}

std::string text_of(const std::filesystem::path& file) {
  std::error_code fault;
  if (!std::filesystem::is_regular_file(file, fault))
    throw input_error(file.string() + ": there is no such file");
  if (std::filesystem::file_size(file) > largest_bytes)
    throw input_error(file.string() + ": larger than 16 MB, no lens file");
  const std::string bytes = read_file(file);
  const bool wide = bytes.rfind("\xff\xfe", 0) == 0 || bytes.rfind("\xfe\xff", 0) == 0;
  return wide ? ascii_of_utf16(bytes) : bytes;
}

}  // namespace

const std::string& WordLine::word(std::size_t k) const {
  if (k >= words.size()) throw input_error(place + ": " + words[0] + " ends too early");
  return words[k];
}

double WordLine::number(std::size_t k) const {
  const std::optional<double> value = typed_number(word(k));
  if (!value)
    throw input_error(place + ": " + words[0] + ": expected a number, found \"" + word(k).substr(0, 40) +
                      "\"");
  return *value;
}

int WordLine::whole(std::size_t k) const {
  constexpr double most = 10000;
  const double value = number(k);
  if (!(value >= 0 && value <= most && value == std::floor(value)))
    throw input_error(place + ": " + words[0] + ": expected a whole number to 10000, found \"" +
                      word(k).substr(0, 40) + "\"");
  return static_cast<int>(value);
}

double WordLine::number(std::size_t k, double otherwise) const {
  return k < words.size() ? number(k) : otherwise;
}

std::vector<double> WordLine::numbers(std::size_t from) const {
  std::vector<double> values;
  for (std::size_t k = from; k < words.size(); ++k) values.push_back(number(k));
  return values;
}

std::string WordLine::rest() const {
  std::string all = text.substr(words[0].size());
  const auto junk = [](unsigned char c) { return std::isspace(c) != 0 || c == '"'; };
  all.erase(all.begin(), std::find_if_not(all.begin(), all.end(), junk));
  all.erase(std::find_if_not(all.rbegin(), all.rend(), junk).base(), all.end());
  return all;
}

std::vector<WordLine> word_lines(const std::filesystem::path& file) {
  std::istringstream stream(text_of(file));
  std::vector<WordLine> lines;
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    WordLine line;
    std::istringstream words(text);
    for (std::string word; words >> word;) line.words.push_back(word);
    if (line.words.empty()) continue;
    line.text = text.substr(text.find(line.words[0]));
    line.place = file.string() + ": line " + std::to_string(number);
    lines.push_back(std::move(line));
  }
  return lines;
}

std::string capitals(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace emmetrope
