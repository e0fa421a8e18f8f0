#include "segmentation/intake/identity.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glib.h>

#include <algorithm>
#include <array>
#include <memory>

#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

constexpr Tag names[] = {tag::patient_name,       tag::other_patient_names,  tag::patient_birth_name,
                         tag::mothers_birth_name, tag::referring_physician,  tag::performing_physician,
                         tag::reading_physician,  tag::requesting_physician, tag::operators_name,
                         tag::responsible_person, tag::consulting_physician};
/// Of these a word alone tells nothing: an eye hospital's is "eye".
constexpr Tag whole_texts[] = {tag::patient_id,           tag::other_patient_ids,      tag::accession_number,
                               tag::issuer_of_patient_id, tag::institution_name,       tag::station_name,
                               tag::patient_address,      tag::medical_record_locator, tag::trial_subject_id,
                               tag::trial_reading_id};
/// Of these the short ones are numbers like any other ("1", "100"), and what has no digit is a word ("HEAD").
constexpr Tag numbers[] = {tag::study_id,
                           tag::admission_id,
                           tag::patient_telephone,
                           tag::device_serial_number,
                           tag::placer_order_number,
                           tag::filler_order_number,
                           tag::requested_procedure_id,
                           tag::performed_step_id};
constexpr Tag dates[] = {tag::patient_birth_date, tag::study_date, tag::series_date, tag::acquisition_date};
/// What operators type; the other texts that are kept are terms of the standard.
constexpr Tag free_texts[] = {tag::body_part, tag::stack_id, tag::sequence_name};
/// Lists of terms to which scanners and people add their own.
constexpr Tag types[] = {tag::image_type, tag::frame_type};

/// Of a part of a name alone, and of one beside another: "LI" and "AX" are words of protocols, "NG LI" is a person.
constexpr std::size_t shortest_name = 3, shortest_in_pair = 2;
/// Family, given and middle name, prefix and suffix stand together in any order.
constexpr std::size_t parts_of_name = 5;
constexpr std::size_t shortest_number = 3, telling_digits = 5, shortest_date = 6;
/// Signs of a date's month, and between its numbers: "3 de setembro de 1985", "3 tháng 7 năm 1985".
constexpr std::size_t shortest_month = 3, widest_month = 20, widest_between_numbers = 8;

/// A text as it is compared: small letters without accents, and from where to where in the text each was.
struct Folded {
  std::u32string letters;
  std::vector<std::size_t> starts, ends;
};

/// How letters with marks are written without: bare (""), or as languages spell them out (glib's names).
constexpr std::array<const char*, 4> spellings{"", "C", "de", "da"};

/// Letters whose mark is no mark to Unicode, bare and spelt out where glib does not know how.
struct Stroked {
  gunichar letter;
  char32_t plain;
  const char* spelt;
};
constexpr Stroked stroked[] = {{U'ø', U'o', ""},   {U'đ', U'd', "dj"}, {U'ð', U'd', "dh"}, {U'þ', U't', "th"},
                               {U'ł', U'l', ""},   {U'ı', U'i', "i"},  {U'ħ', U'h', "h"},  {U'ŧ', U't', "t"},
                               {U'æ', U'a', "ae"}, {U'œ', U'o', "oe"}};

std::u32string without_marks(gunichar letter, const char* spelling) {
  if (g_unichar_isdigit(letter))
    return std::u32string(1, U'0' + static_cast<char32_t>(g_unichar_digit_value(letter)));
  letter = g_unichar_tolower(letter);
  std::array<gunichar, G_UNICHAR_MAX_DECOMPOSITION_LENGTH> parts{};
  g_unichar_fully_decompose(letter, FALSE, parts.data(), parts.size());
  // A Korean syllable falls apart into letters, none of which is a mark.
  std::u32string plain(1, static_cast<char32_t>(g_unichar_isalpha(parts[1]) ? letter : parts[0]));
  std::string spelt;
  for (const Stroked& one : stroked)
    if (one.letter == letter) {
      plain[0] = one.plain;
      spelt = one.spelt;
    }
  if (*spelling == '\0' || letter < 0x80) return plain;
  if (spelt.empty()) {
    std::array<char, 8> utf8{};
    g_unichar_to_utf8(letter, utf8.data());
    const std::unique_ptr<char, decltype(&g_free)> ascii(g_str_to_ascii(utf8.data(), spelling), &g_free);
    spelt = ascii.get();
  }
  if (spelt.find('?') != std::string::npos) return plain;
  std::u32string letters;
  for (const char c : spelt) letters += static_cast<char32_t>(g_ascii_tolower(c));
  return letters;
}

