#pragma once
#include <stdexcept>
#include <string>
#include <vector>

namespace emmetrope {

/// Exit status of every command. docs/use/exit-status.md is the user's copy of this table.
enum class ExitStatus {
  done = 0,
  fault = 1,          ///< unexpected: a defect of the program
  usage = 2,          ///< wrong usage, an unknown eye's name too
  input_invalid = 3,  ///< input invalid or incomplete, a bad eye.json too
  unsupported = 4,    ///< data of a kind not supported
  not_writable = 5,   ///< output not writable: disk full, case in use by another run
  no_result = 6,      ///< the data do not support a result: no clinical number is given
  no_device = 7,      ///< no usable OpenCL device
  partial = 8,        ///< partial result, one eye of two, say
  interrupted = 130,
  terminated = 143,
};

/// A failure that the user can understand: what is wrong (which file, tag or parameter), what was found, what
/// to do.
class Error : public std::runtime_error {
 public:
  /// \param what  names the file, tag or parameter and what was found there
  /// \param remedy  what the user can do; may be empty
  Error(ExitStatus status, const std::string& what, std::string remedy = {})
      : std::runtime_error(what), status_(status), remedy_(std::move(remedy)) {}

  ExitStatus status() const { return status_; }
  const std::string& remedy() const { return remedy_; }
  /// What was being done when it happened, innermost first.
  const std::vector<std::string>& context() const { return context_; }
  /// To be called in a catch block before `throw;`: adds what was being done.
  void add_context(std::string doing) { context_.push_back(std::move(doing)); }

 private:
  ExitStatus status_;
  std::string remedy_;
  std::vector<std::string> context_;
};

inline Error usage_error(const std::string& what, const std::string& remedy = {}) {
  return {ExitStatus::usage, what, remedy};
}
inline Error input_error(const std::string& what, const std::string& remedy = {}) {
  return {ExitStatus::input_invalid, what, remedy};
}
inline Error unsupported_error(const std::string& what, const std::string& remedy = {}) {
  return {ExitStatus::unsupported, what, remedy};
}
inline Error output_error(const std::string& what, const std::string& remedy = {}) {
  return {ExitStatus::not_writable, what, remedy};
}
inline Error no_result_error(const std::string& what, const std::string& remedy = {}) {
  return {ExitStatus::no_result, what, remedy};
}

}  // namespace emmetrope
