#include <algorithm>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/python/bindings.hpp"

namespace emmetrope::python {

py::object to_python(const Json& json) { return py::module_::import("json").attr("loads")(json.dump()); }

Json from_python(const py::object& object) {
  // Numbers and arrays of numpy are not json's; they have a method that makes Python's of them.
  const py::cpp_function plain([](const py::object& value) -> py::object {
    if (!py::hasattr(value, "tolist"))
      throw py::type_error("a " + py::str(py::type::of(value).attr("__name__")).cast<std::string>());
    return value.attr("tolist")();
  });
  try {
    return Json::parse(py::module_::import("json")
                           .attr("dumps")(object, py::arg("allow_nan") = false, py::arg("default") = plain)
                           .cast<std::string>());
  } catch (const py::error_already_set& fault) {
    throw input_error("the dictionary is no JSON: " + py::str(fault.value()).cast<std::string>());
  } catch (const Json::exception& fault) {
    throw input_error(std::string("the dictionary is no JSON: ") + fault.what());
  }
}

void warn(const std::string& text) {
  if (!text.empty() && PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0)
    throw py::error_already_set();  // who wants warnings as errors gets one
}

double wavelength_of(const EyeModel& eye, const std::optional<double>& wavelength_nm) {
  const double nm = wavelength_nm.value_or(eye.reference_wavelength_nm);
  if (!(nm >= 200 && nm <= 2500)) throw usage_error("wavelength_nm: 200 to 2500 are wanted");
  warn(extrapolation_warning(eye, nm));
  return nm;
}

void check_threads(int threads) { check_setting("threads", threads, {0, 1024}); }

int thread_count(int wanted) {
  check_threads(wanted);
  return wanted > 0 ? wanted : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

const double* rows_of_three(const Doubles& array, const char* argument) {
  if (array.ndim() != 2 || array.shape(1) != 3)
    throw usage_error(std::string(argument) + ": an array of shape (N, 3) is wanted");
  return array.data();
}

}  // namespace emmetrope::python

PYBIND11_MODULE(_emmetrope, module) {
  using namespace emmetrope::python;
  bind_errors(module);
  bind_eyes(module);
  bind_rays(module);
  bind_wavefronts(module);
  bind_pictures(module);
  bind_corrections(module);
}
