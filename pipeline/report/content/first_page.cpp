#include "pipeline/report/content/first_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/notation.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/remedies.hpp"
#include "pipeline/report/document/numbers.hpp"

namespace emmetrope::report {
namespace {

const NumberStyle coarse_dioptres{1, true, "D"}, millimetres{2, false, "mm"};

double half_width(const Measured& measured) { return (measured.ci95[1] - measured.ci95[0]) / 2; }

/// Readings of other instruments that the correction stage weighed, by how much each would narrow M.
struct Remedy {
  std::string measurement;
  double half_width_D = 0;
};
std::optional<Remedy> best_remedy(const EyeData& eye, double now_D) {
  constexpr double worth_telling = 0.95;
  std::optional<Remedy> best;
  for (const auto& line : eye.prescription.value("if_measured", Json::array())) {
    const auto sigma_D = value_of(line, "M_D");
    if (!sigma_D) continue;
    const double left_D = Measured::from_sigma(0, *sigma_D, "").ci95[1];
    if (left_D < worth_telling * now_D && (!best || left_D < best->half_width_D))
      best = Remedy{with_symbols(line.value("measurement", std::string("a measurement"))), left_D};
  }
  return best;
}

/// The largest of what makes the spherical equivalent uncertain: "lens index".
std::optional<std::pair<std::string, double>> largest_source(const EyeData& eye) {
  std::optional<std::pair<std::string, double>> largest;
  if (!eye.prescription.is_object()) return largest;
  for (const auto& line : eye.prescription.value("budget", Json::array())) {
    const std::string source = line.value("source", std::string());
    const auto sigma_D = value_of(line, "M_D");
    if (!sigma_D || source == "total" || source == "correlations") continue;
    if (!largest || *sigma_D > largest->second) largest = {source, *sigma_D};
  }
  return largest;
}

std::string limit_of(const EyeData& eye) {
  const auto M = measured_in(eye.prescription, "M_D");
  if (M && M->source == "refraction") return "the refraction that was given";
  const auto source = largest_source(eye);
  if (!M || !source) return {};
  std::string shown = source->first == "lens index" ? "lens index, which no MR image shows" : source->first;
  if (Measured::from_sigma(0, source->second, "").ci95[1] > half_width(*M)) return shown;
  return fmt::format("{} (\u00b1{} of \u00b1{} D)", shown,
                     fixed(Measured::from_sigma(0, source->second, "").ci95[1], 1), fixed(half_width(*M), 1));
}

std::string images_of(const EyeData& eye) {
  if (!eye.fit.is_object()) return {};
  std::size_t checks = 0, passed = 0;
  for (const auto& gate : eye.fit.value("quality", Json::array())) {
    ++checks;
    passed += gate.value("passed", true) ? 1 : 0;
  }
  if (checks == 0) return {};
  std::size_t stacks = eye.fit.value("stacks", Json::array()).size();
  std::string joined;
  if (const Json other = eye.fit.value("other_contrast", Json());
      other.is_object() && other.value("joined", false)) {
    stacks += other.value("stacks", Json::array()).size();
    joined = " (T1 and T2 joined)";
  }
  const std::string of_stacks =
      stacks == 0 ? "" : fmt::format("{} {} fitted{}, ", stacks, stacks == 1 ? "stack" : "stacks", joined);
  return passed == checks
             ? fmt::format("{}all {} checks of the fit passed", of_stacks, checks)
             : fmt::format("{}{} of {} checks of the fit failed", of_stacks, checks - passed, checks);
}

std::string assumed_of(const EyeData& eye) {
  if (!eye.prescription.is_object()) return {};
  std::string text = fmt::format("iris aperture {} mm; accommodation as in the scanner",
                                 fixed(value_of(eye.prescription, "pupil_mm").value_or(3), 1));
  if (const auto index = given_lens_index(eye))
    text += fmt::format("; lens index {} ({}), from the refraction that was given", fixed(index->value, 3),
                        format_interval(*index, {3, false, ""}));
  else if (const auto index = value_of(eye.traced, "lens_index"))
    text += fmt::format("; lens index {}, {}", fixed(*index, 3),
                        eye.traced.value("lens_index_from", std::string("given")));
  return text;
}

/// "-2.5 D (-3.4 to -1.7), axis 2 deg +- 6 deg"
std::string cylinder_of(const Json& prescription) {
  const NumberStyle degrees{0, false, "axis"};
  const auto cylinder = measured_in(prescription, "cylinder_D");
  if (!cylinder) return {};
  const std::string power = fmt::format("{} ({})", format(cylinder->value, coarse_dioptres),
                                        format_interval(*cylinder, coarse_dioptres));
  if (!has_axis(prescription.at("cylinder_D"))) return power + ", axis not determined";
  const auto axis = measured_in(prescription, "axis_deg");
  return axis ? fmt::format("{}, axis {} {}", power, format(axis->value, degrees),
                            format_interval(*axis, degrees))
              : power;
}

/// Of numbers that are there for both eyes.
struct Pair {
  double right = 0, left = 0;
  double difference() const { return right - left; }
};
std::optional<Pair> pair_of(const CaseData& data, const Json EyeData::*file, const char* pointer) {
  if (data.eyes.size() != 2) return std::nullopt;
  const auto right = value_at(data.eyes[0].*file, pointer), left = value_at(data.eyes[1].*file, pointer);
  if (!right || !left) return std::nullopt;
  return Pair{*right, *left};
}

// What a refraction moves by, in an average eye, for a word of explanation and no number of the result: 1.336 / 22.2 mm
// of image distance squared for length; a surface of the lens, 3.6 to 7.2 mm behind a cornea of 43 D, acts at the cornea
// by (1 - depth K / n)^2, 0.78 to 0.59.
constexpr double per_mm_of_length = -2.7, per_D_of_cornea = -0.9;
constexpr double lens_surface_D_mm = 1000 * (1.42 - 1.336), lens_front_share = 0.78, lens_back_share = 0.59;
constexpr double worth_explaining_D = 1;

/// "the lens's front radius, 9.1 mm in OD and 10.9 mm in OS (about 1.0 D)": the radius that differs by most power.
/// \param rest_D  what length and cornea leave of the difference of M; empty where the radii do not make half of it
std::string lens_difference(const CaseData& data, double rest_D) {
  const auto front = pair_of(data, &EyeData::biometry, "/lens_anterior_radius_mm"),
             back = pair_of(data, &EyeData::biometry, "/lens_posterior_radius_mm");
  if (!front || !back) return {};
  const auto power_D = [](const Pair& radius_mm, double share) {
    return share * lens_surface_D_mm * (1 / radius_mm.right - 1 / radius_mm.left);
  };
  const double front_D = power_D(*front, lens_front_share), back_D = power_D(*back, lens_back_share);
  const bool is_front = std::abs(front_D) > std::abs(back_D);
  const Pair& radius_mm = is_front ? *front : *back;
  const double change_D = is_front ? front_D : back_D;
  // A rounder lens makes an eye more myopic.
  if (-change_D / rest_D < 0.5) return {};
  return fmt::format("the lens's {} radius, {} mm in OD and {} mm in OS (about {} D)",
                     is_front ? "front" : "back", fixed(radius_mm.right, 1), fixed(radius_mm.left, 1),
                     fixed(std::abs(change_D), 1));
}

/// Of the 95 % interval of the eyes' difference of M, as if their errors were independent: what both share (the scanner's
/// scale, the index at their age) makes it smaller, by how much is not known. Infinite where one has no interval.
double difference_half_width_D(const CaseData& data) {
  double square = 0;
  for (const EyeData& eye : data.eyes) {
    const auto M = measured_in(eye.prescription, "M_D");
    square += M ? std::pow(half_width(*M), 2) : std::numeric_limits<double>::infinity();
  }
  return std::sqrt(square);
}

std::optional<std::string> between_the_eyes(const CaseData& data) {
  if (std::any_of(data.eyes.begin(), data.eyes.end(),
                  [&](const EyeData& eye) { return !judge(data, eye).has_refraction; }))
    return std::nullopt;
  const auto M = pair_of(data, &EyeData::prescription, "/M_D"),
             length = pair_of(data, &EyeData::biometry, "/optical_axial_length_mm"),
             cornea = pair_of(data, &EyeData::biometry, "/astigmatism/M_D");
  if (!M || !length || !cornea || std::abs(M->difference()) < worth_explaining_D) return std::nullopt;
  const double reach_D = difference_half_width_D(data);
  if (std::abs(M->difference()) <= reach_D) return std::nullopt;
  const double by_length_D = per_mm_of_length * length->difference(),
               by_cornea_D = per_D_of_cornea * cornea->difference(),
               rest_D = M->difference() - by_length_D - by_cornea_D;
  std::string cause;
  // Of the same sign as the difference, and a real share of it.
  const auto is_large = [&](double part_D) { return part_D / M->difference() > 0.3; };
  const auto add = [&](const std::string& text) { cause += (cause.empty() ? "" : "; ") + text; };
  if (is_large(by_length_D))
    add(fmt::format("axial length, {} and {} mm (about {} D)", fixed(length->right, 2),
                    fixed(length->left, 2), fixed(std::abs(by_length_D), 1)));
  if (is_large(by_cornea_D))
    add(fmt::format("the cornea, {} and {} D", fixed(cornea->right, 1), fixed(cornea->left, 1)));
  if (is_large(rest_D)) {
    const std::string by_lens = lens_difference(data, rest_D);
    add(by_lens.empty()
            ? fmt::format("{} D that nothing measured explains (the index of each lens is assumed)",
                          fixed(std::abs(rest_D), 1))
            : by_lens);
  }
  if (cause.empty()) return std::nullopt;
  return fmt::format("The eyes differ by {} \u00b1 {} D of spherical equivalent: from {}.",
                     fixed(std::abs(M->difference()), 1), fixed(reach_D, 1), cause);
}

/// Refraction against length: what else makes the eye more or less myopic than its length alone.
std::optional<std::string> against_length(const EyeData& eye) {
  constexpr double usual_length_mm = 23.8, usual_cornea_D = 43.3, surprise_D = 3;
  const auto M = value_at(eye.prescription, "/M_D"),
             length = value_at(eye.biometry, "/optical_axial_length_mm"),
             cornea = value_at(eye.biometry, "/astigmatism/M_D");
  if (!M || !length || !cornea) return std::nullopt;
  const double rest_D = *M - per_mm_of_length * (*length - usual_length_mm);
  const auto interval = measured_in(eye.prescription, "M_D");
  if (std::abs(rest_D) < std::max(surprise_D, interval ? half_width(*interval) : 0)) return std::nullopt;
  const double by_cornea_D = per_D_of_cornea * (*cornea - usual_cornea_D);
  const std::string cause =
      by_cornea_D / rest_D > 0.5
          ? fmt::format("the cornea is {} ({} D)", rest_D < 0 ? "steep" : "flat", fixed(*cornea, 1))
          : fmt::format(
                "the cornea of {} D does not explain it, so the lens is {}, or its assumed index is wrong",
                fixed(*cornea, 1), rest_D < 0 ? "strong" : "weak");
  return fmt::format("{}: {} D at {} mm of axial length: {}.", short_name(eye), signed_fixed(*M, 1),
                     fixed(*length, 1), cause);
}

}  // namespace

std::optional<Measured> given_lens_index(const EyeData& eye) {
  if (!eye.prescription.is_object() || is_contradicted(eye.prescription)) return std::nullopt;
  return measured_in(eye.prescription.value("calibration", Json()), "lens_index_after");
}

bool has_axis(const Json& cylinder_D) {
  if (!cylinder_D.is_object() || !cylinder_D.contains("ci95")) return true;
  const auto measured = cylinder_D.get<Measured>();
  return measured.ci95[0] * measured.ci95[1] > 0;
}

std::string light_of(const Json& prescription, const std::string& text) {
  const double nm = value_of(prescription, "wavelength_nm").value_or(sodium_nm);
  return nm == sodium_nm ? std::string() : fmt::format(fmt::runtime(text), nm);
}

std::string sodium_light() { return fmt::format(" (of {:g} nm)", sodium_nm); }

std::string headline_of(const EyeData& eye, const Judgement& judgement) {
  if (is_contradicted(eye.prescription)) return "Given and images contradict: check eye and sign";
  if (!judgement.has_refraction) return {};
  const Json& prescription = eye.prescription;
  const double M_D = value_of(prescription, "M_D").value_or(0);
  const auto M = measured_in(prescription, "M_D");
  // A number without an interval says nothing.
  if (!M) return fmt::format("SE {}, interval unknown: do not dispense", format(M_D, coarse_dioptres));
  const double reach_D = half_width(*M);
  const std::string lowest = signed_fixed(M->ci95[0], 1), highest = signed_fixed(M->ci95[1], 1);
  // Where there is no prescription no number stands that could be taken for one.
  if (!judgement.has_prescription) return fmt::format("SE {} to {} D", lowest, highest);
  if (!estimate_because(prescription).empty())
    return fmt::format("SE {}, {} to {}: do not dispense", format(M_D, coarse_dioptres), lowest, highest);

  if (!has_axis(prescription.value("cylinder_D", Json())))
    return fmt::format("SE {} (\u00b1{} D), cylinder not determined", format(M_D, coarse_dioptres),
                       fixed(reach_D, 1));
  return fmt::format("{} (SE \u00b1{} D)", refraction_of(prescription.value("rounded", Json::object()), ""),
                     fixed(reach_D, 1));
}

std::vector<std::pair<std::string, std::string>> facts_of(const EyeData& eye, const Judgement& judgement) {
  std::vector<std::pair<std::string, std::string>> facts;
  const auto add = [&](const char* name, const std::string& text) {
    if (!text.empty()) facts.emplace_back(name, text);
  };
  if (judgement.has_prescription) add("Cylinder", cylinder_of(eye.prescription));
  if (const auto length = measured_in(eye.biometry, "optical_axial_length_mm"))
    add("Axial length",
        format(length->value, millimetres) + " (" + format_interval(*length, millimetres) + ")");
  else if (eye.biometry.is_object() || (eye.fit.is_object() && eye.fit.value("status", "") == "refused"))
    add("Axial length", "withheld");
  if (judgement.has_refraction) add("Limited by", limit_of(eye));
  add("Images", images_of(eye));
  if (judgement.has_refraction) add("Assumed", assumed_of(eye));
  return facts;
}

/// The gate that withheld an eye's front; empty: none.
std::string gate_of_front(const Json& fit) {
  if (!fit.is_object()) return {};
  for (const Json& gate : fit.value("quality", Json::array()))
    if (!gate.value("passed", true) && gate.value("withholds", std::string()) == "front")
      return gate.at("name").get<std::string>();
  return {};
}

std::string next_step(const EyeData& eye, const Judgement& judgement) {
  if (judgement.has_refraction) {
    const auto M = measured_in(eye.prescription, "M_D");
    const double now_D = M ? half_width(*M) : 0;
    if (const auto remedy = best_remedy(eye, now_D);
        remedy && !limits_of("M_half_width_D").normal.contains(now_D))
      return fmt::format("{}: it would leave \u00b1{} D of spherical equivalent.",
                         remedy->measurement.rfind("refraction", 0) == 0
                             ? "Refract, and give what was found (--refraction)"
                             : "Measure " + remedy->measurement,
                         fixed(remedy->half_width_D, 1));
    return M && M->source == "refraction" ? "Try the lens in a trial frame before it is dispensed."
                                          : "Confirm by a subjective refraction.";
  }
  if (is_contradicted(eye.prescription)) return judgement.reasons.front().to_do;
  if (judgement.light != Light::red || judgement.verdict.find("not asked for") != std::string::npos)
    return "Run this eye too (--laterality both).";
  if (judgement.verdict.find("has not been run") != std::string::npos)
    return "Run the stages that are missing: emmetrope run.";
  if (measured_in(eye.biometry, "optical_axial_length_mm") &&
      !value_at(eye.biometry, "/keratometry/flat/power_D"))
    return "Add keratometry of this eye (--keratometry): with a cornea there is a refraction. Length and shape stand "
           "as they are.";
  if (const std::string gate = gate_of_front(eye.fit); !gate.empty()) return remedy_of_gate(gate);
  return eye.fit.is_object()
             ? "Rescan this eye: a T2 stack of 0.5 mm in plane and 2 mm slices at most over the whole globe, eyes "
               "closed and still; a surface coil shows the cornea."
             : "Rescan with this eye in the field: a T2 stack over both orbits.";
}

std::vector<std::string> what_explains(const CaseData& data) {
  std::vector<std::string> sentences;
  if (const auto sentence = between_the_eyes(data)) sentences.push_back(*sentence);
  for (const auto& eye : data.eyes)
    if (const auto sentence = judge(data, eye).has_refraction ? against_length(eye) : std::nullopt)
      sentences.push_back(*sentence);
  return sentences;
}

}  // namespace emmetrope::report
