#include "pipeline/follow/visits.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/date_time/gregorian/gregorian.hpp>
#include <cmath>
#include <set>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/case_scans.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/report/case/series.hpp"
#include "pipeline/report/comparison.hpp"
#include "pipeline/report/dicom/source_study.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "pipeline/report/stage.hpp"

namespace emmetrope::follow {
namespace {

namespace fs = std::filesystem;

constexpr double days_in_a_year = 365.25;

std::optional<boost::gregorian::date> calendar_date(const std::string& date) {
  try {
    return date.empty() ? std::nullopt : std::optional(boost::gregorian::from_simple_string(date));
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

/// Nothing where one of the dates is not known.
std::optional<double> years_between(const std::string& earlier, const std::string& later) {
  const auto first = calendar_date(earlier), second = calendar_date(later);
  if (!first || !second) return std::nullopt;
  return static_cast<double>((*second - *first).days()) / days_in_a_year;
}

/// --years against the dates of the studies. One date for both is an anonymiser's, or two visits of one day.
/// \throw Error (usage) where other dates contradict
void compare_with_dates(Visits& visits) {
  constexpr double least_years = 0.1, share = 0.1;  // chosen: of what a reader rounds
  for (std::size_t i = 1; i < visits.cases.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const double given = visits.years[i] - visits.years[k];
      const auto dated = years_between(visits.dates[k], visits.dates[i]);
      if (!dated || std::abs(given - *dated) <= std::max(least_years, share * *dated)) continue;
      if (*dated != 0)
        throw usage_error(
            fmt::format("--years: visit {} is {:.2f} years after visit {}, by the dates of their studies "
                        "{:.2f} ({} and {})",
                        i + 1, given, k + 1, *dated, visits.dates[k], visits.dates[i]),
            "give the years that lie between the visits, or leave --years out");
      visits.doubts.push_back(fmt::format(
          "By --years visit {} is {:.2f} years after visit {}, by their studies both were on {}: the "
          "growth is that of --years.",
          i + 1, given, k + 1, visits.dates[i]));
    }
}

/// A case that tells a day which no calendar has does not tell when the visit was, and is not one without a date either.
/// \throw Error (input_invalid) naming it
void require_possible_dates(const Visits& visits) {
  for (std::size_t i = 0; i < visits.cases.size(); ++i)
    if (const std::string told = visits.cases[i].told_study_date(); !told.empty() && visits.dates[i].empty())
      throw input_error("the date \"" + told + "\" of a visit is none", "give --years");
}

/// What another version makes of the same images would pass for growth.
void compare_versions(Visits& visits) {
  std::set<std::string> versions;
  for (const report::CaseData& data : visits.cases)
    if (const report::StageData* stage = data.stage("segmentation"))
      versions.insert(stage->provenance.value("version", Json()).dump());
  if (versions.size() > 1)
    visits.doubts.push_back(fmt::format(
        "The visits were segmented by different versions of Emmetrope ({}): what these differ by would "
        "pass for growth; segment all by one.",
        fmt::join(versions, ", ")));
}

void set_years(Visits& visits, const std::vector<double>& years) {
  const std::size_t count = visits.cases.size();
  if (years.empty()) require_possible_dates(visits);
  if (!years.empty()) {
    if (years.size() != count)
      throw usage_error(fmt::format("--years: {} {} for {} visits", years.size(),
                                    years.size() == 1 ? "number" : "numbers", count),
                        "give one number a visit, the first visit first, such as --years 0,1.1");
    for (const double year : years) visits.years.push_back(year - years.front());
    visits.are_dated = true;
    compare_with_dates(visits);
  } else if (std::none_of(visits.dates.begin(), visits.dates.end(),
                          [](const std::string& date) { return date.empty(); })) {
    for (const std::string& date : visits.dates) {
      const auto years = years_between(visits.dates.front(), date);
      if (!years) throw input_error("the date \"" + date + "\" of a visit is none", "give --years");
      visits.years.push_back(*years);
    }
    visits.are_dated = true;
  } else if (count == 2) {
    visits.years = {0, 1};
  } else {
    throw input_error("when the visits were is not known: their studies are not at hand, or have no date",
                      "give --years, such as --years 0,1.1,2.0");
  }
  constexpr double half_a_day = 0.5 / 365;
  for (std::size_t i = 1; i < count; ++i) {
    const double apart = visits.years[i] - visits.years[i - 1];
    if (std::abs(apart) < half_a_day)
      throw input_error(fmt::format("visits {} and {} are of one day, in which no eye grows", i, i + 1),
                        "name visits of other days; --years tells when they were");
    if (!(apart > 0))
      throw input_error(fmt::format("visit {} is not after visit {}", i + 1, i),
                        "name the first visit first");
  }
}

/// By what segmentation noted of two studies.
/// \throw Error (input_invalid) where they are one, or of two persons; (usage) where --years contradict the ages
void require_one_person(const Visits& visits, std::size_t k, std::size_t i) {
  constexpr double age_tolerance_years = 3;  // whole years, some typed in before the visit
  constexpr double capped_years = 89;        // what is older is made that old where names are taken out
  const auto subject = [&](std::size_t visit) {
    return visits.cases[visit].case_json.value("subject", Json::object());
  };
  const std::string visits_named = fmt::format("visits {} and {}", k + 1, i + 1);
  if (visits.cases[i].subject() == visits.cases[k].subject() && visits.cases[i].subject() != "unknown")
    throw input_error(visits_named + " were made from one study (" + visits.cases[i].subject() + ")",
                      "name one case a visit");
  // The same errors in both would pass for growth that is known.
  if (share_a_scan(visits.cases[i].case_json, visits.cases[k].case_json))
    throw input_error(
        visits_named + " are one scan: their images have the same matrix, least, largest and mean value",
        "name one case a visit");
  const std::string sex = subject(i).value("sex", ""), sex_before = subject(k).value("sex", "");
  if ((sex == "F" && sex_before == "M") || (sex == "M" && sex_before == "F"))
    throw input_error(
        fmt::format("{} are of two persons: by (0010,0040) PatientSex of their studies {} and {}",
                    visits_named, sex_before, sex),
        "name cases of one person");
  const auto age = report::value_at(subject(i), "/age_years"),
             age_before = report::value_at(subject(k), "/age_years");
  const auto dated = years_between(visits.dates[k], visits.dates[i]);
  const bool do_dates_tell = dated && *dated != 0;
  if (!age || !age_before || std::max(*age, *age_before) >= capped_years ||
      (!visits.are_dated && !do_dates_tell))
    return;
  const double apart = do_dates_tell ? *dated : visits.years[i] - visits.years[k];
  if (std::abs(*age - *age_before - apart) <= age_tolerance_years) return;
  const std::string ages = fmt::format("{:.0f} and {:.0f} years old", *age_before, *age);
  if (!do_dates_tell)
    throw usage_error(
        fmt::format("--years: {} are {:.1f} years apart, and of patients {}", visits_named, apart, ages),
        "give the years that lie between the visits, or name cases of one person");
  throw input_error(fmt::format("{} are of two persons: {}, {:.1f} years apart", visits_named, ages, apart),
                    "name cases of one person");
}

/// fit.json of an eye, or null.
Json fit_of(const report::CaseData& data, Laterality eye) {
  const auto found = std::find_if(data.eyes.begin(), data.eyes.end(),
                                  [&](const report::EyeData& one) { return one.laterality == eye; });
  return found == data.eyes.end() ? Json() : found->fit;
}

/// shared_error of a fit.json; null: not known.
/// \throw Error (input_invalid) naming file and key where it is no symmetric matrix by parameters' names
Json shared_error_in(const Json& fit, const fs::path& file) {
  const auto require = [&](bool is_so, const std::string& key, const Json& found, const char* expected) {
    if (!is_so)
      throw input_error(
          fmt::format("{}: {} is {}, expected {}", file.string(), key, found.dump().substr(0, 60), expected),
          "run emmetrope segment again with --force");
  };
  const std::string key = "shared_error";
  Json shared = fit.value(key, Json());
  if (shared.is_null()) return shared;
  require(shared.is_object(), key, shared, "an object or null");
  const Json images = shared.value("images", Json()), covariance = shared.value("covariance", Json());
  require(images.is_string(), key + "/images", images, "what the images are");
  require(covariance.is_object(), key + "/covariance", covariance, "rows by a parameter's name");
  for (const auto& [name, row] : covariance.items())
    require(row.is_object(), fmt::format("{}/covariance/{}", key, name), row,
            "numbers by a parameter's name");
  for (const auto& [name, row] : covariance.items())
    for (const auto& [other, number] : row.items()) {
      const std::string place = fmt::format("{}/covariance/{}/{}", key, name, other);
      require(number.is_number(), place, number, "a number in mm^2");
      require(covariance.value(other, Json::object()).value(name, Json()) == number, place, number,
              "that of the two names the other way round");
    }
  return shared;
}

/// Images and field that an eye was fitted to: "T1, dark fat, 3 T"; empty where that is not told, or whether others share
/// an error with it.
/// \param shared  its shared_error
std::string images_of(const report::CaseData& data, const Json& fit, const Json& shared) {
  if (shared.is_null()) return {};
  const Json contrast = fit.value("contrast", Json());
  std::set<double> fields_T;
  for (const report::Series& series : report::used_series(data))
    if (Json(series.contrast) == contrast) fields_T.insert(series.field_strength_T);
  if (fields_T.size() != 1 || !(*fields_T.begin() > 0)) return {};
  return fmt::format("{}, {:g} T", shared.at("images").get<std::string>(), *fields_T.begin());
}

/// Where one visit says of this error what cannot be, it stays in all: their growth would have it in part.
void take_out_shared_errors(std::vector<ParametricEye>& fitted, const std::vector<Json>& shared_errors,
                            Laterality eye, std::vector<std::string>& doubts) {
  std::vector<ParametricEye> without;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    try {
      without.push_back(without_shared_error(fitted[i], shared_errors[i].at("covariance")));
    } catch (const Error& error) {
      doubts.push_back(fmt::format(
          "{}: at visit {} {}: what the images of all visits err by alike stays in the intervals of growth, "
          "which are wider for it.",
          clinical_name(eye), i + 1, error.what()));
      return;
    }
  }
  fitted = std::move(without);
}

}  // namespace

ParametricEye without_shared_error(ParametricEye eye, const Json& shared) {
  const std::string remedy = "segment the study again";
  const auto place_of = [&](const std::string& name) {
    const auto at = std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name);
    if (at == eye.parameter_names.end())
      throw input_error("shared_error of its fit.json has " + name + ", the eye has not", remedy);
    return at - eye.parameter_names.begin();
  };
  for (const auto& [name, row] : shared.items())
    for (const auto& [other, number] : row.items())
      eye.covariance(place_of(name), place_of(other)) -= number.get<double>();
  const Eigen::VectorXd left = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(eye.covariance).eigenvalues();
  constexpr double rounding = 1e-9;
  if (left.size() > 0 && left.minCoeff() < -rounding * left.cwiseAbs().maxCoeff())
    throw input_error("shared_error of its fit.json is more than the eye's own covariance", remedy);
  return eye;
}

Visits read_visits(const std::vector<fs::path>& cases, const std::vector<double>& years,
                   LateralityChoice eyes) {
  report::quiet_dicom_library();
  Visits visits;
  std::vector<std::optional<report::SourceStudy>> sources;
  for (const fs::path& folder : cases) {
    visits.cases.push_back(report::read_case(folder, eyes, report::CaseExtent::until_meshing));
    read_verdict(folder, "meshing");  // finished, and of one piece
    sources.push_back(report::source_study_of(visits.cases.back()));
    visits.dates.push_back(sources.back() ? report::study_date_of(visits.cases.back(), *sources.back())
                                          : visits.cases.back().study_date());
  }
  // Each with each: the first may say least of its patient.
  for (std::size_t i = 1; i < cases.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const report::PatientsRemark remark = report::patients_of(sources[k], sources[i]);
      std::vector<std::string>& list = remark.is_doubt ? visits.doubts : visits.remarks;
      if (std::find(list.begin(), list.end(), remark.text) == list.end()) list.push_back(remark.text);
    }
  set_years(visits, years);
  compare_versions(visits);
  for (std::size_t i = 1; i < cases.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) require_one_person(visits, k, i);
  return visits;
}

EyeAtVisits eye_at_visits(const Visits& visits, Laterality eye) {
  EyeAtVisits followed;
  std::vector<ParametricEye> fitted;
  std::vector<Json> shared_errors;
  std::set<std::string> images;
  for (std::size_t i = 0; i < visits.cases.size(); ++i) {
    const report::CaseData& data = visits.cases[i];
    const Json fit = fit_of(data, eye);
    const bool is_there = fit.is_object() && fit.contains("eye");
    const Json withheld = is_there ? fit.value("withheld", Json::object()) : Json::object();
    if (!is_there || withheld.contains("fit") || withheld.contains("front")) {
      followed.reason = fmt::format("visit {}: {}", i + 1,
                                    !is_there                  ? "this eye was not fitted"
                                    : withheld.contains("fit") ? "the fit of this eye is withheld"
                                                               : "the front of this eye is withheld");
      return followed;
    }
    fitted.push_back(parametric_eye_from_json(fit.at("eye")));
    shared_errors.push_back(shared_error_in(fit, data.folder / "segmentation" / to_string(eye) / "fit.json"));
    images.insert(images_of(data, fit, shared_errors.back()));
  }
  if (images.size() == 1 && !images.begin()->empty())
    take_out_shared_errors(fitted, shared_errors, eye, followed.doubts);
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    const auto& names = fitted[i].parameter_names;
    if (!std::is_permutation(names.begin(), names.end(), fitted[0].parameter_names.begin(),
                             fitted[0].parameter_names.end()))
      followed.doubts.push_back(fmt::format(
          "{}: the fit of visit {} has other parameters than that of visit 1 (a cornea of free form?): "
          "growth is of those that all have.",
          clinical_name(eye), i + 1));
    followed.eyes.push_back({fitted_eye(fitted[i]), visits.years[i]});
  }
  return followed;
}

