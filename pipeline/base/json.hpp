#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace emmetrope {

/// JSON with its keys in the order they were written, so that files are stable and readable.
using Json = nlohmann::ordered_json;

/// Reads a JSON file.
/// \throw Error (input_invalid) naming the file, and line and column of a syntax error
Json read_json(const std::filesystem::path& file);

/// The same of a text.
/// \param name  what errors call it
Json parse_json(const std::string& text, const std::string& name);

/// Writes `json` with two spaces of indentation and a final newline, whole or not at all. Numbers are written
/// in the shortest form that reads back to the same double.
/// \throw Error (not_writable)
void write_json(const std::filesystem::path& file, const Json& json);

}  // namespace emmetrope
