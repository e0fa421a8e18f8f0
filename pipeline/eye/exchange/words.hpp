#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace emmetrope {

/// A line of a text file as its words, with what errors must name.
struct WordLine {
  std::vector<std::string> words;  ///< at least one
  std::string text;                ///< without leading space
  std::string place;               ///< "file: line 12"

  /// \throw Error (input_invalid) where there is none
  const std::string& word(std::size_t k) const;
  /// \throw Error (input_invalid) where it is none
  double number(std::size_t k) const;
  double number(std::size_t k, double otherwise) const;
  /// 0 to 10000.
  int whole(std::size_t k) const;
  /// From this word to the end of the line.
  std::vector<double> numbers(std::size_t from) const;
  /// What follows the first word, without quotes.
  std::string rest() const;
};

/// The lines that are not empty. UTF-16 with a byte order mark is read as what of it is ASCII.
/// \throw Error (input_invalid) for a file that cannot be read or is larger than 16 MB
std::vector<WordLine> word_lines(const std::filesystem::path& file);

std::string capitals(std::string text);

}  // namespace emmetrope
