#include "tests/studies/judged_scan.hpp"

#include "meshing/biometry.hpp"
#include "meshing/partial_biometry.hpp"
#include "pipeline/base/parallel.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/intake/study.hpp"
#include "segmentation/output/fit_json.hpp"
#include "segmentation/study_input.hpp"

namespace emmetrope::segmentation {

std::vector<const Stack*> Scan::stacks() const {
  std::vector<const Stack*> list;
  for (const Stack& volume : volumes) list.push_back(&volume);
  return list;
}

Scan read_scan(const std::filesystem::path& study) {
  IntakeOptions options;
  options.verbosity.quiet = true;
  const StudyInventory inventory = read_inventory(study, options);
  Scan scan;
  scan.name = study.filename().string();
  const std::vector<const SeriesInfo*> series = choose_series(inventory, {});
  for (const SeriesInfo* info : series) {
    scan.volumes.push_back(read_series(inventory, info->uid, options));
    scan.laterality_tags.push_back(info->image_laterality);
  }
  scan.age_years = inventory.subject_of(*series.front()).age_years;
  return scan;
}

void judge(JudgedEye& eye, const std::vector<const Stack*>& stacks, std::optional<double> age_years) {
  eye.edges = read_edges_of(eye.found, stacks);
  fit_and_judge(eye, views_of(eye.found, stacks), start_of(eye.found, eye.edges, age_years));
}

std::vector<JudgedEye> judge(const Scan& scan) {
  const std::vector<const Stack*> stacks = scan.stacks();
  std::vector<JudgedEye> eyes;
  for (const FoundEye& found : scan.find().eyes) eyes.emplace_back().found = found;
  on_threads(2, eyes.size(), [&](std::size_t i) { judge(eyes[i], stacks, scan.age_years); });
  if (eyes.size() != 2) return eyes;
  compare_fellow_eyes(eyes[0], eyes[1], stacks, scan.age_years, 1, Verbosity{true});
  couple_fellow_eyes(eyes[0], eyes[1]);
  return eyes;
}

Json stated_biometry(const JudgedEye& eye, double scale_sd) {
  if (!eye.is_fitted() && !eye.is_read()) return nullptr;
  const Json fit = fit_json(eye, 0.0);
  if (eye.is_read()) return meshing::edge_biometry_json(fit, eye.found.laterality, usual_retinal_depth_mm);
  UncertainEye estimate = fitted_eye(parametric_eye_from_json(fit.at("eye")));
  estimate.add_scale_prior(scale_sd);
  Json biometry = meshing::biometry_json(estimate, {});
  const Json& withheld = fit.at("withheld");
  if (withheld.contains("cornea"))
    meshing::withhold_cornea(biometry, withheld.at("cornea").get<std::string>());
  if (withheld.contains("front")) meshing::withhold_front(biometry, withheld.at("front").get<std::string>());
  return biometry;
}

}  // namespace emmetrope::segmentation
