// Both eyes of a study fitted, their lengths with intervals: fit_study STUDY CASE
#include <cstdio>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"
#include "segmentation/stage.hpp"

int main(int argc, char** argv) try {
  using namespace emmetrope;
  if (argc != 3) return std::printf("usage: fit_study STUDY CASE\n"), 2;
  segmentation::SegmentOptions options;
  options.study = argv[1];
  options.case_folder = argv[2];
  const Answer answer = segmentation::segment(options, {});
  for (const auto& [name, status] : answer.json.at("eyes").items()) {
    if (status != "measured") continue;
    const Json fit = read_json(options.case_folder / "segmentation" / name / "fit.json");
    const UncertainEye eye = fitted_eye(parametric_eye_from_json(fit.at("eye")));
    const Propagated length = eye.propagate(
        [](const ParametricEye& one) { return Eigen::VectorXd::Constant(1, one.pole_depth_mm()); });
    std::printf("%s: axial length %.2f +- %.2f mm (95 %%, %s)\n", name.c_str(), length.value[0],
                1.96 * length.sigma(0), length.origin[0].source.c_str());
  }
  return static_cast<int>(answer.status);
} catch (const emmetrope::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.status());
}
