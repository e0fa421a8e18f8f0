#pragma once
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "pipeline/base/json.hpp"
#include "pipeline/eye/model/eye_model.hpp"

/// The Python module: what the commands offer, on numpy arrays, without files between. Each function below adds
/// the names of one subject to it. Work that takes time runs without the interpreter's lock.
namespace emmetrope::python {

namespace py = pybind11;

/// Of doubles in C's order; another array is converted.
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// emmetrope::Error as Python exceptions of the same statuses.
void bind_errors(py::module_& module);
void bind_eyes(py::module_& module);
void bind_rays(py::module_& module);
void bind_wavefronts(py::module_& module);
void bind_pictures(py::module_& module);
void bind_corrections(py::module_& module);

py::object to_python(const Json& json);
Json from_python(const py::object& object);

/// \throw Error (usage)
void check_threads(int threads);
/// All cores where it is 0.
/// \throw Error (usage)
int thread_count(int wanted);

/// Raises a UserWarning, where there is anything to say; wants the interpreter's lock.
void warn(const std::string& text);

/// The eye's own where none is given. Warns where the media's indices are extrapolated, by the interpreter's lock.
/// \throw Error (usage) for one that is no light's, (input_invalid) where the media have no index
double wavelength_of(const EyeModel& eye, const std::optional<double>& wavelength_nm);

/// Rows of three, an array of shape (N, 3).
/// \throw Error (usage) naming the argument for any other shape
const double* rows_of_three(const Doubles& array, const char* argument);

}  // namespace emmetrope::python
