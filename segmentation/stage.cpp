#include "segmentation/stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>

#include "pipeline/base/eye_stage.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/fit/eye_fit.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/study.hpp"
#include "segmentation/intake/study_input.hpp"
#include "segmentation/judgement/fellow_eye.hpp"
#include "segmentation/labels/eye_labels.hpp"
#include "segmentation/labels/hand_labels.hpp"
#include "segmentation/output/boundary.hpp"
#include "segmentation/output/overlay.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

struct EyeResult : JudgedEye {
  std::vector<Stack> label_images;  ///< in place of the views' stacks, where labels were given
  bool is_labelled() const { return !label_images.empty(); }
};

void fit_one(EyeResult& eye, const std::vector<const Stack*>& stacks, std::optional<double> age_years,
             const std::function<void()>& advance) {
  const std::vector<const Stack*> views = views_of(eye.found, stacks);
  std::vector<const Stack*> drawn;
  for (const Stack& image : eye.label_images) drawn.push_back(&image);
  fit_and_judge(eye, eye.is_labelled() ? drawn : views, start_of(eye.found, age_years), advance,
                eye.is_labelled() ? Evidence::labels : Evidence::intensities);
  if (!eye.fit) return;
  // What is shown and written is the scanner's image.
  for (std::size_t v = 0; v < views.size(); ++v) eye.fit->stacks[v].stack = views[v];
}

/// One eye a core; the result does not depend on how many cores there are.
void fit_all(std::vector<EyeResult>& eyes, const std::vector<const Stack*>& stacks,
             std::optional<double> age_years, const CommonOptions& common) {
  Progress progress("fitting the eyes", eyes.size() * fit_steps, common.verbosity);
  const auto advance = [&] { progress.advance(); };
  std::vector<std::exception_ptr> faults(eyes.size());
  const auto run = [&](std::size_t i) {
    try {
      fit_one(eyes[i], stacks, age_years, advance);
    } catch (...) {
      faults[i] = std::current_exception();
    }
  };
  if (common.thread_count() > 1) {
    std::vector<std::thread> threads;
    for (std::size_t i = 0; i < eyes.size(); ++i) threads.emplace_back(run, i);
    for (auto& thread : threads) thread.join();
  } else {
    for (std::size_t i = 0; i < eyes.size(); ++i) run(i);
  }
  for (const auto& fault : faults)
    if (fault) std::rethrow_exception(fault);
}

/// \return whether both were measured and are alike enough to tell of each other
bool couple(std::vector<EyeResult>& eyes) {
  if (eyes.size() != 2 || eyes[0].refused() || eyes[1].refused()) return false;
  return couple_eyes(*eyes[0].fit, *eyes[1].fit);
}

/// Angle of the line of the globes' centres against the scanner's horizontal; positive: the left eye is
/// higher.
std::optional<double> head_roll_deg(const std::vector<EyeResult>& eyes) {
  if (eyes.size() != 2) return std::nullopt;
  const auto centre = [](const EyeResult& eye) {
    return eye.fit ? eye.fit->globe_centre_lps() : eye.found.views.front().globe.centre;
  };
  const Eigen::Vector3d d = centre(eyes[1]) - centre(eyes[0]);
  return std::atan2(d.z(), d.x()) / degree;
}

