#include <array>

#include "pipeline/base/error.hpp"
#include "pipeline/python/bindings.hpp"

namespace emmetrope::python {
namespace {

struct ErrorType {
  ExitStatus status;
  const char* name;
  const char* meaning;
};
constexpr std::array<ErrorType, 6> error_types{
    {{ExitStatus::usage, "UsageError", "An argument is wrong, or names nothing that is known."},
     {ExitStatus::input_invalid, "InputError", "A file or a value in it is invalid or incomplete."},
     {ExitStatus::unsupported, "UnsupportedError", "Data of a kind that is not supported."},
     {ExitStatus::not_writable, "OutputError", "An output cannot be written."},
     {ExitStatus::no_result, "NoResultError", "The data do not support a result."},
     {ExitStatus::no_device, "DeviceError", "There is no usable OpenCL device."}}};

/// The classes live as long as the interpreter.
py::handle new_exception(py::module_& module, const char* name, const char* meaning, const py::handle& base) {
  const std::string full = std::string("emmetrope.") + name;
  const py::handle type(PyErr_NewExceptionWithDoc(full.c_str(), meaning, base.ptr(), nullptr));
  module.attr(name) = type;
  return type;
}

}  // namespace

void bind_errors(py::module_& module) {
  static py::handle base_type;
  static std::array<py::handle, error_types.size()> types;
  base_type =
      new_exception(module, "Error",
                    "What went wrong, as the commands say it: `status` is their exit status, `remedy` "
                    "what can be done (may be empty).",
                    PyExc_RuntimeError);
  for (std::size_t k = 0; k < types.size(); ++k)
    types[k] = new_exception(module, error_types[k].name, error_types[k].meaning, base_type);
  // NOLINTNEXTLINE(performance-unnecessary-value-param): pybind11 asks for a value
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      py::handle type = base_type;
      for (std::size_t k = 0; k < types.size(); ++k)
        if (error_types[k].status == error.status()) type = types[k];
      const py::object instance = type(std::string(error.what()));
      instance.attr("status") = static_cast<int>(error.status());
      instance.attr("remedy") = error.remedy();
      PyErr_SetObject(type.ptr(), instance.ptr());
    }
  });
}

}  // namespace emmetrope::python
