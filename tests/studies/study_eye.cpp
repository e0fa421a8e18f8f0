#include "tests/studies/study_eye.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <ctime>
#include <functional>
#include <memory>
#include <optional>
#include <random>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/fit/rician.hpp"
#include "segmentation/judgement/fellow_eye.hpp"
#include "tests/studies/judged_scan.hpp"
#include "tests/support/phantom_eyes.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The part of a stack that shows the globes, on the same grid.
phantom::StackPlan cropped(phantom::StackPlan plan, const std::vector<Vector3d>& globes, double reach_mm) {
  const auto crop = [&](const Vector3d& along, double spacing_mm, int& count) {
    const double first = plan.centre.dot(along) - 0.5 * (count - 1) * spacing_mm;
    double low = 1e9, high = -1e9;
    for (const Vector3d& globe : globes) {
      low = std::min(low, globe.dot(along) - reach_mm);
      high = std::max(high, globe.dot(along) + reach_mm);
    }
    const int from = std::clamp(static_cast<int>(std::floor((low - first) / spacing_mm)), 0, count - 1);
    const int to = std::clamp(static_cast<int>(std::ceil((high - first) / spacing_mm)), from, count - 1);
    const double middle = first + 0.5 * (from + to) * spacing_mm;
    plan.centre += (middle - plan.centre.dot(along)) * along;
    count = to - from + 1;
  };
  crop(plan.along_row, plan.pixel_mm, plan.columns);
  crop(plan.along_column, plan.pixel_mm, plan.rows);
  crop(plan.normal(), plan.slice_spacing_mm, plan.slices);
  return plan;
}

/// Takes the face off: LPS y grows backwards.
void deface(PhantomEye& eye, double plane_y_mm) {
  for (Stack& stack : eye.stacks)
    for (int s = 0; s < stack.slices(); ++s)
      for (int r = 0; r < stack.rows; ++r)
        for (int c = 0; c < stack.columns; ++c)
          if (stack.position(c, r, s).y() < plane_y_mm)
            stack.slice_intensity[static_cast<std::size_t>(s)]
                                 [static_cast<std::size_t>(r) * stack.columns + c] = 0;
}

/// Covariance that noise and priors alone would give at the fitted eye: every parameter free, the voxels'
/// deviations those of the noise.
Eigen::MatrixXd information_bound(const EyeFit& fit) {
  FitProblem problem;
  problem.model = &fit.model;
  problem.samples = fit.samples;
  problem.priors = fit.priors;
  problem.rician = true;
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  for (Sample& sample : problem.samples) {
    const double noise = fit.model.stacks()[sample.stack].noise;
    sample.deviation =
        static_cast<float>(noise * rician(std::abs(at.intensity(sample, nullptr)) / noise).deviation);
    // No residuals: the bound knows the truth.
    sample.value = static_cast<float>(noise * rician(std::abs(at.intensity(sample, nullptr)) / noise).mean);
  }
  return covariance(problem, fit.parameters, select_parameters(fit.layout.size(), fit.active));
}