std::string why_cornea_is_withheld(const Visits& visits, Laterality eye) {
  for (std::size_t i = 0; i < visits.cases.size(); ++i) {
    const Json withheld = fit_of(visits.cases[i], eye).value("withheld", Json::object());
    if (withheld.contains("cornea"))
      return fmt::format("visit {}: {}", i + 1, withheld.at("cornea").get<std::string>());
  }
  return {};
}

std::vector<std::string> unused_readings(const Visits& visits, Laterality eye) {
  std::vector<std::string> sentences;
  for (std::size_t i = 0; i < visits.cases.size(); ++i) {
    const fs::path file = visits.cases[i].folder / "meshing" / "stage.json";
    try {
      const std::set<std::string> given =
          given_of(read_json(file).at("parameters").value("instruments", Json()), eye);
      std::string names = fmt::format("{}", fmt::join(given, ", "));
      std::replace(names.begin(), names.end(), '_', ' ');
      if (!names.empty())
        sentences.push_back(
            fmt::format("{}: {} by other instruments at visit {}: not used, growth is of the images alone.",
                        clinical_name(eye), names, i + 1));
    } catch (const Json::exception& fault) {
      throw input_error(file.string() + ": " + fault.what(), "run emmetrope mesh again with --force");
    }
  }
  return sentences;
}

}  // namespace emmetrope::follow
