#include "pipeline/eye/instruments/instruments.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/typed_number.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Error misread(const std::string& flag, const std::string& text, const std::string& expected) {
  return usage_error(fmt::format("{} {}: cannot be read", flag, text), "expected " + expected);
}

double checked(const std::string& flag, const std::string& text, double low, double high, const char* unit) {
  const auto value = typed_number(text);
  if (!value) throw misread(flag, text, fmt::format("a number in {}", unit));
  if (*value < low || *value > high)
    throw usage_error(fmt::format("{} {}: no eye has that", flag, text),
                      fmt::format("expected {:g} to {:g} {}", low, high, unit));
  return *value;
}

struct Meridian {
  double power_D, axis_deg;
};

Meridian parse_meridian(const std::string& text) {
  const auto at = text.find('@');
  if (at == std::string::npos) throw misread("--keratometry", text, "POWER@AXIS, such as 43.25@175");
  return {checked("--keratometry", text.substr(0, at), 30, 60, "D"),
          checked("--keratometry", text.substr(at + 1), 0, 180, "degrees")};
}

/// A length by an optical biometer.
ExternalMeasurement biometry(const char* quantity, Functional of_eye, double value_mm, double sigma_mm) {
  return {"biometry", std::move(of_eye), VectorXd::Constant(1, value_mm),
          MatrixXd::Constant(1, 1, sigma_mm * sigma_mm), quantity};
}

/// One standard deviation of an instrument's readings: where none is typed, and about the least that the best repeat.
struct Accuracy {
  double usual, least;
};
/// Of a keratometer or topographer, D, and of a biometer, mm.
constexpr Accuracy of_powers{0.25, 0.01}, of_lengths{0.05, 0.005};

VectorXd one(double value) { return VectorXd::Constant(1, value); }

/// A flag's eye and the rest.
struct EyeFlag {
  Laterality eye = Laterality::od;
  std::string value;  ///< between the colon and +-
  double sigma = 0;   ///< what was given, or the flag's default
};

EyeFlag parse_eye_flag(const std::string& flag, const std::string& text, const Accuracy& accuracy) {
  const std::string expected = "EYE:VALUE+-SIGMA, EYE being od or os";
  EyeFlag parsed;
  if (text.rfind("od:", 0) == 0)
    parsed.eye = Laterality::od;
  else if (text.rfind("os:", 0) == 0)
    parsed.eye = Laterality::os;
  else
    throw misread(flag, text, expected);
  const auto sign = text.rfind("+-");
  parsed.value = text.substr(3, sign == std::string::npos ? sign : sign - 3);
  parsed.sigma = accuracy.usual;
  if (sign != std::string::npos) {
    const auto sigma = typed_number(text.substr(sign + 2));
    if (!sigma || !(*sigma > 0)) throw misread(flag, text, "a positive number after +-");
    // More is worse than any instrument, and than the images: hundredths of a unit.
    const double worst = 20 * accuracy.usual;
    if (*sigma < accuracy.least || *sigma > worst)
      throw misread(flag, text, fmt::format("one standard deviation of {:g} to {:g}", accuracy.least, worst));
    parsed.sigma = *sigma;
  }
  if (parsed.value.empty()) throw misread(flag, text, expected);
  return parsed;
}

/// One file, or one of the same bytes; a file that is not there is another's fault to tell.
bool is_same_map(const std::filesystem::path& a, const std::filesystem::path& b) {
  if (a.lexically_normal() == b.lexically_normal()) return true;
  std::error_code missing;
  return std::filesystem::is_regular_file(a, missing) && std::filesystem::is_regular_file(b, missing) &&
         sha256_of_file(a) == sha256_of_file(b);
}

}  // namespace

void declare(CLI::App& app, InstrumentFlags& flags) {
  const auto measurement = [&](const char* flag, std::vector<std::string>& values, const char* help) {
    app.add_option(flag, values, help)
        ->allow_extra_args(false)
        ->type_name("EYE:VALUE+-SD")
        ->group("Measured by other instruments (repeatable)");
  };
  measurement("--keratometry", flags.keratometry,
              "K in D at its axis in degrees, both meridians: od:43.25@175/44.75@85+-0.25");
  measurement("--axial-length", flags.axial_length, "Optical axial length, mm: od:23.60+-0.05");
  measurement("--acd", flags.anterior_chamber_depth, "Anterior chamber depth with the cornea, mm");
  measurement("--lens-thickness", flags.lens_thickness, "Lens thickness, mm");
  measurement("--topography", flags.topography,
              "Corneal elevation map (CSV) or Zernike list (JSON); SD of its power in D: od:FILE+-0.25");
}