/// What the bound of axial length and corneal power would be if a group of other parameters were known: the
/// conditional covariance.
Json bound_if_known(EyeFit bound) {
  const ParameterLayout& layout = bound.layout;
  const auto in_stack = [&](int parameter, int first, int count) {
    const int at = (parameter - eye_parameter_count) % stack_parameter_count;
    return parameter >= eye_parameter_count && parameter < layout.displacement() && at >= first &&
           at < first + count;
  };
  const auto in_field = [&](int parameter, int first) {
    return parameter >= first && parameter < first + layout.bumps;
  };
  struct Group {
    const char* name;
    std::function<bool(int)> holds;
  };
  const std::vector<Group> groups{
      {"nothing", [](int) { return false; }},
      {"intensity of the cornea", [](int p) { return p == cornea; }},
      {"intensities of lid, air", [](int p) { return p == lid || p == air; }},
      {"all intensities", [](int p) { return p >= vitreous && p <= surround; }},
      {"lid's shape", [](int p) { return p >= lid_thickness && p <= lid_xy; }},
      {"sharpness",
       [&](int p) { return in_stack(p, log_sharpness, 1) || in_stack(p, log_sharpness_ratio, 2); }},
      {"coil, gain", [&](int p) { return in_stack(p, coil_first, shift_first); }},
      {"corneal thickness", [](int p) { return p == cornea_thickness; }},
      {"back ratio", [](int p) { return p == cornea_back_ratio; }},
      {"corneal asphericity", [](int p) { return p == cornea_q || p == cornea_q_split; }},
      {"wall's thickness", [](int p) { return p == wall_lateral || p == wall_axial; }},
      {"background", [&](int p) { return p == surround || in_field(p, layout.background()); }},
      {"fat's displacement", [&](int p) { return in_stack(p, fat_shift_first, 2); }},
      {"head's shifts and turns",
       [&](int p) { return in_stack(p, shift_first, 3) || in_stack(p, turn_first, 3); }},
  };
  Json table;
  const Eigen::MatrixXd covariance = bound.covariance;
  for (const Group& group : groups) {
    std::vector<Eigen::Index> known;
    for (std::size_t i = 0; i < bound.active.size(); ++i)
      if (group.holds(bound.active[i])) known.push_back(static_cast<Eigen::Index>(i));
    bound.covariance = covariance;
    if (!known.empty()) {
      const Eigen::MatrixXd across = covariance(Eigen::all, known);
      bound.covariance -= across * covariance(known, known).ldlt().solve(across.transpose());
    }
    table[group.name] = {bound.pole_depth_sigma_mm(), 337.5 * bound.sigma(cornea_c)};
  }
  return table;
}

Json matrix_json(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& places) {
  Json rows = Json::array();
  for (const Eigen::Index i : places) {
    Json row = Json::array();
    for (const Eigen::Index j : places) row.push_back(matrix(i, j));
    rows.push_back(row);
  }
  return rows;
}

/// Mean distance of the fitted surfaces from points of the true ones.
/// \param fitted_from_true  eye frames
Json surface_distances(const ParametricEye& fitted, const phantom::PlacedEye& truth,
                       const Eigen::Isometry3d& fitted_from_true) {
  constexpr int points = 2000;
  const double golden_angle = pi * (3 - std::sqrt(5.0));
  double retina = 0, cornea = 0;
  for (int i = 0; i < points; ++i) {
    const double angle = golden_angle * i, z = -(i + 0.5) / points, r = std::sqrt(1 - z * z);
    const Vector3d p =
        fitted_from_true * phantom::retina_point(truth, {r * std::cos(angle), r * std::sin(angle), z});
    const Vector3d from_centre = p - fitted.globe_centre_mm();
    const Vector3d scaled = from_centre.cwiseQuotient(fitted.globe_semi_axes_mm);
    const Vector3d n = scaled.normalized();
    const Vector3d on_it = fitted.retina_point(n);
    retina += std::abs((p - on_it).dot(fitted.retina_normal(n))) / points;
  }
  for (int i = 0; i < points; ++i) {
    const double r = 4 * std::sqrt((i + 0.5) / points), angle = golden_angle * i;
    const double x = r * std::cos(angle), y = r * std::sin(angle);
    const Vector3d p =
        fitted_from_true * Vector3d(x, y, -phantom::anterior_cornea_depth_mm(truth.geometry, x, y));
    const double slope = p.head<2>().norm() * fitted.cornea_c_per_mm;
    cornea += std::abs(-p.z() - fitted.cornea_anterior_depth_mm(p.x(), p.y())) *
              std::sqrt(std::max(0.1, 1 - slope * slope)) / points;
  }
  return {{"retina", retina}, {"cornea", cornea}};
}

/// An eye on its way from the images to its record.
struct StudiedEye {
  Laterality laterality;
  Json record;
  std::shared_ptr<const PhantomEye> images;  ///< both eyes' where one stack shows both
  phantom::PlacedEye truth;
  std::optional<JudgedEye> judged;  ///< none: not found
  std::optional<EyeFit> bound;      ///< the same eye with the covariance of the information bound

  bool is_measured() const { return judged && judged->is_measured(); }
};

