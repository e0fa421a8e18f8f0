#include "pipeline/follow/visits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/date_time/gregorian/gregorian.hpp>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/report/comparison.hpp"
#include "pipeline/report/dicom/source_study.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "pipeline/report/stage.hpp"

namespace emmetrope::follow {
namespace {

namespace fs = std::filesystem;

constexpr double days_in_a_year = 365.25;

boost::gregorian::date calendar_date(const std::string& date) {
  try {
    return boost::gregorian::from_simple_string(date);
  } catch (const std::exception&) {
    throw input_error("the date \"" + date + "\" of a visit is none", "give --years");
  }
}

void set_years(Visits& visits, const std::vector<double>& years) {
  const std::size_t count = visits.cases.size();
  if (!years.empty()) {
    if (years.size() != count)
      throw usage_error(fmt::format("--years: {} numbers for {} visits", years.size(), count), "one a visit");
    for (const double year : years) visits.years.push_back(year - years.front());
    visits.are_dated = true;
  } else if (std::none_of(visits.dates.begin(), visits.dates.end(),
                          [](const std::string& date) { return date.empty(); })) {
    for (const std::string& date : visits.dates)
      visits.years.push_back(
          static_cast<double>((calendar_date(date) - calendar_date(visits.dates.front())).days()) /
          days_in_a_year);
    visits.are_dated = true;
  } else if (count == 2) {
    visits.years = {0, 1};
  } else {
    throw input_error("when the visits were is not known: their studies are not at hand, or have no date",
                      "give --years, such as --years 0,1.1,2.0");
  }
  for (std::size_t i = 1; i < count; ++i)
    if (!(visits.years[i] > visits.years[i - 1]))
      throw input_error(fmt::format("visit {} is not after visit {}", i + 1, i),
                        "name the first visit first");
}

}  // namespace

Visits read_visits(const std::vector<fs::path>& cases, const std::vector<double>& years,
                   LateralityChoice eyes) {
  report::quiet_dicom_library();
  Visits visits;
  std::vector<std::optional<report::SourceStudy>> sources;
  for (const fs::path& folder : cases) {
    read_verdict(folder, "meshing");  // finished, and of one piece
    visits.cases.push_back(report::read_case(folder, eyes));
    sources.push_back(report::source_study_of(visits.cases.back()));
    visits.dates.push_back(sources.back() ? report::study_date_of(visits.cases.back(), *sources.back())
                                          : visits.cases.back().study_date());
  }
  // Each with each: the first may say least of its patient.
  for (std::size_t i = 1; i < cases.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const std::string remark = report::patients_of(sources[k], sources[i]);
      if (std::find(visits.remarks.begin(), visits.remarks.end(), remark) == visits.remarks.end())
        visits.remarks.push_back(remark);
    }
  set_years(visits, years);
  return visits;
}

std::vector<EyeAtVisit> eyes_of(const Visits& visits, Laterality eye, std::string& reason) {
  std::vector<EyeAtVisit> eyes;
  for (std::size_t i = 0; i < visits.cases.size(); ++i) {
    const report::CaseData& data = visits.cases[i];
    const auto found = std::find_if(data.eyes.begin(), data.eyes.end(),
                                    [&](const report::EyeData& one) { return one.laterality == eye; });
    const bool is_there = found != data.eyes.end() && found->fit.is_object() && found->fit.contains("eye");
    const Json withheld = is_there ? found->fit.value("withheld", Json::object()) : Json::object();
    if (!is_there || withheld.contains("fit") || withheld.contains("front")) {
      reason = fmt::format("visit {}: {}", i + 1,
                           !is_there                  ? "this eye was not fitted"
                           : withheld.contains("fit") ? "the fit of this eye is withheld"
                                                      : "the front of this eye is withheld");
      return {};
    }
    eyes.push_back({fitted_eye(parametric_eye_from_json(found->fit.at("eye"))), visits.years[i]});
  }
  return eyes;
}

}  // namespace emmetrope::follow
