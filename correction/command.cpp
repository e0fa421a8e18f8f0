#include "correction/command.hpp"

#include <CLI/CLI.hpp>
#include <memory>

#include "correction/stage.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope::correction {
namespace {

/// As it is typed.
struct Flags {
  CorrectionSettings settings;
  KnownDataFlags known;
  std::string case_folder, eye, output, criterion = to_string(PrescriptionSettings{}.criterion),
                                        material = PrescriptionSettings{}.spectacle.material.name;
  std::vector<double> fovea_mm;
  double accommodation_D = 0;
};

/// What is corrected: a case, or one eye by name or file.
/// \return the option that gives the latter
CLI::Option* declare_eye(CLI::App& app, Flags& flags) {
  auto* in_case = app.add_option("CASE", flags.case_folder, "case folder with a traced eye");
  auto* schematic = app.add_option("--eye", flags.eye, "a schematic eye or an eye.json instead of a case")
                        ->excludes(in_case);
  app.add_option("-o,--output", flags.output, "folder for the results of --eye")->needs(schematic);
  app.add_option("--accommodation", flags.accommodation_D, "of a schematic eye, D")->needs(schematic);
  return schematic;
}

/// How the sharpest lens is sought.
void declare_search(CLI::App& app, Flags& flags) {
  PrescriptionSettings& prescription = flags.settings.prescription;
  app.add_option("--vertex-distance", prescription.vertex_distance_mm,
                 "spectacle lens to cornea, mm; 0: contact lens")
      ->check(CLI::Range(0.0, 30.0))
      ->capture_default_str();
  app.add_option("--pupil", prescription.pupil_mm, "iris aperture for the prescription, mm")
      ->check(CLI::Range(iris_aperture_mm.low, iris_aperture_mm.high))
      ->capture_default_str();
  app.add_option("--criterion", flags.criterion, "gradient-energy, laplacian-variance or mtf-weighted")
      ->capture_default_str();
  app.add_option("--chart", prescription.chart,
                 "scene on which sharpness is judged; default: detail in all directions");
  app.add_option("--wavelength", prescription.wavelength_nm, "nm")
      ->check(CLI::Range(380.0, 780.0))
      ->capture_default_str();
  app.add_option("--fovea", flags.fovea_mm, "X,Y on the retina from the pole, mm; of a case as it was traced")
      ->delimiter(',')
      ->expected(2);
}

/// What the clinic knows of the eye.
void declare_known_data(CLI::App& app, Flags& flags) {
  emmetrope::declare(app, flags.known.instruments);
  app.add_option("--refraction", flags.known.refractions,
                 "known refraction, settles the lens index: od:-2.25/-1.00x180@12+-0.25")
      ->allow_extra_args(false);
  app.add_option(
         "--lens-index-sigma", flags.settings.lens_index_sigma,
         "standard deviation of the lens index, 0: known; default 0.005 (more below 18 and above 70 years), or 0 "
         "where trace had --lens-index")
      ->check(CLI::Range(0.0, 0.05));
}

void declare_what_if(CLI::App& app, WhatIfSettings& what_if) {
  app.add_option("--age", what_if.age_years, "years, for the near point; of a case as it was traced")
      ->check(CLI::Range(human_age_years.low, human_age_years.high));
  app.add_option("--iol-target", what_if.iol_target_D,
                 "refraction that an intra-ocular lens is to leave, D, 12 mm before the cornea")
      ->check(CLI::Range(-10.0, 5.0))
      ->capture_default_str();
  app.add_option("--iol-a-constant", what_if.iol_a_constant, "of the intra-ocular lens (SRK)")
      ->check(CLI::Range(110.0, 125.0))
      ->capture_default_str();
}

/// The paper's plano-cylinder, and the toric meniscus.
void declare_real_lenses(CLI::App& app, Flags& flags) {
  PrescriptionSettings& prescription = flags.settings.prescription;
  SpectacleSettings& spectacle = prescription.spectacle;
  app.add_option("--plano-cylinder-distance", prescription.plano_cylinder_distance_mm,
                 "of the plano-cylinder, mm")
      ->check(CLI::Range(0.0, 30.0))
      ->capture_default_str();
  app.add_option("--plano-cylinder-index", prescription.plano_cylinder_index, "of the plano-cylinder")
      ->check(CLI::Range(1.3, 2.0))
      ->capture_default_str();
  app.add_option("--material", flags.material,
                 "of the toric meniscus: cr39, trivex, polycarbonate, 1.60, 1.67, 1.74 or crown")
      ->capture_default_str();
  app.add_option("--base-curve", spectacle.base_D, "power of its front surface, D; default by Vogel's rule")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--centre-thickness", spectacle.centre_thickness_mm,
                 "mm; default: 2, or what leaves 1 mm at the rim")
      ->check(CLI::Range(0.5, 20.0));
  app.add_option_function<double>(
         "--lens-diameter", [&](double mm) { spectacle.semi_diameter_mm = mm / 2; },
         "of the meniscus, mm; default 50")
      ->check(CLI::Range(20.0, 90.0));
}

