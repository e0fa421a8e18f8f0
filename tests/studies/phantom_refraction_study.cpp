/// Refraction of the phantom eyes that the fit's accuracy study has recorded: docs/evidence/accuracy-refraction.md.
/// Not part of the tests; about half a second an eye.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/base/files.hpp"
#include "tests/support/phantom_refraction.hpp"

using namespace emmetrope;
using namespace emmetrope::correction;

namespace {

std::string median_and_95th(std::vector<double> errors) {
  for (double& error : errors) error = std::abs(error);
  std::sort(errors.begin(), errors.end());
  return fmt::format("{:.2f} / {:.2f}", errors[errors.size() / 2], errors[errors.size() * 95 / 100]);
}

/// One row of the table.
void print(const char* known, const std::vector<RefractionError>& eyes) {
  std::vector<double> M, J, paraxial_M, paraxial_J;
  const double count = static_cast<double>(eyes.size());
  double bias = 0, square_M = 0, square_J = 0;
  int covered[3] = {0, 0, 0};
  for (const RefractionError& eye : eyes) {
    M.push_back(eye.spot[0]);
    J.push_back(eye.spot.tail<2>().norm());
    paraxial_M.push_back(eye.paraxial[0]);
    paraxial_J.push_back(eye.paraxial.tail<2>().norm());
    bias += eye.spot[0] / count;
    square_M += eye.covariance(0, 0) / count;
    square_J += (eye.covariance(1, 1) + eye.covariance(2, 2)) / 2 / count;
    for (int k = 0; k < 3; ++k) covered[k] += eye.covered(k);
  }
  fmt::print("| {} | {} | {:+.2f} | {} | {} | {:.2f} | {:.2f} | {:.1f} / {:.1f} / {:.1f} % | {} | {} |\n",
             known, eyes.size(), bias, median_and_95th(M), median_and_95th(J), std::sqrt(square_M),
             std::sqrt(square_J), 100 * covered[0] / count, 100 * covered[1] / count,
             100 * covered[2] / count, median_and_95th(paraxial_M), median_and_95th(paraxial_J));
}

/// The root of the mean over the eyes of M's variances, line by line. Correlations may take away.
void print_sigmas(const char* what, const std::vector<RefractionError>& eyes,
                  std::vector<BudgetLine> RefractionError::*lines) {
  fmt::print("\n{}, D:", what);
  for (std::size_t i = 0; i < (eyes.front().*lines).size(); ++i) {
    double variance = 0;
    for (const RefractionError& eye : eyes) {
      const double sigma_D = (eye.*lines)[i].M_D;
      variance += sigma_D * std::abs(sigma_D) / static_cast<double>(eyes.size());
    }
    fmt::print("{} {} {:.2f}", i == 0 ? "" : ";", (eyes.front().*lines)[i].source,
               std::copysign(std::sqrt(std::abs(variance)), variance));
  }
  fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Refraction of fitted phantom eyes against that of the true ones");
  std::filesystem::path cache;
  std::string protocol = "surface-coil";
  bool each = false, bound = false;
  app.add_option("--cache", cache, "Folder of the fit study's records")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--protocol", protocol, "surface-coil, head-t2, head-t1, or one of them with -distorted");
  app.add_flag("--bound", bound, "State what noise and priors alone would leave");
  app.add_flag("--each", each, "A line for every eye");
  CLI11_PARSE(app, argc, argv);

  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(cache)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<PhantomEye> eyes;
  int refused = 0;
  for (const std::filesystem::path& file : files) {
    if (file.extension() != ".json" || file.filename().string().rfind(protocol + "-", 0) != 0) continue;
    const Json record = read_json(file);
    if (record.at("protocol") != protocol) continue;
    if (record.at("status") == "measured")
      eyes.push_back(phantom_eye_from_record(record, bound));
    else
      ++refused;
  }
  fmt::print(
      "{}: {} eyes measured, {} refused or not found\n\n| known beside the images | eyes | mean dM, D | dM, "
      "D: median / 95th | dJ, D: median / 95th | stated sigma of M | of J0, J45 | covered: M / J0 / J45 | "
      "paraxial dM | paraxial dJ |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
      protocol, eyes.size(), refused);
  if (eyes.empty()) return 0;
  struct Row {
    const char* name;
    Knowledge knowledge;
  };
  std::vector<RefractionError> index_known;
  for (const Row& row : {Row{"lens index", {false, true}}, Row{"lens index, keratometry", {true, true}},
                         Row{"nothing", {false, false}}, Row{"keratometry", {true, false}}}) {
    std::vector<RefractionError> errors;
    for (const PhantomEye& eye : eyes) {
      errors.push_back(refraction_error(eye, row.knowledge));
      const RefractionError& e = errors.back();
      if (each)
        fmt::print(stderr, "{} {} {}: M {:+.2f} +-{:.2f} J0 {:+.2f} +-{:.2f} J45 {:+.2f} +-{:.2f}\n",
                   eye.seed / 2, to_string(eye.fitted.laterality), row.name, e.spot[0],
                   std::sqrt(e.covariance(0, 0)), e.spot[1], std::sqrt(e.covariance(1, 1)), e.spot[2],
                   std::sqrt(e.covariance(2, 2)));
    }
    print(row.name, errors);
    if (index_known.empty()) index_known = std::move(errors);
  }
  print_sigmas("Where the standard deviation of M comes from, lens index known", index_known,
               &RefractionError::budget);
  print_sigmas("What it would be with one part of the eye known exactly", index_known,
               &RefractionError::if_known);
  return 0;
}