/// A letter and the marks that follow it, as the one letter that Unicode has for both where it has one.
gunichar composed(const std::string& letter_and_marks) {
  const std::unique_ptr<char, decltype(&g_free)> one(
      g_utf8_normalize(letter_and_marks.data(), static_cast<gssize>(letter_and_marks.size()),
                       G_NORMALIZE_NFC),
      &g_free);
  return g_utf8_get_char(one ? one.get() : letter_and_marks.data());
}

Folded fold(const std::string& text, const char* spelling = "") {
  Folded folded;
  const auto after = [&](std::size_t at) {
    return at + static_cast<std::size_t>(g_unichar_to_utf8(g_utf8_get_char(text.data() + at), nullptr));
  };
  for (std::size_t at = 0; at < text.size();) {
    std::size_t next = after(at);
    while (next < text.size() && g_unichar_ismark(g_utf8_get_char(text.data() + next))) next = after(next);
    for (const char32_t written : without_marks(composed(text.substr(at, next - at)), spelling)) {
      folded.letters += written;
      folded.starts.push_back(at);
      folded.ends.push_back(next);
    }
    at = next;
  }
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

/// Of a script whose words are of several letters: there a name begins and ends where a word does.
bool is_spelling_letter(char32_t letter) { return is_letter(letter) && !g_unichar_iswide(letter); }

/// The runs of letters as they are written.
std::vector<std::string> words_of(const std::string& text) {
  const Folded folded = fold(text);
  std::vector<std::string> words;
  for (std::size_t first = 0; first < folded.letters.size(); ++first) {
    std::size_t end = first;
    while (end < folded.letters.size() && is_letter(folded.letters[end])) ++end;
    if (end > first)
      words.push_back(text.substr(folded.starts[first], folded.ends[end - 1] - folded.starts[first]));
    first = end;
  }
  return words;
}

/// Letters of a part of a name, one more where each is a word: many a Chinese or Korean name has two.
std::size_t length_of_name(const std::string& part) {
  const std::u32string letters = fold(part).letters;
  return letters.size() + (g_unichar_iswide(letters[0]) ? 1 : 0);
}

void add_spellings(const std::string& text, std::set<std::u32string>& terms) {
  for (const char* spelling : spellings) terms.insert(fold(text, spelling).letters);
}

/// Whether a run of what a test holds for goes on across a place, nothing having been dropped there.
template <typename Test>
bool goes_on(const Folded& text, std::size_t at, const Test& holds) {
  return at > 0 && at < text.letters.size() && text.ends[at - 1] >= text.starts[at] &&
         holds(text.letters[at - 1]) && holds(text.letters[at]);
}

/// What is left where what stands between letters and digits is dropped.
Folded unpunctuated(const Folded& text) {
  Folded bare;
  for (std::size_t i = 0; i < text.letters.size(); ++i)
    if (is_letter_or_digit(text.letters[i])) {
      bare.letters += text.letters[i];
      bare.starts.push_back(text.starts[i]);
      bare.ends.push_back(text.ends[i]);
    }
  return bare;
}

/// A number in a text.
struct Number {
  int value;
  std::size_t first, end;  ///< of its digits
};

/// The numbers of up to four digits.
std::vector<Number> numbers_in(const std::u32string& letters) {
  constexpr std::size_t most_digits = 4;
  std::vector<Number> numbers;
  for (std::size_t first = 0; first < letters.size(); ++first) {
    std::size_t end = first;
    while (end < letters.size() && is_digit(letters[end])) ++end;
    if (end > first && end - first <= most_digits) {
      int value = 0;
      for (std::size_t i = first; i < end; ++i) value = 10 * value + static_cast<int>(letters[i] - U'0');
      numbers.push_back({value, first, end});
    }
    first = end;
  }
  return numbers;
}

/// Whether what stands between day and year may be a month: a word of three letters, of a script other than Latin, or a
/// Roman numeral.
bool may_be_month(const std::u32string& between) {
  const auto words = runs_of(between, is_letter);
  return std::any_of(words.begin(), words.end(), [](const std::u32string& word) {
    return word.size() >= shortest_month || word[0] >= 0x80 ||
           word.find_first_not_of(U"ivx") == std::u32string::npos;
  });
}

/// From where to where a text holds a date that is no fixed text: three numbers in a usual order, the year in full,
/// whatever stands between, or day and year with the month as a word.
std::vector<std::pair<std::size_t, std::size_t>> written_dates(const std::u32string& letters,
                                                               const std::array<int, 3>& date) {
  const auto& [year, month, day] = date;
  const std::vector<Number> found = numbers_in(letters);
  const auto gap_after = [&](std::size_t i) { return found[i + 1].first - found[i].end; };
  const auto is_year = [&, year = year](const Number& n, bool in_full) {
    return n.end - n.first == 4 ? n.value == year : !in_full && n.end - n.first == 2 && n.value == year % 100;
  };
  const auto follows_letter = [&](const Number& n) { return n.first > 0 && is_letter(letters[n.first - 1]); };
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (std::size_t i = 0; i + 1 < found.size(); ++i) {
    const Number &a = found[i], &b = found[i + 1];
    if (i + 2 < found.size() && gap_after(i) <= widest_between_numbers &&
        gap_after(i + 1) <= widest_between_numbers) {
      const Number& c = found[i + 2];
      const bool ends_in_year =
          is_year(c, true) && ((a.value == day && b.value == month) || (a.value == month && b.value == day));
      if (ends_in_year || (is_year(a, true) && b.value == month && c.value == day))
        places.emplace_back(a.first, c.end);
    }
    const std::u32string between = letters.substr(a.end, gap_after(i));
    // "DWI b2000" holds no year: a number hangs on letters only where they stand alone between the two, "3JUL1985".
    const bool is_glued = runs_of(between, is_letter).size() == 1 && is_letter(between.front());
    const bool day_first = a.value == day && is_year(b, false),
               year_first = is_year(a, false) && b.value == day;
    if ((day_first || year_first) && between.size() <= widest_month && may_be_month(between) &&
        !follows_letter(a) && (is_glued || !follows_letter(b)))
      places.emplace_back(a.first, b.end);
  }
  return places;
}

/// Whether a value has words of image types by which images are judged, and short ones at most besides: it stays,
/// whoever is called Norm or Map.
bool is_term_of_types(const std::string& value) {
  static const std::set<std::u32string> terms{
      U"original", U"derived",    U"primary",  U"secondary", U"none",       U"norm",      U"dis2d",
      U"dis3d",    U"mfsplit",    U"mosaic",   U"phase",     U"water",      U"fat",       U"opp",
      U"out",      U"projection", U"image",    U"mip",       U"tmip",       U"minip",     U"tminip",
      U"mnip",     U"max",        U"min",      U"mean",      U"vrt",        U"ssd",       U"volume",
      U"surface",  U"render",     U"rendered", U"rendering", U"curved",     U"map",       U"adc",
      U"eadc",     U"colfa",      U"trace",    U"tracew",    U"tensor",     U"diffusion", U"cbf",
      U"cbv",      U"rcbf",       U"rcbv",     U"relcbf",    U"relcbv",     U"mtt",       U"rmtt",
      U"relmtt",   U"ttp",        U"sub",      U"subtract",  U"subtraction"};
  const auto words = runs_of(fold(value).letters, is_letter_or_digit);
  const auto is_term = [](const auto& word) { return terms.count(word) > 0; };
  return std::any_of(words.begin(), words.end(), is_term) &&
         std::all_of(words.begin(), words.end(),
                     [&](const auto& word) { return word.size() < shortest_name || is_term(word); });
}

}  // namespace

