#include "raytrace/mat_file.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>

#include "pipeline/base/write_beside.hpp"

namespace emmetrope::raytrace {
namespace {

/// Whether a file has so many elements, each as long as its tag says. matio does not look whether its writes succeed, and
/// where a full disk took one in the middle closing succeeds too.
bool has_elements(const std::filesystem::path& file, std::size_t count) {
  struct Tag {
    std::uint32_t type, bytes;
  } tag{};
  std::uintmax_t end = 128;  // of the header
  std::ifstream in(file, std::ios::binary);
  for (; count > 0; --count) {
    in.seekg(static_cast<std::streamoff>(end));
    if (!in.read(reinterpret_cast<char*>(&tag), sizeof tag)) return false;
    end += sizeof tag + tag.bytes;
  }
  return std::filesystem::file_size(file) == end;
}

}  // namespace

MatVariable::MatVariable(const std::string& name, std::vector<std::size_t> size, std::vector<float> values)
    : floats_(std::move(values)),
      variable_(Mat_VarCreate(name.c_str(), MAT_C_SINGLE, MAT_T_SINGLE, static_cast<int>(size.size()),
                              size.data(), floats_.data(), MAT_F_DONT_COPY_DATA)) {}

MatVariable::MatVariable(const std::string& name, std::vector<std::size_t> size, std::vector<double> values)
    : doubles_(std::move(values)),
      variable_(Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, static_cast<int>(size.size()),
                              size.data(), doubles_.data(), MAT_F_DONT_COPY_DATA)) {}

MatVariable::MatVariable(const std::string& name, std::string text) {
  std::array<std::size_t, 2> size{1, text.size()};
  variable_.reset(Mat_VarCreate(name.c_str(), MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0));
}

MatVariable::MatVariable(const std::string& name, std::vector<MatVariable> fields)
    : fields_(std::move(fields)) {
  std::array<std::size_t, 2> size{1, 1};
  std::vector<const char*> names;
  for (const MatVariable& field : fields_) names.push_back(field.get()->name);
  variable_.reset(
      Mat_VarCreateStruct(name.c_str(), 2, size.data(), names.data(), static_cast<unsigned>(names.size())));
  if (!variable_) return;
  for (std::size_t k = 0; k < fields_.size(); ++k)
    Mat_VarSetStructFieldByIndex(variable_.get(), k, 0, fields_[k].variable_.release());
}

void write_mat(const std::filesystem::path& file, const std::vector<MatVariable>& variables) {
  write_beside(file, [&](const std::filesystem::path& part) {
    // Left to itself it writes the date: the same result has the same bytes.
    std::unique_ptr<mat_t, decltype(&Mat_Close)> mat(
        Mat_CreateVer(part.c_str(), "MATLAB 5.0 MAT-file, written by Emmetrope", MAT_FT_MAT5), &Mat_Close);
    return mat != nullptr &&
           std::all_of(variables.begin(), variables.end(),
                       [&](const MatVariable& variable) {
                         return variable.get() != nullptr &&
                                Mat_VarWrite(mat.get(), variable.get(), MAT_COMPRESSION_NONE) == 0;
                       }) &&
           Mat_Close(mat.release()) == 0 && has_elements(part, variables.size());
  });
}

}  // namespace emmetrope::raytrace