Json fit_json(const EyeResult& eye, const std::optional<double>& roll_deg) {
  Json json{{"laterality", to_string(eye.found.laterality)},
            {"status", eye.refused() ? "refused" : "measured"}};
  json["head_roll_deg"] = roll_deg ? Json(*roll_deg) : Json(nullptr);
  json["evidence"] = eye.is_labelled() ? "labels" : "intensities";
  json["contrast"] = to_string(eye.found.contrast);
  json["quality"] = Json::array();
  for (const QualityGate& gate : eye.gates) json["quality"].push_back(to_json(gate));
  if (!eye.fit) return json;
  const EyeFit& fit = *eye.fit;
  json["globe_centre_lps_mm"] = to_json_vector(fit.globe_centre_lps());
  json["chi2_per_voxel"] = fit.chi2_per_voxel;
  json["voxels"] = fit.samples.size();
  json["iterations"] = fit.iterations;
  json["converged"] = fit.converged;
  json["noise"] = Json::array();
  json["stacks"] = Json::array();
  for (int s = 0; s < fit.layout.stacks; ++s) {
    const ObservedStack& o = fit.stacks[s];
    const int at = fit.layout.stack(s);
    json["noise"].push_back(o.sampling.noise * o.reference);
    json["stacks"].push_back(
        {{"name", o.stack->name},
         {"reference_intensity", o.reference},
         {"noise", o.sampling.noise * o.reference},
         {"shift_lps_mm", to_json_vector(fit.parameters.segment<3>(at + shift_first))},
         {"turn_lps_deg", to_json_vector(fit.parameters.segment<3>(at + turn_first))},
         {"fat_shift_mm", {fit.parameters[at + fat_shift_first], fit.parameters[at + fat_shift_first + 1]}},
         {"misfit", fit.misfit[s]},
         {"gain", std::exp(fit.parameters[at + log_gain])},
         {"sharpness", std::exp(fit.parameters[at + log_sharpness])}});
  }
  json["regions"] = Json::array();
  for (const RegionFit& region : fit.regions)
    json["regions"].push_back({{"name", region.name},
                               {"voxels", region.voxels},
                               {"chi2_per_voxel", region.chi2},
                               {"residual_correlation", region.correlation},
                               {"outlier_share", region.outliers}});
  if (fit.evidence == Evidence::intensities)
    json["cornea"] = {{"form", fit.layout.irregular_cornea ? "irregular" : "biconic"},
                      {"irregularity_chi2", fit.irregularity.chi2},
                      {"irregularity_chi2_limit", CornealIrregularity::chi2_limit}};
  json["apex_start_costs"] = fit.start_costs;
  Json intensities;
  for (int i = vitreous; i <= surround; ++i) intensities[fit.layout.name(i)] = fit.parameters[i];
  json["intensities"] = intensities;
  json["eye"] = to_json(to_parametric_eye(fit, eye.found.laterality));
  return json;
}

void write_eye(const fs::path& folder, const EyeResult& eye, const std::vector<const Stack*>& stacks,
               const std::optional<double>& roll_deg) {
  fs::create_directories(folder);
  write_json(folder / "fit.json", fit_json(eye, roll_deg));
  const auto overlay_file = [&](const Stack& stack) {
    return folder / fmt::format("overlay_{}.png", stack.name);
  };
  const EyeView& first = eye.found.views.front();
  for (const std::vector<EyeView>* views : {&eye.found.views, &eye.found.left_out})
    for (const EyeView& view : *views) {
      const Stack& stack = *stacks[view.stack];
      if (!eye.fit) {
        write_plain(overlay_file(stack), stack, view.globe.centre);
      } else if (views == &eye.found.left_out) {
        write_overlay(overlay_file(stack), *eye.fit, stack, first.globe.centre - view.globe.centre);
      }
    }
  if (!eye.fit) return;
  write_boundary(folder / "boundary.ply", *eye.fit);
  for (std::size_t v = 0; v < eye.fit->stacks.size(); ++v) {
    const std::string& name = eye.fit->stacks[v].stack->name;
    write_overlay(overlay_file(*eye.fit->stacks[v].stack), *eye.fit, v);
    write_residuals(folder / fmt::format("residual_{}.png", name), *eye.fit, v);
  }
}

void write_stacks(const fs::path& folder, const std::vector<EyeResult>& eyes,
                  const std::vector<const Stack*>& stacks) {
  for (const Stack* stack : stacks) {
    std::vector<std::vector<std::uint8_t>> labels(
        stack->slices(),
        std::vector<std::uint8_t>(static_cast<std::size_t>(stack->columns) * stack->rows, 0));
    bool used = false;
    for (const EyeResult& eye : eyes) {
      for (const EyeView& view : eye.found.views) used = used || stacks[view.stack] == stack;
      if (eye.refused()) continue;
      for (std::size_t v = 0; v < eye.fit->stacks.size(); ++v)
        if (eye.fit->stacks[v].stack == stack) rasterise(*eye.fit, v, eye.found.laterality, labels);
    }
    if (!used) continue;
    write_nifti(folder / (stack->name + ".nii.gz"), *stack);
    write_label_nifti(folder / (stack->name + "_labels.nii.gz"), *stack, labels);
  }
  write_json(folder / "labels.json", label_names());
}