/// Finds and fits it, as the stage does.
void fit(StudiedEye& eye, bool of_one_eye, double age_years) {
  const std::vector<std::string> hints(eye.images->stacks.size(),
                                       of_one_eye ? (eye.laterality == Laterality::od ? "R" : "L") : "");
  const FoundEyes found = find_eyes(eye.images->views(), hints);
  const auto one = std::find_if(found.eyes.begin(), found.eyes.end(),
                                [&](const FoundEye& f) { return f.laterality == eye.laterality; });
  eye.record["reasons"] = found.notes;
  if (one == found.eyes.end()) return;
  eye.judged.emplace().found = *one;
  judge(*eye.judged, eye.images->views(), age_years);
}

/// What became of it in the record.
void conclude(StudiedEye& eye) {
  eye.record["status"] = !eye.judged ? "not found" : eye.judged->is_measured() ? "measured" : "refused";
  if (!eye.judged) return;
  for (const QualityGate& gate : eye.judged->gates)
    if (!gate.passed) eye.record["reasons"].push_back(gate.reason);
  eye.record["fitted_again_because"] = eye.judged->fitted_again_because;
  if (!eye.judged->fit) return;
  eye.bound = eye.judged->fit;
  eye.bound->covariance = information_bound(*eye.judged->fit);
  eye.bound->shared_covariance = eye.bound->common_covariance = {};  // it has no error of the model
}

/// The fit's figures in the record.
void write_down(StudiedEye& studied) {
  const EyeFit& fit = *studied.judged->fit;
  Json& record = studied.record;
  const ParametricEye eye = to_parametric_eye(fit, studied.laterality);
  std::vector<Eigen::Index> places;
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    if (has_parameter(eye, fit.layout.name(fit.active[i]))) places.push_back(static_cast<Eigen::Index>(i));
  record["bound"] = matrix_json(studied.bound->covariance, places);
  record["bound_if_known"] = bound_if_known(*studied.bound);
  record["fit"] = to_json(eye);
  // Where the eye is in the images that define its pose.
  const Eigen::Isometry3d fitted_from_true =
      eye.lps_from_eye.inverse() *
      studied.images->scanner_from_reference[studied.judged->found.views.front().stack] *
      studied.truth.lps_from_eye;
  record["surface_mm"] = surface_distances(eye, studied.truth, fitted_from_true);
  record["irregular_cornea"] = fit.layout.irregular_cornea;
  record["irregularity_chi2"] = fit.irregularity.chi2;
  record["slice_displacement_mm"] = fit.slice_displacement_mm;
  record["chi2_per_voxel"] = fit.chi2_per_voxel;
  record["regions"] = Json::array();
  for (const RegionFit& region : fit.regions) record["regions"].push_back(region.chi2);
  record["voxels"] = fit.samples.size();
  record["iterations"] = fit.iterations;
  record["converged"] = fit.converged;
  record["start_costs"] = fit.start_costs;
  for (int i = wall_lateral; i < eye_parameter_count; ++i)
    record["nuisance"][fit.layout.name(i)] = fit.value(i);
  record["fat_shift_mm"] = Json::array();
  for (int s = 0; s < fit.layout.stacks; ++s)
    for (const int along : {0, 1})
      record["fat_shift_mm"].push_back(fit.value(fit.layout.stack(s) + fat_shift_first + along));
}

}  // namespace

