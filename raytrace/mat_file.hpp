#pragma once
#include <matio.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace emmetrope::raytrace {

/// A value of a MATLAB 5 file. Numbers are column after column and live as long as the variable.
class MatVariable {
 public:
  MatVariable(const std::string& name, std::vector<std::size_t> size, std::vector<float> values);
  MatVariable(const std::string& name, std::vector<std::size_t> size, std::vector<double> values);
  MatVariable(const std::string& name, double value)
      : MatVariable(name, {1, 1}, std::vector<double>{value}) {}
  MatVariable(const std::string& name, std::string text);
  /// A structure of 1 x 1.
  MatVariable(const std::string& name, std::vector<MatVariable> fields);

  matvar_t* get() const { return variable_.get(); }

 private:
  struct Free {
    void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
  };
  std::vector<float> floats_;
  std::vector<double> doubles_;
  std::vector<MatVariable> fields_;  ///< whose numbers the structure shows; freed with it
  std::unique_ptr<matvar_t, Free> variable_;
};

/// Writes a MATLAB 5 file of these variables; whole or not at all.
/// \throw Error (not_writable)
void write_mat(const std::filesystem::path& file, const std::vector<MatVariable>& variables);

}  // namespace emmetrope::raytrace
