#include "tests/fuzz/mutations.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

namespace emmetrope::fuzz {
namespace {

using Json = nlohmann::json;

std::size_t below(std::size_t count, Random& random) {
  return count == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, count - 1)(random);
}

template <typename Container>
const auto& any_of(const Container& container, Random& random) {
  return container[below(std::size(container), random)];
}

constexpr std::array extreme_numbers{"0",          "-0",
                                     "-1",         "1",
                                     "1e308",      "-1e308",
                                     "1e-308",     "1e999",
                                     "nan",        "inf",
                                     "65535",      "65536",
                                     "2147483647", "-2147483648",
                                     "4294967296", "9223372036854775807",
                                     "0.1",        "1e6",
                                     "1e-6",       "0x10",
                                     "1,5",        "",
                                     "1e",         "--1"};

Json extreme_value(Random& random) {
  switch (below(12, random)) {
    case 0:
      return nullptr;
    case 1:
      return true;
    case 2:
      return "";
    case 3:
      return std::string(100'000, 'x');
    case 4:
      return Json::array();
    case 5:
      return Json::object();
    case 6:
      return -1;
    case 7:
      return 1e308;
    case 8:
      return 0;
    case 9:
      return std::int64_t{9223372036854775807};
    case 10:
      return "\xff\xfe../../etc/passwd";
    default: {
      Json nested = 1;
      for (int depth = 0; depth < 500; ++depth) nested = Json::array({nested});
      return nested;
    }
  }
}

void change(Json& value, Random& random) {
  if (value.is_number() && below(2, random) == 0) {
    constexpr std::array factors{-1.0, 0.0, 1e6, 1e-6, 1.01, 0.5, 1e300};
    value = value.get<double>() * any_of(factors, random);
  } else if (value.is_array() && !value.empty() && below(2, random) == 0) {
    if (below(2, random) == 0)
      value.erase(below(value.size(), random));
    else
      value.push_back(Json(value[below(value.size(), random)]));
  } else {
    value = extreme_value(random);
  }
}

/// The start of an element and of its value, and where both end.
struct Element {
  std::size_t begin, value, end;
};

/// Of the data set's first level; until what cannot be followed.
std::vector<Element> elements_of(const std::string& bytes) {
  std::vector<Element> elements;
  constexpr std::size_t preamble = 132;
  static const std::vector<std::string> long_forms{"OB", "OW", "OF", "OD", "OL",
                                                   "SQ", "UC", "UN", "UR", "UT"};
  for (std::size_t at = preamble; at + 8 <= bytes.size();) {
    const bool is_long =
        std::find(long_forms.begin(), long_forms.end(), bytes.substr(at + 4, 2)) != long_forms.end();
    std::size_t value = at + 8;
    std::uint32_t length = 0;
    if (is_long) {
      if (at + 12 > bytes.size()) break;
      std::memcpy(&length, bytes.data() + at + 8, 4);
      value = at + 12;
    } else {
      std::uint16_t short_length = 0;
      std::memcpy(&short_length, bytes.data() + at + 6, 2);
      length = short_length;
    }
    if (length > bytes.size() - value) break;
    elements.push_back({at, value, value + length});
    at = value + length;
  }
  return elements;
}

}  // namespace

std::string mutate_bytes(std::string bytes, Random& random) {
  const std::size_t changes = 1 + below(4, random);
  for (std::size_t k = 0; k < changes; ++k) {
    if (bytes.empty()) return std::string(1 + below(64, random), static_cast<char>(below(256, random)));
    const std::size_t at = below(bytes.size(), random),
                      length = 1 + below(std::min<std::size_t>(64, bytes.size() - at), random);
    switch (below(8, random)) {
      case 0:
        bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << below(8, random)));
        break;
      case 1:
        bytes[at] = static_cast<char>(below(256, random));
        break;
      case 2:
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length,
                    below(2, random) == 0 ? '\0' : '\xff');
        break;
      case 3:
        bytes.erase(at, length);
        break;
      case 4:
        bytes.insert(at, bytes.substr(below(bytes.size(), random), length));
        break;
      case 5:
        bytes.resize(at);
        break;
      case 6:
        bytes.insert(at, length, static_cast<char>(below(256, random)));
        break;
      default: {
        const std::array<std::uint32_t, 6> words{0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0xfffffffe};
        const std::uint32_t word = any_of(words, random);
        std::memcpy(bytes.data() + at, &word, std::min<std::size_t>(4, bytes.size() - at));
      }
    }
  }
  return bytes;
}

