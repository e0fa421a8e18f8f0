#include "segmentation/intake/identity.hpp"

#include <fmt/format.h>
#include <glib.h>

#include <algorithm>
#include <array>

namespace emmetrope::segmentation {
namespace {

constexpr Tag names[] = {tag::patient_name, tag::other_patient_names, tag::patient_birth_name};
constexpr Tag numbers[] = {tag::patient_id, tag::other_patient_ids, tag::accession_number};
/// What operators type; the other texts that are kept are terms of the standard.
constexpr Tag free_texts[] = {tag::body_part, tag::stack_id};

constexpr std::size_t shortest_name = 3, shortest_number = 3, telling_digits = 5;

/// A text as it is compared: small letters without accents, and where each begins in the text.
struct Folded {
  std::u32string letters;
  std::vector<std::size_t> starts;  ///< one more than letters: the last is the text's end
};

Folded fold(const std::string& text) {
  Folded folded;
  for (std::size_t at = 0; at < text.size();) {
    const gunichar letter = g_utf8_get_char(text.data() + at);
    if (!g_unichar_ismark(letter)) {
      std::array<gunichar, G_UNICHAR_MAX_DECOMPOSITION_LENGTH> parts{};
      g_unichar_fully_decompose(letter, FALSE, parts.data(), parts.size());
      folded.letters += static_cast<char32_t>(g_unichar_tolower(parts[0]));
      folded.starts.push_back(at);
    }
    at += static_cast<std::size_t>(g_unichar_to_utf8(letter, nullptr));
  }
  folded.starts.push_back(text.size());
  return folded;
}

/// The runs of letters that a test holds for.
template <typename Test>
std::vector<std::u32string> runs_of(const std::u32string& letters, const Test& holds) {
  std::vector<std::u32string> runs(1);
  for (const char32_t letter : letters) {
    if (holds(letter))
      runs.back() += letter;
    else if (!runs.back().empty())
      runs.emplace_back();
  }
  if (runs.back().empty()) runs.pop_back();
  return runs;
}

bool is_letter(char32_t letter) { return g_unichar_isalpha(letter); }
bool is_digit(char32_t letter) { return letter >= U'0' && letter <= U'9'; }
bool is_letter_or_digit(char32_t letter) { return g_unichar_isalnum(letter); }

}  // namespace

void Identity::add_name(const std::string& name) {
  for (const auto& part : runs_of(fold(name).letters, is_letter))
    if (part.size() >= (g_unichar_iswide(part[0]) ? 2 : shortest_name)) terms_.insert(part);
}

void Identity::add_number(const std::string& number) {
  const std::u32string folded = fold(number).letters;
  std::u32string bare;
  for (const auto& run : runs_of(folded, is_letter_or_digit)) bare += run;
  for (const auto& term : {folded, bare})
    if (term.size() >= shortest_number) terms_.insert(term);
  for (const auto& run : runs_of(folded, is_digit))
    if (run.size() >= telling_digits) terms_.insert(run);
}

void Identity::add_date(const std::string& date) {
  std::string digits;
  std::copy_if(date.begin(), date.end(), std::back_inserter(digits),
               [](char letter) { return letter >= '0' && letter <= '9'; });
  if (digits.size() != 8) return;
  static constexpr std::array<const char*, 12> months{"jan", "feb", "mar", "apr", "may", "jun",
                                                      "jul", "aug", "sep", "oct", "nov", "dec"};
  const std::string year = digits.substr(0, 4), month = digits.substr(4, 2), day = digits.substr(6);
  const auto month_number = static_cast<std::size_t>(std::stoi(month));
  const auto bare = [](const std::string& number) { return number[0] == '0' ? number.substr(1) : number; };
  std::vector<std::array<std::string, 3>> spellings;
  for (const std::string& y : {year, year.substr(2)})
    for (const auto& [m, d] : {std::pair{month, day}, std::pair{bare(month), bare(day)}})
      spellings.insert(spellings.end(), {{y, m, d}, {d, m, y}, {m, d, y}});
  if (month_number >= 1 && month_number <= 12)
    for (const std::string& d : {day, bare(day)}) {
      const std::string m = months[month_number - 1];
      spellings.insert(spellings.end(), {{d, m, year}, {m, d, year}, {year, m, d}});
    }
  for (const auto& [first, second, third] : spellings)
    for (const char* between : {"", "-", ".", "/", "_", " "}) {
      const std::string spelling = fmt::format("{}{}{}{}{}", first, between, second, between, third);
      if (spelling.size() >= 6) terms_.insert(fold(spelling).letters);
    }
}

void Identity::add(const ImageHeader& header) {
  for (const Tag& tag : names) add_name(header.value(tag));
  for (const Tag& tag : numbers) add_number(header.value(tag));
  add_date(header.value(tag::patient_birth_date));
}

std::string Identity::removed_from(const std::string& text) const {
  const Folded folded = fold(text);
  std::vector<bool> covered(folded.letters.size(), false);
  for (const auto& term : terms_)
    for (auto at = folded.letters.find(term); at != std::u32string::npos;
         at = folded.letters.find(term, at + 1))
      std::fill_n(covered.begin() + static_cast<std::ptrdiff_t>(at), term.size(), true);
  std::string kept;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    if (!covered[i])
      kept.append(text, folded.starts[i], folded.starts[i + 1] - folded.starts[i]);
    else if (i == 0 || !covered[i - 1])
      kept += "[removed]";
  }
  return kept;
}

void Identity::remove_from(ImageHeader& header) const {
  header.description = removed_from(header.description);
  const auto remove = [&](TagValues& values) {
    for (const Tag& tag : free_texts)
      if (const auto found = values.find(tag.keyword); found != values.end())
        found->second = removed_from(found->second);
  };
  remove(header.data_set);
  for (auto& frame : header.frames) remove(frame);
  for (const Tag& tag : names) header.data_set.erase(tag.keyword);
  for (const Tag& tag : numbers) header.data_set.erase(tag.keyword);
  header.data_set.erase(tag::patient_birth_date.keyword);
}

}  // namespace emmetrope::segmentation
