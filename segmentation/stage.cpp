#include "segmentation/stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <map>
#include <optional>

#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/eye_stage.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/finding/mirrored_stacks.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/judgement/fellow_eye.hpp"
#include "segmentation/judgement/lost_slice_gate.hpp"
#include "segmentation/judgement/one_head.hpp"
#include "segmentation/judgement/plane_step_gate.hpp"
#include "segmentation/judgement/two_contrasts.hpp"
#include "segmentation/labels/hand_labels.hpp"
#include "segmentation/output/boundary.hpp"
#include "segmentation/output/case_json.hpp"
#include "segmentation/output/fit_json.hpp"
#include "segmentation/output/images.hpp"
#include "segmentation/study_input.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

/// What the stage reads.
struct StudyImages {
  StudyInventory inventory;
  std::vector<const SeriesInfo*> series;  ///< chosen
  std::vector<Stack> volumes;             ///< of each
  std::vector<HandLabels> labels;
  Subject subject;  ///< of the age that was given, where the study says none

  std::vector<const Stack*> stacks() const {
    std::vector<const Stack*> list;
    for (const Stack& volume : volumes) list.push_back(&volume);
    return list;
  }
};

StudyImages read_images(const SegmentOptions& options, const CommonOptions& common,
                        StageWorkspace& workspace) {
  IntakeOptions intake;
  intake.verbosity = common.verbosity;
  intake.any_modality = options.any_modality;
  for (const SeriesChoice& choice : options.series)
    if (choice.images_with) intake.choices.push_back(choice);
  StudyImages images;
  images.inventory = read_inventory(options.study, intake);
  images.series = choose_series(images.inventory, options.series);
  if (options.series.empty()) {
    if (const std::string warning = volumes_warning(images.series); !warning.empty()) workspace.warn(warning);
    for (const SeriesInfo& info : images.inventory.series) {
      if (info.damaged) workspace.warn(fmt::format("{} is not used: {}", info.name, info.kept.reason));
      if (const std::string why = why_left_out(info, images.inventory); !why.empty())
        workspace.warn(fmt::format("{} is not used: {}; --series chooses", info.name, why));
    }
  }
  for (const SeriesInfo* info : images.series) {
    images.volumes.push_back(read_series(images.inventory, info->uid, intake));
    for (const std::string& warning : info->kept.warnings) workspace.warn(info->name + ": " + warning);
  }
  images.labels = read_hand_labels(options.labels, images.stacks());
  images.subject = subject_of(images.inventory, images.series);
  if (const std::string warning = age_warning(images.subject.age_years, options.age_years); !warning.empty())
    workspace.warn(warning);
  if (!images.subject.age_years) images.subject.age_years = options.age_years;
  return images;
}

FoundEyes find_eyes_in(const StudyImages& images, LateralityChoice asked) {
  std::vector<std::string> laterality_tags;
  for (const SeriesInfo* info : images.series) laterality_tags.push_back(info->image_laterality);
  FoundEyes found = find_eyes(images.stacks(), laterality_tags, one_eye(asked));
  place_labelled_eyes(images.labels, images.stacks(), found);
  return found;
}

/// Fits an eye to its stacks, or to the labels that were drawn on them.
void fit_one(JudgedEye& eye, const StudyImages& images, const std::function<void()>& advance) {
  const std::vector<const Stack*> stacks = images.stacks(), views = views_of(eye.found, stacks);
  std::vector<Stack> drawn;
  for (const HandLabels& labels : images.labels)
    if (labels.shows(eye.found.laterality))
      drawn.push_back(label_image(labels, *stacks[labels.stack], eye.found.laterality));
  std::vector<const Stack*> drawn_views;
  for (const Stack& image : drawn) drawn_views.push_back(&image);
  eye.evidence = drawn.empty() ? Evidence::intensities : Evidence::labels;
  if (drawn.empty()) eye.edges = read_edges_of(eye.found, stacks);
  fit_and_judge(eye, drawn.empty() ? views : drawn_views,
                start_of(eye.found, eye.edges, images.subject.age_years), advance);
  if (!eye.fit) return;
  // What is shown and written is the scanner's image.
  for (std::size_t v = 0; v < views.size(); ++v) eye.fit->stacks[v].stack = views[v];
}

/// One eye a core; the result does not depend on how many cores there are.
std::vector<JudgedEye> fit_all(const std::vector<FoundEye>& found, const StudyImages& images,
                               const CommonOptions& common, const std::string& title) {
  std::vector<JudgedEye> eyes(found.size());
  for (std::size_t i = 0; i < eyes.size(); ++i) eyes[i].found = found[i];
  {
    Progress progress(title, eyes.size() * fit_steps, common.verbosity);
    const auto advance = [&] { progress.advance(); };
    on_threads(common.thread_count(), eyes.size(), [&](std::size_t i) { fit_one(eyes[i], images, advance); });
  }
  if (eyes.size() == 2 && images.labels.empty())
    compare_fellow_eyes(eyes[0], eyes[1], images.stacks(), images.subject.age_years, common.thread_count(),
                        common.verbosity);
  for (JudgedEye& eye : eyes)
    for (const EyeView& view : eye.found.views)
      (images.series[view.stack]->is_nifti() ? judge_plane_steps : judge_lost_slices)(
          eye, view, images.volumes[view.stack]);
  return eyes;
}