void Identity::add_name(const std::string& name) {
  const std::vector<std::string> parts = words_of(name);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::size_t length = length_of_name(parts[i]);
    if (length >= shortest_name) add_spellings(parts[i], terms_);
    for (std::size_t j = i + 1; j < std::min(i + parts_of_name, parts.size()); ++j) {
      const std::size_t shorter = std::min(length, length_of_name(parts[j]));
      if (shorter < shortest_in_pair || shorter >= shortest_name) continue;
      add_spellings(parts[i] + parts[j], pairs_);
      add_spellings(parts[j] + parts[i], pairs_);
    }
  }
}

void Identity::add_whole(const std::string& text) {
  const std::u32string folded = fold(text).letters;
  for (std::u32string one : runs_of(folded, [](char32_t letter) { return letter != U'\\'; })) {
    one.erase(0, std::min(one.find_first_not_of(U' '), one.size()));
    one.erase(one.find_last_not_of(U' ') + 1);
    std::u32string unpunctuated;
    for (const auto& run : runs_of(one, is_letter_or_digit)) unpunctuated += run;
    for (const auto& term : {one, unpunctuated})
      if (term.size() >= shortest_number) terms_.insert(term);
    if (unpunctuated.size() >= telling_digits) punctuated_.insert(unpunctuated);
  }
  for (const auto& run : runs_of(folded, is_digit))
    if (run.size() >= telling_digits) {
      terms_.insert(run);
      punctuated_.insert(run);
    }
}