Json case_json(const StudyInventory& inventory, const std::vector<const SeriesInfo*>& series,
               const FoundEyes& found, const std::vector<EyeResult>& eyes,
               const std::vector<HandLabels>& labels) {
  Json json{{"subject", to_json(inventory.subject_of(*series.front()))}};
  json["series"] = Json::array();
  for (const SeriesInfo& info : inventory.series) {
    json["series"].push_back(kept_json(info));
  }
  json["stacks"] = Json::array();
  for (const StackChoice& choice : found.choices) {
    json["stacks"].push_back({{"name", series[choice.stack]->name},
                              {"uid", series[choice.stack]->uid},
                              {"used", choice.used},
                              {"contrast", choice.contrast.empty() ? Json(nullptr) : Json(choice.contrast)},
                              {"reason", choice.reason}});
    for (const HandLabels& one : labels)
      if (one.stack == choice.stack) json["stacks"].back()["labels"] = one.input;
  }
  json["eyes"] = Json::object();
  for (const EyeResult& eye : eyes) {
    Json used = Json::array();
    for (const EyeView& view : eye.found.views) used.push_back(series[view.stack]->name);
    json["eyes"][to_string(eye.found.laterality)] = {
        {"name", clinical_name(eye.found.laterality)},
        {"globe_centre_lps_mm", to_json_vector(eye.found.views.front().globe.centre)},
        {"stacks", used},
        {"contrast", to_string(eye.found.contrast)},
        {"evidence", eye.is_labelled() ? "labels" : "intensities"},
        {"status", eye.refused() ? "refused" : "measured"},
        {"reason", eye.reasons()}};
  }
  json["laterality"] = "by patient coordinates: the right eye is the globe at smaller LPS x";
  json["notes"] = found.notes;
  return json;
}

StageVerdict verdict_of(const std::vector<EyeResult>& eyes, const FoundEyes& found, LateralityChoice wanted) {
  StageVerdict verdict;
  int expected = 0, measured = 0;
  for (const Laterality laterality : both_eyes) {
    if (!includes(wanted, laterality)) continue;
    ++expected;
    const auto eye = std::find_if(eyes.begin(), eyes.end(),
                                  [&](const EyeResult& e) { return e.found.laterality == laterality; });
    if (eye == eyes.end()) {
      verdict.reasons.push_back(
          fmt::format("{}: no such eye was found in the images", clinical_name(laterality)));
    } else if (eye->refused()) {
      verdict.reasons.push_back(fmt::format("{}: {}", clinical_name(laterality), eye->reasons()));
    } else {
      ++measured;
    }
  }
  for (const std::string& note : found.notes) verdict.reasons.push_back(note);
  verdict.status =
      measured == expected ? ExitStatus::done : (measured > 0 ? ExitStatus::partial : ExitStatus::no_result);
  return verdict;
}