/// Where the image that was drawn on shows the eye, as the head moves between images; else where the best one does.
const EyeView& view_drawn_on(const FoundEye& seen, std::size_t stack) {
  for (const std::vector<EyeView>* views : {&seen.views, &seen.left_out})
    for (const EyeView& view : *views)
      if (view.stack == stack) return view;
  return seen.views.front();
}

/// Labels beside what the images show without them.
void compare_labels(std::vector<JudgedEye>& eyes, const FoundEyes& found, const StudyImages& images) {
  for (JudgedEye& eye : eyes) {
    if (eye.evidence != Evidence::labels || !eye.fit) continue;
    const auto seen =
        std::find_if(found.by_images.begin(), found.by_images.end(),
                     [&](const FoundEye& other) { return other.laterality == eye.found.laterality; });
    if (seen == found.by_images.end()) continue;  // who draws may see more than the finder
    const EyeView& view = view_drawn_on(*seen, eye.found.views.front().stack);
    eye.gates.push_back(judge_labels(
        *eye.fit, *seen,
        read_eye(images.volumes[view.stack], {view.globe.centre, seen->axis}, view.globe.weighting)));
  }
}

/// Puts what images of the other contrast say to it.
void add_other_contrast(std::vector<JudgedEye>& eyes, const std::vector<FoundEye>& found,
                        const StudyImages& images, const CommonOptions& common) {
  const bool wanted = std::any_of(found.begin(), found.end(), [&](const FoundEye& in_other) {
    return std::any_of(eyes.begin(), eyes.end(), [&](const JudgedEye& eye) {
      return eye.found.laterality == in_other.laterality && is_other_contrast_wanted(eye, in_other);
    });
  });
  if (wanted) put_together(eyes, fit_all(found, images, common, "fitting the eyes in the other contrast"));
}

/// \return whether both were measured and are alike enough to tell of each other
bool couple(std::vector<JudgedEye>& eyes) { return eyes.size() == 2 && couple_fellow_eyes(eyes[0], eyes[1]); }

/// Angle of the line of the globes' centres against the scanner's horizontal; positive: the left eye is
/// higher. None where they stand by different contrasts, between which the head moved.
std::optional<double> head_roll_deg(const std::vector<JudgedEye>& eyes) {
  if (eyes.size() != 2 || eyes[0].found.weighting != eyes[1].found.weighting) return std::nullopt;
  const auto centre = [](const JudgedEye& eye) {
    return eye.fit ? eye.fit->globe_centre_lps() : eye.found.views.front().globe.centre;
  };
  const Eigen::Vector3d d = centre(eyes[1]) - centre(eyes[0]);
  return std::atan2(d.z(), d.x()) / degree;
}

/// fit.json, the images and the boundary of an eye, in its own folder.
void write_eye(const fs::path& folder, const JudgedEye& eye, const std::vector<const Stack*>& stacks,
               std::optional<double> head_roll_deg) {
  fs::create_directories(folder);
  write_json(folder / "fit.json", fit_json(eye, head_roll_deg));
  write_eye_images(folder, eye, stacks);
  if (eye.fit) write_boundary(folder / "boundary.ply", *eye.fit);
}

void warn_of(const JudgedEye& eye, StageWorkspace& workspace) {
  const char* name = clinical_name(eye.found.laterality);
  if (!eye.fitted_again_because.empty())
    workspace.warn(fmt::format("{}: fitted again, {}", name, eye.fitted_again_because));
  for (const JudgedEye& other : eye.in_other_contrast) {
    const char* contrast = to_string(other.found.weighting);
    if (!other.is_measured() && eye.is_measured() && other.found.merit() > eye.found.merit())
      workspace.warn(fmt::format("{}: {} stands, as less is known by {}: {}", name,
                                 to_string(eye.found.weighting), contrast, other.reasons()));
    if (!other.fitted_again_because.empty())
      workspace.warn(fmt::format("{}: in {} fitted again, {}", name, contrast, other.fitted_again_because));
  }
  for (const QualityGate& gate : eye.gates)
    if (!gate.passed) workspace.warn(fmt::format("{}: {}", name, gate.reason));
}

