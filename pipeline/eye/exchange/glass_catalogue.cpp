#include "pipeline/eye/exchange/glass_catalogue.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/exchange/words.hpp"

namespace emmetrope {
namespace {

using Formula = Dispersion::Formula;

constexpr double shortest_nm = 380, longest_nm = 1000;
constexpr double d_nm = 587.5618, f_nm = 486.1327, c_nm = 656.2725;

/// Zemax's numbers of formulas.
enum class CatalogueFormula { schott = 1, sellmeier = 2, conrady = 5 };

std::optional<Dispersion> dispersion_of(int formula, std::vector<double> coefficients) {
  coefficients.resize(10, 0);
  switch (static_cast<CatalogueFormula>(formula)) {
    case CatalogueFormula::schott:
      coefficients.resize(6);
      return Dispersion{Formula::schott, coefficients};
    case CatalogueFormula::sellmeier:
      coefficients.resize(6);
      return Dispersion{Formula::sellmeier, coefficients};
    case CatalogueFormula::conrady:
      coefficients.resize(3);
      return Dispersion{Formula::conrady, coefficients};
  }
  return std::nullopt;
}

/// Schott's formula through the medium's index at the reference wavelength, elsewhere by least squares.
std::vector<double> schott_fit(const Medium& medium, double reference_nm) {
  constexpr int samples = 125;
  static constexpr int terms = 6;
  const auto row = [](double nm) {
    const double square = nm * nm * 1e-6;
    Eigen::RowVectorXd powers(terms);
    powers << 1, square, std::pow(square, -1), std::pow(square, -2), std::pow(square, -3),
        std::pow(square, -4);
    return powers;
  };
  const auto square_of_index = [&](double nm) { return std::pow(medium.index_at(nm, reference_nm), 2); };
  Eigen::MatrixXd powers(samples, terms - 1);
  Eigen::VectorXd squares(samples);
  const Eigen::RowVectorXd reference = row(reference_nm);
  for (int k = 0; k < samples; ++k) {
    const double nm = shortest_nm + (longest_nm - shortest_nm) * k / (samples - 1);
    powers.row(k) = (row(nm) - reference).tail(terms - 1);
    squares(k) = square_of_index(nm) - square_of_index(reference_nm);
  }
  const Eigen::VectorXd fitted = powers.colPivHouseholderQr().solve(squares);
  std::vector<double> coefficients(terms);
  coefficients[0] = square_of_index(reference_nm) - reference.tail(terms - 1) * fitted;
  std::copy(fitted.begin(), fitted.end(), coefficients.begin() + 1);
  return coefficients;
}

struct Entry {
  CatalogueFormula formula = CatalogueFormula::schott;
  std::vector<double> coefficients;
};

Entry entry_of(const Medium& medium, double reference_nm) {
  const Dispersion& dispersion = medium.dispersion;
  const double shift =
      medium.index - (dispersion.formula == Formula::constant ? 0 : dispersion.formula_index(reference_nm));
  const bool own_index = std::abs(shift) < 1e-14;
  switch (dispersion.formula) {
    case Formula::constant:
      return {CatalogueFormula::schott, {medium.index * medium.index, 0, 0, 0, 0, 0}};
    case Formula::conrady: {
      const std::vector<double>& c = dispersion.coefficients;
      return {CatalogueFormula::conrady, {c[0] + shift, c[1], c[2]}};
    }
    case Formula::schott:
      if (own_index) return {CatalogueFormula::schott, dispersion.coefficients};
      break;
    case Formula::sellmeier:
      if (own_index && dispersion.coefficients.size() <= 6)
        return {CatalogueFormula::sellmeier, dispersion.coefficients};
      break;
    default:
      break;
  }
  return {CatalogueFormula::schott, schott_fit(medium, reference_nm)};
}

}  // namespace

std::map<std::string, Medium> read_glass_catalogue(const std::filesystem::path& file, double reference_nm) {
  std::map<std::string, Medium> media;
  std::string name;
  int formula = 0;
  for (const WordLine& line : word_lines(file)) {
    if (line.words[0] == "NM") {
      name = capitals(line.word(1));
      formula = line.whole(2);
    } else if (line.words[0] == "CD" && !name.empty()) {
      if (const auto dispersion = dispersion_of(formula, line.numbers(1)))
        media[name] = Medium{dispersion->formula_index(reference_nm), *dispersion, {}};
    }
  }
  return media;
}

CatalogueGlass catalogue_glass(const std::string& name, const Medium& medium, double reference_nm) {
  Entry entry = entry_of(medium, reference_nm);
  CatalogueGlass glass;
  const Dispersion written = *dispersion_of(static_cast<int>(entry.formula), entry.coefficients);
  for (double nm = shortest_nm; nm <= longest_nm; nm += 1)
    glass.worst_index =
        std::max(glass.worst_index, std::abs(written.formula_index(nm) - medium.index_at(nm, reference_nm)));
  const double n_d = written.formula_index(d_nm);
  const double spread = written.formula_index(f_nm) - written.formula_index(c_nm);
  const double abbe = spread == 0 ? 0 : (n_d - 1) / spread;
  entry.coefficients.resize(10, 0);
  glass.text = fmt::format("NM {} {} 0 {} {} 0 0 -1\n", name, static_cast<int>(entry.formula), n_d, abbe);
  glass.text += "ED 0 0 1 0 1\n";
  glass.text += fmt::format("CD {}\n", fmt::join(entry.coefficients, " "));
  glass.text += "TD 0 0 0 0 0 0 20\nOD -1 -1 -1 -1 -1 -1\n";
  glass.text += fmt::format("LD {} {}\n", shortest_nm / 1000, longest_nm / 1000);
  return glass;
}

}  // namespace emmetrope