std::vector<Json> study_head(const StudyProtocol& wanted, unsigned long long seed) {
  phantom::HeadGeometry head =
      wanted.keratoconus ? phantom::random_keratoconus(seed) : phantom::random_head(seed);
  if (!wanted.world.empty()) phantom::furnish(head, wanted.world, seed);
  const phantom::Anatomy anatomy(head);
  phantom::Protocol protocol = phantom::make_protocol(wanted.name, anatomy);
  protocol.disturbances.motion_mm = 0.3;
  protocol.disturbances.motion_deg = wanted.turn_deg;
  protocol.disturbances.seed = seed;
  if (wanted.snr > 0) protocol.disturbances.snr = wanted.snr;
  if (wanted.distorted) {
    std::mt19937_64 random(seed + 77);
    protocol.disturbances.scale_error = std::normal_distribution<double>(0, 0.003)(random);
    protocol.disturbances.chemical_shift_px = 1;
  }
  if (!wanted.world.empty()) phantom::disturb(protocol, wanted.world, seed);
  const Vector3d od = anatomy.eye(Laterality::od).globe_centre_lps(),
                 os = anatomy.eye(Laterality::os).globe_centre_lps();
  for (phantom::StackPlan& plan : protocol.stacks) {
    const bool of_one_eye = plan.coil == phantom::Coil::surface;
    plan = cropped(plan,
                   of_one_eye ? std::vector<Vector3d>{plan.coil_eye == Laterality::od ? od : os}
                              : std::vector<Vector3d>{od, os},
                   19);
  }

  const bool of_one_eye = protocol.stacks.front().coil == phantom::Coil::surface;
  std::mt19937_64 random_plane(seed + 99);
  const double behind_apex_mm = std::uniform_real_distribution<double>(4, 10)(random_plane);
  std::vector<StudiedEye> eyes;
  for (const Laterality laterality : both_eyes) {
    StudiedEye eye{laterality, {{"protocol", wanted.label()}, {"seed", seed}}, {}, {}, {}, {}};
    eye.record["laterality"] = to_string(laterality);
    const double begin_s = processor_s();
    // A head coil's stacks show both eyes.
    if (of_one_eye || eyes.empty()) {
      PhantomEye images = render_eye(head, protocol, laterality, 1);
      if (wanted.defaced)
        deface(images, anatomy.eye(laterality).lps_from_eye.translation().y() + behind_apex_mm);
      eye.images = std::make_shared<PhantomEye>(std::move(images));
    } else {
      eye.images = eyes[0].images;
    }
    const double rendered_s = processor_s();
    eye.truth = phantom::place(head, laterality);
    eye.record["truth"] = phantom::eye_truth(eye.truth, head.lens_index);
    eye.record["age_years"] = head.age_years;
    eye.record["lens_index"] = head.lens_index;
    eye.record["render_s"] = rendered_s - begin_s;
    fit(eye, of_one_eye, head.age_years);
    eye.record["fit_s"] = processor_s() - rendered_s;
    eyes.push_back(std::move(eye));
  }
  if (eyes[0].judged && eyes[1].judged && !of_one_eye)
    compare_fellow_eyes(*eyes[0].judged, *eyes[1].judged, eyes[0].images->views(), head.age_years, 1,
                        Verbosity{true});
  for (StudiedEye& eye : eyes) conclude(eye);
  if (eyes[0].is_measured() && eyes[1].is_measured()) couple_eyes(*eyes[0].bound, *eyes[1].bound);
  if (eyes[0].judged && eyes[1].judged) couple_fellow_eyes(*eyes[0].judged, *eyes[1].judged);
  std::vector<Json> records;
  // Where a scanner's millimetres are wrong, what `mesh` adds for it is added.
  const double scale_sd = protocol.disturbances.scale_error != 0 ? 0.003 : 0;
  for (StudiedEye& eye : eyes) {
    eye.record["verdict"] = eye.judged ? eye.judged->status() : "not found";
    if (eye.judged) eye.record["stated"] = stated_biometry(*eye.judged, scale_sd);
    if (eye.bound) write_down(eye);
    records.push_back(std::move(eye.record));
  }
  return records;
}

std::vector<Json> cached_head(const std::filesystem::path& cache, const StudyProtocol& protocol,
                              unsigned long long seed, bool make) {
  std::filesystem::create_directories(cache);
  std::vector<std::filesystem::path> files;
  for (const Laterality eye : both_eyes)
    files.push_back(cache / fmt::format("{}-{}-{}.json", protocol.label(), seed, to_string(eye)));
  const auto is_there = [](const std::filesystem::path& file) { return std::filesystem::exists(file); };
  if (make && !std::all_of(files.begin(), files.end(), is_there)) {
    const std::vector<Json> records = study_head(protocol, seed);
    for (std::size_t i = 0; i < records.size(); ++i) write_json(files[i], records[i]);
  }
  std::vector<Json> records;
  for (const std::filesystem::path& file : files)
    if (is_there(file)) records.push_back(read_json(file));
  return records;
}

}  // namespace emmetrope::segmentation