StageVerdict segment_study(const SegmentOptions& options, const CommonOptions& common,
                           StageWorkspace& workspace) {
  IntakeOptions intake;
  intake.verbosity = common.verbosity;
  intake.any_modality = options.any_modality;
  for (const std::string& words : options.series)
    if (words.find(',') != std::string::npos) intake.choices.push_back(words);
  const StudyInventory inventory = read_inventory(options.study, intake);
  const std::vector<const SeriesInfo*> series = choose_series(inventory, options.series);
  std::vector<Stack> volumes;
  std::vector<std::string> hints;
  for (const SeriesInfo* info : series) {
    volumes.push_back(read_series(inventory, info->uid, intake));
    hints.push_back(info->image_laterality);
    for (const std::string& warning : info->kept.warnings) workspace.warn(info->name + ": " + warning);
  }
  std::vector<const Stack*> stacks;
  for (const Stack& volume : volumes) stacks.push_back(&volume);

  const std::vector<HandLabels> labels = read_hand_labels(options.labels, stacks);
  FoundEyes found = find_eyes(stacks, hints);
  place_labelled_eyes(labels, stacks, found);
  std::vector<EyeResult> eyes;
  for (const FoundEye& eye : found.eyes)
    if (includes(common.laterality, eye.laterality)) eyes.push_back({{eye, std::nullopt, {}, {}}, {}});
  for (EyeResult& eye : eyes)
    for (const HandLabels& one : labels)
      if (one.shows(eye.found.laterality))
        eye.label_images.push_back(label_image(one, *stacks[one.stack], eye.found.laterality));
  const Subject subject = inventory.subject_of(*series.front());
  const std::optional<double> age_years = options.age_years ? options.age_years : subject.age_years;
  fit_all(eyes, stacks, age_years, common);
  if (eyes.size() == 2 && labels.empty())
    compare_fellow_eyes(eyes[0], eyes[1], stacks, age_years, common.verbosity);
  const bool coupled = couple(eyes);

  const std::optional<double> roll = head_roll_deg(eyes);
  if (roll && !limits_of("head_roll_deg").plausible.contains(*roll))
    workspace.warn(fmt::format(
        "the head is rolled by {:.1f} deg: astigmatic axes are given against the scanner", *roll));
  for (const EyeResult& eye : eyes) {
    if (!eye.fitted_again_because.empty())
      workspace.warn(fmt::format("{}: fitted again, from what the other eye is like: {}",
                                 clinical_name(eye.found.laterality), eye.fitted_again_because));
    for (const QualityGate& gate : eye.gates)
      if (!gate.passed)
        workspace.warn(fmt::format("{}: {}", clinical_name(eye.found.laterality), gate.reason));
    write_eye(workspace.folder() / to_string(eye.found.laterality), eye, stacks, roll);
  }
  write_stacks(workspace.folder(), eyes, stacks);
  if (eyes.empty()) {
    // What was looked at, for whoever asks why no eye was found.
    for (const Stack* stack : stacks) {
      const int column = stack->columns / 2, row = stack->rows / 2, slice = stack->slices() / 2;
      write_plain(workspace.folder() / fmt::format("overlay_{}.png", stack->name), *stack,
                  stack->position(column, row, slice));
    }
  }
  Json described = case_json(inventory, series, found, eyes, labels);
  described["corneas_coupled"] = coupled;
  write_json(workspace.case_file("case.json"), described);
  workspace.provenance()["study"] = fs::absolute(options.study).lexically_normal().string();
  return verdict_of(eyes, found, common.laterality);
}

/// The figures a user looks at first.
std::string summary(const Json& fit, Laterality laterality) {
  if (fit.at("status") == "refused") return fmt::format("{}: refused\n", clinical_name(laterality));
  const UncertainEye measured(parametric_eye_from_json(fit.at("eye")));
  const ParametricEye& eye = measured.eye();
  const auto half_width = [&](const char* name) { return 1.96 * measured.sigma(name); };
  return fmt::format(
      "{}: axial length {:.2f} mm, corneal power {:.2f} +- {:.2f} D, anterior chamber {:.2f} +- {:.2f} mm, "
      "lens {:.2f} +- {:.2f} mm\n",
      clinical_name(laterality), eye.pole_depth_mm(), keratometric_D_mm * eye.cornea_c_per_mm,
      keratometric_D_mm * half_width("cornea_c_per_mm"), eye.anterior_chamber_depth_mm,
      half_width("anterior_chamber_depth_mm"), eye.lens_thickness_mm, half_width("lens_thickness_mm"));
}

}  // namespace

Answer segment(const SegmentOptions& options, const CommonOptions& common) {
  StageSpec spec;
  spec.stage = "segmentation";
  spec.parameters = {{"series", options.series},
                     {"any_modality", options.any_modality},
                     {"age_years", options.age_years ? Json(*options.age_years) : Json(nullptr)},
                     {"laterality", to_string(common.laterality)}};
  spec.inputs = input_files(options);
  const StageOutcome outcome = run_stage(options.case_folder, spec, common, [&](StageWorkspace& workspace) {
    return segment_study(options, common, workspace);
  });
  Answer answer = stage_answer(
      *stage_of_folder("segmentation"), outcome, common, [&](Laterality eye) -> std::optional<EyeAnswer> {
        const fs::path file = options.case_folder / "segmentation" / to_string(eye) / "fit.json";
        if (!fs::exists(file)) return std::nullopt;
        const Json fit = read_json(file);
        return EyeAnswer{fit.at("status"), summary(fit, eye)};
      });
  answer.json["case"] = options.case_folder.string();
  return answer;
}

}  // namespace emmetrope::segmentation