Json to_json(const std::map<Laterality, EyeInstruments>& instruments) {
  Json json = Json::object();
  for (const auto& [eye, known] : instruments) {
    Json& of_eye = json[to_string(eye)];
    of_eye = {{"measurements", Json::array()}, {"topography", nullptr}};
    for (const ExternalMeasurement& measurement : known.measurements)
      of_eye["measurements"].push_back(
          {{"quantity", measurement.quantity},
           {"value", std::vector<double>(measurement.value.begin(), measurement.value.end())},
           {"sigma", std::sqrt(measurement.covariance(0, 0))}});
    if (known.topography)
      of_eye["topography"] = {{"file", known.topography->file.string()},
                              {"sigma_D", known.topography->sigma_D}};
  }
  return json;
}

std::set<std::string> given_of(const Json& instruments, Laterality eye) {
  std::set<std::string> names;
  if (!instruments.is_object() || !instruments.contains(to_string(eye))) return names;
  const Json& of_eye = instruments.at(to_string(eye));
  for (const Json& measurement : of_eye.at("measurements")) names.insert(measurement.at("quantity"));
  if (!of_eye.at("topography").is_null()) names.emplace("topography");
  return names;
}

std::map<Laterality, EyeInstruments> parse_instruments(const InstrumentFlags& flags,
                                                       double retinal_depth_mm) {
  std::map<Laterality, EyeInstruments> by_eye;
  const auto add = [&](const char* flag, const std::vector<std::string>& texts, const Accuracy& accuracy,
                       auto measurement) {
    for (const std::string& text : texts) {
      const EyeFlag parsed = parse_eye_flag(flag, text, accuracy);
      ExternalMeasurement reading = measurement(parsed.value, parsed.sigma);
      std::vector<ExternalMeasurement>& readings = by_eye[parsed.eye].measurements;
      const auto is_this = [&](const ExternalMeasurement& other) {
        return other.quantity == reading.quantity && other.value == reading.value &&
               other.covariance == reading.covariance;
      };
      if (std::any_of(readings.begin(), readings.end(), is_this))
        throw usage_error(
            fmt::format("{} {} is given twice", flag, text),
            "each counts as one more reading: give it once; where two readings are alike, with its +- over 1.4");
      readings.push_back(std::move(reading));
    }
  };
  add("--keratometry", flags.keratometry, of_powers, keratometry_measurement);
  add("--axial-length", flags.axial_length, of_lengths, [&](const std::string& text, double sigma_mm) {
    return axial_length_measurement(text, sigma_mm, retinal_depth_mm);
  });
  add("--acd", flags.anterior_chamber_depth, of_lengths, anterior_chamber_measurement);
  add("--lens-thickness", flags.lens_thickness, of_lengths, lens_thickness_measurement);
  for (const std::string& text : flags.topography) {
    const EyeFlag parsed = parse_eye_flag("--topography", text, of_powers);
    auto& topography = by_eye[parsed.eye].topography;
    if (topography)
      throw usage_error(fmt::format("--topography {}: that eye has one already", text),
                        "give the better one");
    topography = {parsed.value, parsed.sigma};
    const auto other = by_eye.find(parsed.eye == Laterality::od ? Laterality::os : Laterality::od);
    if (other != by_eye.end() && other->second.topography &&
        is_same_map(other->second.topography->file, topography->file))
      throw usage_error(fmt::format("--topography {}: the map is the other eye's", text),
                        "give each eye its own");
  }
  return by_eye;
}

InstrumentReadings read_instruments(const EyeInstruments& instruments) {
  InstrumentReadings readings{instruments.measurements, {}};
  if (const auto& flag = instruments.topography) {
    try {
      readings.topography = analyse_topography(read_elevation_map(flag->file), flag->sigma_D);
    } catch (Error& error) {
      error.add_context("reading " + flag->file.string());
      throw;
    }
    readings.measurements.push_back(readings.topography->toric);
  }
  return readings;
}