std::string mutate_text(std::string text, Random& random) {
  if (text.empty() || below(4, random) == 0) return mutate_bytes(text, random);
  const std::string of_numbers = "0123456789.+-eE";
  std::vector<std::pair<std::size_t, std::size_t>>
      words;  // runs of what numbers are made of, and of the rest
  for (std::size_t at = 0; at < text.size();) {
    const bool is_number = of_numbers.find(text[at]) != std::string::npos;
    const std::size_t end = std::min(
        text.size(), is_number ? text.find_first_not_of(of_numbers, at) : text.find_first_of(of_numbers, at));
    words.emplace_back(at, end - at);
    at = end;
  }
  const auto [at, length] = any_of(words, random);
  switch (below(4, random)) {
    case 0:
      return text.erase(at, length);
    case 1:
      return text.insert(at, text.substr(at, length));
    case 2: {
      const auto [other, other_length] = any_of(words, random);
      const std::string word = text.substr(other, other_length);
      return text.replace(at, length, word);
    }
    default:
      return text.replace(at, length, any_of(extreme_numbers, random));
  }
}

std::string mutate_json(const std::string& text, Random& random) {
  Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded() || below(5, random) == 0) return mutate_text(text, random);
  std::vector<Json::json_pointer> places{Json::json_pointer()};
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Json& value = json.at(places[k]);
    if (value.is_object())
      for (const auto& [key, inner] : value.items()) places.push_back(places[k] / key);
    if (value.is_array())
      for (std::size_t i = 0; i < std::min<std::size_t>(value.size(), 8); ++i)
        places.push_back(places[k] / i);
  }
  const Json::json_pointer& place = any_of(places, random);
  if (!place.empty() && json.at(place.parent_pointer()).is_object() && below(3, random) == 0)
    json.at(place.parent_pointer()).erase(place.back());
  else
    change(json.at(place), random);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string mutate_dicom(const std::string& bytes, Random& random) {
  const std::vector<Element> elements = elements_of(bytes);
  if (elements.empty() || below(5, random) == 0) return mutate_bytes(bytes, random);
  const Element& element = any_of(elements, random);
  const std::string whole = bytes.substr(element.begin, element.end - element.begin);
  std::string changed = whole;
  const std::size_t head = element.value - element.begin, value_length = element.end - element.value;
  constexpr std::array forms{"AE", "AS", "AT", "CS", "DA", "DS", "FD", "FL", "IS", "LO", "OB", "OW",
                             "PN", "SH", "SL", "SQ", "SS", "ST", "TM", "UI", "UL", "UN", "US", "UT"};
  switch (below(7, random)) {
    case 0:
      changed.clear();
      break;
    case 1:
      changed += whole;
      break;
    case 2:
      changed.replace(4, 2, any_of(forms, random));
      break;
    case 3:
      changed[below(4, random)] = static_cast<char>(below(256, random));
      break;
    case 4: {
      const std::array<std::uint16_t, 5> lengths{0, 1, 0xfffe, 0xffff,
                                                 static_cast<std::uint16_t>(value_length + 2)};
      std::memcpy(changed.data() + 6, &any_of(lengths, random), 2);
      break;
    }
    case 5: {  // another value of the same length
      std::string value = any_of(extreme_numbers, random);
      value.resize(value_length, ' ');
      changed = whole.substr(0, head) + value;
      break;
    }
    default:
      changed = whole.substr(0, head) + mutate_bytes(whole.substr(head), random).substr(0, value_length);
      changed.resize(whole.size(), '\0');
  }
  return bytes.substr(0, element.begin) + changed + bytes.substr(element.end);
}

}  // namespace emmetrope::fuzz