void declare_pictures(CLI::App& app, CLI::Option* schematic, CorrectionSettings& settings) {
  app.add_flag(
      "--ablation-picture", settings.ablation_picture,
      "also ablated.png, ablated_wavefront_guided.png: what the eye would see after such an ablation");
  app.add_option("--scene", settings.picture.scene,
                 "scene of corrected.png with --eye; a case has that of its trace stage")
      ->needs(schematic)
      ->capture_default_str();
  app.add_option("--samples", settings.picture.samples, "rays a pixel of corrected.png with --eye")
      ->needs(schematic)
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
}

void declare(CLI::App& app, Flags& flags) {
  CLI::Option* schematic = declare_eye(app, flags);
  declare_search(app, flags);
  declare_known_data(app, flags);
  declare_what_if(app, flags.settings.what_if);
  declare_real_lenses(app, flags);
  declare_pictures(app, schematic, flags.settings);
}

CorrectionSettings read_flags(const Flags& flags, const CommonOptions& common) {
  CorrectionSettings settings = flags.settings;
  PrescriptionSettings& prescription = settings.prescription;
  prescription.criterion = criterion_from_string(flags.criterion);
  prescription.spectacle.material = lens_material(flags.material);
  if (!flags.fovea_mm.empty()) settings.fovea_mm = Eigen::Vector2d(flags.fovea_mm[0], flags.fovea_mm[1]);
  prescription.seed = common.seed;
  prescription.verbosity = common.verbosity;
  settings.known = parse_known_data(flags.known);
  return settings;
}

Answer run(const Flags& flags, const CommonOptions& common) {
  CorrectionSettings settings = read_flags(flags, common);
  if (!flags.case_folder.empty()) return correct_case(flags.case_folder, settings, common);
  if (flags.eye.empty()) throw usage_error("neither CASE nor --eye is given");
  if (flags.output.empty()) throw usage_error("--eye needs -o FOLDER for its results");
  EyeOptions options;
  options.accommodation_D = flags.accommodation_D;
  settings.what_if.accommodation_D = flags.accommodation_D;
  return correct_eye(make_eye(flags.eye, options), flags.output, settings, common);
}

}  // namespace

Command command() {
  const auto flags = std::make_shared<Flags>();
  Command command;
  command.name = "correct";
  command.summary = "Finds the lens that makes the retinal image sharpest, and checks it by the wavefront.";
  command.example = "emmetrope correct CASE --vertex-distance 14";
  command.declare = [flags](CLI::App& app) { declare(app, *flags); };
  command.run = [flags](const CommonOptions& common) { return run(*flags, common); };
  command.check = [flags](const CommonOptions& common) { read_flags(*flags, common).check(); };
  command.result_keys = {"laterality",
                         "vertex_distance_mm",
                         "pupil_mm",
                         "wavelength_nm",
                         "fovea_mm",
                         "criterion",
                         "chart",
                         "withheld",
                         "estimate",
                         "sphere_D",
                         "cylinder_D",
                         "axis_deg",
                         "M_D",
                         "J0_D",
                         "J45_D",
                         "text",
                         "plus_cylinder_text",
                         "rounded",
                         "contact_lens",
                         "lenses",
                         "sharpest_lens",
                         "plano_cylinder",
                         "wavefront_check",
                         "difference",
                         "sharpness",
                         "images",
                         "search",
                         "budget",
                         "if_measured",
                         "peripheral",
                         "learnt_from",
                         "notice",
                         "what_if"};
  return command;
}

}  // namespace emmetrope::correction