namespace {

/// " (--axial-length 23.60 mm, the images 24.10 mm)"; of a cornea M, J0 and J45.
std::string both_values(const ExternalMeasurement& reading, const std::string& others,
                        const ParametricEye& by_others) {
  std::string option = reading.quantity == "anterior_chamber_depth" ? "acd" : reading.quantity;
  std::replace(option.begin(), option.end(), '_', '-');
  const auto in_words = [](const VectorXd& value) {
    return value.size() < 3
               ? fmt::format("{:.2f} mm", value[0])
               : fmt::format("M {:.2f}, J0 {:+.2f}, J45 {:+.2f} D", value[0], value[1], value[2]);
  };
  return fmt::format(" (--{} {}, {} {})", option, in_words(reading.value), others,
                     in_words(reading.of_eye(by_others)));
}

}  // namespace

std::vector<std::string> learn(UncertainEye& eye, const InstrumentReadings& readings) {
  std::vector<std::string> warnings;
  const auto add = [&](std::string warning) {
    if (!warning.empty()) warnings.push_back(std::move(warning));
  };
  const UncertainEye by_images = eye;
  if (readings.topography) add(alignment_warning(*readings.topography));
  for (const ExternalMeasurement& measurement : readings.measurements) {
    const ParametricEye before = eye.eye();
    UncertainEye of_images_alone = by_images;
    const double from_images_sigma = of_images_alone.learn(measurement),
                 from_all_sigma = eye.learn(measurement);
    // What the images contradict less, another reading does more.
    const bool is_of_images = from_images_sigma >= from_all_sigma;
    add(judge_innovation(
        {measurement.source, std::max(from_images_sigma, from_all_sigma),
         both_values(measurement, others_of(is_of_images), is_of_images ? by_images.eye() : before),
         is_of_images}));
  }
  return warnings;
}

ExternalMeasurement keratometry_measurement(const std::string& text, double sigma_D) {
  const auto slash = text.find('/');
  if (slash == std::string::npos) throw misread("--keratometry", text, "POWER@AXIS/POWER@AXIS");
  const Meridian a = parse_meridian(text.substr(0, slash)), b = parse_meridian(text.substr(slash + 1));
  const double off_square_deg = std::abs(std::abs(normalise_axis_deg(a.axis_deg - b.axis_deg)) - 90);
  if (off_square_deg > 5)
    throw usage_error(fmt::format("--keratometry {}: the meridians are {:g} degrees from perpendicular", text,
                                  off_square_deg),
                      "give the flat and the steep meridian, 90 degrees apart");
  const Meridian& flat = a.power_D <= b.power_D ? a : b;
  const Meridian& steep = a.power_D <= b.power_D ? b : a;
  const double half = (steep.power_D - flat.power_D) / 2;
  // Both tell the axis: the flat meridian's own, and that square to the steep one.
  const double turn_deg = std::remainder(steep.axis_deg - 90 - flat.axis_deg, 180),
               flat_deg = flat.axis_deg + turn_deg / 2;
  // Mean and half difference of two independent powers: sigma/sqrt 2 each; the second astigmatic component
  // alike.
  return {"keratometry",
          [](const ParametricEye& eye) -> VectorXd {
            const CornealPower power = corneal_power(anterior_cornea(eye));
            return Vector3d(power.M_D, power.J0_D, power.J45_D);
          },
          Vector3d((flat.power_D + steep.power_D) / 2, half * std::cos(2 * flat_deg * degree),
                   half * std::sin(2 * flat_deg * degree)),
          Matrix3d::Identity() * sigma_D* sigma_D / 2};
}

ExternalMeasurement axial_length_measurement(const std::string& text, double sigma_mm,
                                             double retinal_depth_mm) {
  return biometry(
      "axial_length", [=](const ParametricEye& eye) { return one(eye.pole_depth_mm() + retinal_depth_mm); },
      checked("--axial-length", text, 14, 40, "mm"), sigma_mm);
}

ExternalMeasurement anterior_chamber_measurement(const std::string& text, double sigma_mm) {
  return biometry(
      "anterior_chamber_depth", [](const ParametricEye& eye) { return one(lens_on_axis(eye).front_mm); },
      checked("--acd", text, 1, 7, "mm"), sigma_mm);
}

ExternalMeasurement lens_thickness_measurement(const std::string& text, double sigma_mm) {
  return biometry(
      "lens_thickness",
      [](const ParametricEye& eye) {
        const LensOnAxis lens = lens_on_axis(eye);
        return one(lens.back_mm - lens.front_mm);
      },
      checked("--lens-thickness", text, 2, 8, "mm"), sigma_mm);
}

}  // namespace emmetrope
