#include "correction/stage.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  correction::CorrectionSettings settings;
  correction::PrescriptionSettings& prescription = settings.prescription;
  correction::PictureSettings& picture = settings.picture;
  std::string case_folder, eye, output, criterion = to_string(prescription.criterion),
                                        material = prescription.spectacle.material.name;
  std::vector<double> fovea_mm{0, 0};
  double accommodation_D = 0;

  Command command;
  command.name = "correct";
  command.summary = "Finds the lens that makes the retinal image sharpest, and checks it by the wavefront.";
  command.example = "emmetrope correct CASE --vertex-distance 14";
  command.declare = [&](CLI::App& app) {
    auto* in_case = app.add_option("CASE", case_folder, "case folder with a traced eye");
    auto* schematic =
        app.add_option("--eye", eye, "a schematic eye or an eye.json instead of a case")->excludes(in_case);
    app.add_option("-o,--output", output, "folder for the results of --eye")->needs(schematic);
    app.add_option("--accommodation", accommodation_D, "of a schematic eye, D")->needs(schematic);
    app.add_option("--vertex-distance", prescription.vertex_distance_mm,
                   "spectacle lens to cornea, mm; 0: contact lens")
        ->check(CLI::Range(0.0, 30.0))
        ->capture_default_str();
    app.add_option("--pupil", prescription.pupil_mm, "iris aperture for the prescription, mm")
        ->check(CLI::Range(0.5, 9.0))
        ->capture_default_str();
    app.add_option("--criterion", criterion, "gradient-energy, laplacian-variance or mtf-weighted")
        ->capture_default_str();
    app.add_option("--chart", prescription.chart,
                   "scene on which sharpness is judged; default: detail in all directions");
    app.add_option("--wavelength", prescription.wavelength_nm, "nm")
        ->check(CLI::Range(380.0, 780.0))
        ->capture_default_str();
    app.add_option("--fovea", fovea_mm, "X,Y on the retina from the pole, mm")->delimiter(',')->expected(2);
    declare(app, settings.known.instruments);
    app.add_option("--refraction", settings.known.refractions,
                   "known refraction, settles the lens index: od:-2.25/-1.00x180@12+-0.25")
        ->allow_extra_args(false);
    app.add_option(
           "--lens-index-sigma", settings.lens_index_sigma,
           "standard deviation of the lens index, 0: known; default 0.005, or 0 where trace had --lens-index")
        ->check(CLI::Range(0.0, 0.05));
    app.add_option("--age", settings.what_if.age_years, "years; for the near point")
        ->check(CLI::Range(0.0, 120.0));
    app.add_option("--iol-target", settings.what_if.iol_target_D,
                   "refraction that an intra-ocular lens is to leave, D, 12 mm before the cornea")
        ->check(CLI::Range(-10.0, 5.0))
        ->capture_default_str();
    app.add_option("--iol-a-constant", settings.what_if.iol_a_constant, "of the intra-ocular lens (SRK)")
        ->check(CLI::Range(110.0, 125.0))
        ->capture_default_str();
    app.add_option("--plano-cylinder-distance", prescription.plano_cylinder_distance_mm,
                   "of the plano-cylinder, mm")
        ->check(CLI::Range(0.0, 30.0))
        ->capture_default_str();
    app.add_option("--plano-cylinder-index", prescription.plano_cylinder_index, "of the plano-cylinder")
        ->check(CLI::Range(1.3, 2.0))
        ->capture_default_str();
    app.add_option("--material", material,
                   "of the toric meniscus: cr39, trivex, polycarbonate, 1.60, 1.67, 1.74 or crown")
        ->capture_default_str();
    app.add_option("--base-curve", prescription.spectacle.base_D,
                   "power of its front surface, D; default by Vogel's rule")
        ->check(CLI::Range(0.0, 20.0));
    app.add_option("--centre-thickness", prescription.spectacle.centre_thickness_mm,
                   "mm; default: 2, or what leaves 1 mm at the rim")
        ->check(CLI::Range(0.5, 20.0));
    app.add_option_function<double>(
           "--lens-diameter", [&](double mm) { prescription.spectacle.semi_diameter_mm = mm / 2; },
           "of the meniscus, mm; default 50")
        ->check(CLI::Range(20.0, 90.0));
    app.add_flag(
        "--ablation-picture", settings.ablation_picture,
        "also ablated.png, ablated_wavefront_guided.png: what the eye would see after such an ablation");
    app.add_option("--scene", picture.scene,
                   "scene of corrected.png with --eye; a case has that of its trace stage")
        ->needs(schematic)
        ->capture_default_str();
    app.add_option("--samples", picture.samples, "rays a pixel of corrected.png with --eye")
        ->needs(schematic)
        ->check(CLI::Range(1, 100000))
        ->capture_default_str();
  };
  command.run = [&](const CommonOptions& common) {
    prescription.criterion = correction::measure_from_string(criterion);
    prescription.spectacle.material = correction::lens_material(material);
    prescription.fovea_mm = {fovea_mm[0], fovea_mm[1]};
    prescription.seed = common.seed;
    prescription.verbosity = common.verbosity;
    if (!case_folder.empty()) return correction::correct_case(case_folder, settings, common);
    if (eye.empty()) throw usage_error("neither CASE nor --eye is given");
    if (output.empty()) throw usage_error("--eye needs -o FOLDER for its results");
    EyeOptions options;
    options.accommodation_D = accommodation_D;
    return correction::correct_eye(make_eye(eye, options), output, settings, common);
  };
  return run_command(argc, argv, command);
}
