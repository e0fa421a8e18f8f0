#pragma once
#include <random>
#include <string>

/// Inputs as somebody might break them. Each returns another input than it was given, most often one that is still
/// nearly well formed.
namespace emmetrope::fuzz {

using Random = std::mt19937_64;

/// Bits, bytes, blocks: flipped, set to extremes, cut off, doubled, moved.
std::string mutate_bytes(std::string bytes, Random& random);

/// Words and numbers of a text: extremes, other signs, missing, doubled, lines swapped.
std::string mutate_text(std::string text, Random& random);

/// A value of a JSON document: another type, an extreme, missing, deeply nested; text that is no JSON as bytes.
std::string mutate_json(const std::string& text, Random& random);

/// An element of a DICOM file (explicit little endian): its value, length, representation or tag, missing or doubled; other
/// bytes as bytes.
std::string mutate_dicom(const std::string& bytes, Random& random);

}  // namespace emmetrope::fuzz