void Identity::add_date(const std::string& date) {
  std::string digits;
  std::copy_if(date.begin(), date.end(), std::back_inserter(digits),
               [](char letter) { return letter >= '0' && letter <= '9'; });
  if (digits.size() != 8) return;
  dates_.insert(
      {std::stoi(digits.substr(0, 4)), std::stoi(digits.substr(4, 2)), std::stoi(digits.substr(6))});
  static constexpr std::array<const char*, 12> months{"january",   "february", "march",    "april",
                                                      "may",       "june",     "july",     "august",
                                                      "september", "october",  "november", "december"};
  const std::string year = digits.substr(0, 4), month = digits.substr(4, 2), day = digits.substr(6);
  const auto month_number = static_cast<std::size_t>(std::stoi(month));
  const auto short_form = [](const std::string& number) {
    return number[0] == '0' ? number.substr(1) : number;
  };
  std::vector<std::array<std::string, 3>> orders;
  for (const std::string& y : {year, year.substr(2)})
    for (const auto& [m, d] : {std::pair{month, day}, std::pair{short_form(month), short_form(day)}})
      orders.insert(orders.end(), {{y, m, d}, {d, m, y}, {m, d, y}});
  if (month_number >= 1 && month_number <= 12)
    for (const std::string& d : {day, short_form(day)})
      for (const std::string& m :
           {std::string(months[month_number - 1]), std::string(months[month_number - 1]).substr(0, 3)})
        orders.insert(orders.end(), {{d, m, year}, {m, d, year}, {year, m, d}});
  for (const auto& [first, second, third] : orders) {
    for (const char* between : {"", "-", ".", "/", "_", " "}) {
      const std::string spelling = fmt::format("{}{}{}{}{}", first, between, second, between, third);
      if (spelling.size() < shortest_date) continue;
      terms_.insert(fold(spelling).letters);
      // Six digits alone are b-values or matrix sizes as well.
      if (*between == '\0' && (first == year || third == year)) punctuated_.insert(fold(spelling).letters);
    }
  }
}

void Identity::add_number(const std::string& text) {
  const std::u32string folded = fold(text).letters;
  const auto telling = std::count_if(folded.begin(), folded.end(), is_letter_or_digit);
  if (telling >= static_cast<std::ptrdiff_t>(telling_digits) &&
      std::any_of(folded.begin(), folded.end(), is_digit))
    add_whole(text);
}

void Identity::add(const ImageHeader& header) {
  for (const Tag& tag : names) add_name(header.value(tag));
  for (const Tag& tag : whole_texts) add_whole(header.value(tag));
  for (const Tag& tag : numbers) add_number(header.value(tag));
  for (const Tag& tag : dates) add_date(header.value(tag));
}

std::string Identity::removed_from(const std::string& text) const {
  std::vector<bool> covered(text.size(), false);
  const auto cover = [&](const Folded& written, const std::set<std::u32string>& terms, const auto& of_run) {
    for (const auto& term : terms)
      for (auto at = written.letters.find(term); at != std::u32string::npos;
           at = written.letters.find(term, at + 1)) {
        const std::size_t end = at + term.size();
        if (goes_on(written, at, of_run) || goes_on(written, end, of_run)) continue;
        std::fill(covered.begin() + static_cast<std::ptrdiff_t>(written.starts[at]),
                  covered.begin() + static_cast<std::ptrdiff_t>(written.ends[end - 1]), true);
      }
  };
  for (const char* spelling : spellings) {
    const Folded written = fold(text, spelling);
    cover(written, terms_, [](char32_t) { return false; });
    cover(unpunctuated(written), pairs_, is_spelling_letter);
  }
  const Folded plain = fold(text);
  cover(unpunctuated(plain), punctuated_, is_digit);
  for (const auto& date : dates_)
    for (const auto& [first, end] : written_dates(plain.letters, date))
      std::fill(covered.begin() + static_cast<std::ptrdiff_t>(plain.starts[first]),
                covered.begin() + static_cast<std::ptrdiff_t>(plain.ends[end - 1]), true);
  std::string kept;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    if (!covered[i])
      kept += text[i];
    else if (i == 0 || !covered[i - 1])
      kept += "[removed]";
  }
  return kept;
}

std::string Identity::removed_from_type(const std::string& type) const {
  if (removed_from(type) == type) return type;
  std::vector<std::string> values = split_values(type);
  for (std::string& value : values)
    if (!is_term_of_types(value)) value = removed_from(value);
  return fmt::format("{}", fmt::join(values, "\\"));
}

void Identity::remove_from(ImageHeader& header) const {
  header.description = removed_from(header.description);
  const auto remove = [&](TagValues& values) {
    for (const Tag& tag : free_texts)
      if (const auto found = values.find(tag.keyword); found != values.end())
        found->second = removed_from(found->second);
    for (const Tag& tag : types)
      if (const auto found = values.find(tag.keyword); found != values.end())
        found->second = removed_from_type(found->second);
  };
  remove(header.data_set);
  for (auto& frame : header.frames) remove(frame);
  for (const Tag& tag : names) header.data_set.erase(tag.keyword);
  for (const Tag& tag : whole_texts) header.data_set.erase(tag.keyword);
  for (const Tag& tag : numbers) header.data_set.erase(tag.keyword);
  for (const Tag& tag : dates) header.data_set.erase(tag.keyword);
}

}  // namespace emmetrope::segmentation