void warn_of_stored_again(const FoundEyes& found, const std::vector<const Stack*>& stacks,
                          StageWorkspace& workspace) {
  std::map<std::size_t, std::size_t> again;
  for (const std::vector<FoundEye>* eyes : {&found.eyes, &found.in_other_contrast})
    for (const FoundEye& eye : *eyes) again.insert(eye.stored_again.begin(), eye.stored_again.end());
  for (const auto& [stack, stands] : again)
    workspace.warn(fmt::format(
        "{0} is not used{2}: it has the noise of {1}: one acquisition, stored twice, would count twice; "
        "--series with it alone uses it instead",
        stacks[stack]->name, stacks[stands]->name,
        found.choices[stack].used ? " where that one shows the eye" : ""));
}

StageVerdict verdict_of(const std::vector<JudgedEye>& eyes, const FoundEyes& found, LateralityChoice wanted) {
  StageVerdict verdict;
  int expected = 0, measured = 0, in_part = 0;
  for (const Laterality laterality : both_eyes) {
    if (!includes(wanted, laterality)) continue;
    ++expected;
    const auto eye = std::find_if(eyes.begin(), eyes.end(),
                                  [&](const JudgedEye& e) { return e.found.laterality == laterality; });
    if (eye == eyes.end()) {
      verdict.reasons.push_back(
          fmt::format("{}: no such eye was found in the images", clinical_name(laterality)));
    } else if (eye->is_measured()) {
      ++measured;
    } else {
      if (eye->is_fitted() || eye->is_read()) ++in_part;
      verdict.reasons.push_back(fmt::format("{}: {}", clinical_name(laterality), eye->reasons()));
    }
  }
  for (const std::string& note : found.notes) verdict.reasons.push_back(note);
  verdict.status = measured == expected     ? ExitStatus::done
                   : measured + in_part > 0 ? ExitStatus::partial
                                            : ExitStatus::no_result;
  return verdict;
}

StageVerdict segment_study(const SegmentOptions& options, const CommonOptions& common,
                           StageWorkspace& workspace) {
  const StudyImages images = read_images(options, common, workspace);
  const std::vector<const Stack*> stacks = images.stacks();

  FoundEyes found = find_eyes_in(images, common.laterality);
  warn_of_stored_again(found, stacks, workspace);
  require_no_mirrored_stack(found, stacks);
  std::vector<JudgedEye> eyes;
  const bool is_seen = std::any_of(found.eyes.begin(), found.eyes.end(), [&](const FoundEye& eye) {
    return includes(common.laterality, eye.laterality);
  });
  // What each eye tells of the other is the same whichever is asked for.
  if (is_seen) {
    eyes = fit_all(found.eyes, images, common, "fitting the eyes");
    compare_labels(eyes, found, images);
    if (images.labels.empty()) add_other_contrast(eyes, found.in_other_contrast, images, common);
    check_one_head(eyes);
    explain_contrasts(found.choices, eyes);
  }
  const bool coupled = couple(eyes);
  const std::optional<double> roll = head_roll_deg(eyes);
  eyes.erase(std::remove_if(
                 eyes.begin(), eyes.end(),
                 [&](const JudgedEye& eye) { return !includes(common.laterality, eye.found.laterality); }),
             eyes.end());

  if (roll && !limits_of("head_roll_deg").plausible.contains(*roll))
    workspace.warn(fmt::format(
        "the head is rolled by {:.1f} deg: astigmatic axes are given against the scanner", *roll));
  for (const JudgedEye& eye : eyes) {
    warn_of(eye, workspace);
    write_eye(workspace.folder() / to_string(eye.found.laterality), eye, stacks, roll);
  }
  write_volumes(workspace.folder(), eyes, stacks);
  if (eyes.empty()) write_middle_slices(workspace.folder(), stacks);
  write_json(workspace.case_file("case.json"),
             case_json(images.subject, images.inventory, images.series, found, eyes, images.labels, coupled));
  workspace.provenance()["study"] = fs::absolute(options.study).lexically_normal().string();
  return verdict_of(eyes, found, common.laterality);
}

Json parameters_of(const SegmentOptions& options, const CommonOptions& common) {
  Json series = Json::array();
  for (const SeriesChoice& choice : options.series) series.push_back(to_string(choice));
  return {{"series", series},
          {"any_modality", options.any_modality},
          {"age_years", options.age_years ? Json(*options.age_years) : Json(nullptr)},
          {"laterality", to_string(common.laterality)}};
}

}  // namespace

void SegmentOptions::check() const {
  if (study.empty()) throw usage_error("STUDY: its folder is missing");
  if (case_folder.empty()) throw usage_error("--output: the case's folder is missing");
  if (age_years) check_setting("--age", *age_years, human_age_years, " years");
}

Answer segment(const SegmentOptions& options, const CommonOptions& common) {
  options.check();
  StageSpec spec;
  spec.stage = "segmentation";
  spec.parameters = parameters_of(options, common);
  spec.inputs = input_files(options);
  const StageOutcome outcome = run_stage(options.case_folder, spec, common, [&](StageWorkspace& workspace) {
    StageVerdict verdict = segment_study(options, common, workspace);
    require_same_files(options, spec.inputs);
    return verdict;
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
