#include "pipeline/report/content/content.hpp"

#include "pipeline/base/version.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/document/numbers.hpp"

namespace emmetrope::report {

Document make_document(const CaseData& data, const ContentOptions& options, Notes& notes) {
  Document document;
  document.title = "Emmetrope eye report";
  document.date_iso = options.study_date;
  if (!options.identity.empty()) document.heading.emplace_back("Patient", options.identity);
  document.heading.emplace_back("Subject", data.subject());
  if (!document.date_iso.empty()) document.heading.emplace_back("Study date", document.date_iso);
  if (const auto age = data.age_years()) document.heading.emplace_back("Age", age_text(*age));
  document.heading.emplace_back("Software", "Emmetrope " + version());

  Citations citations;
  document.sections.push_back(result_section(data));
  document.sections.push_back(measured_section(data, citations));
  document.sections.push_back(images_section(data, notes));
  document.sections.push_back(cornea_section(data, notes));
  document.sections.push_back(retina_section(data, notes));
  document.sections.push_back(optics_section(data, notes, citations));
  document.sections.push_back(correction_section(data, notes));
  document.sections.push_back(peripheral_section(data));
  document.sections.push_back(lenses_section(data));
  document.sections.push_back(limits_section(data, notes));
  document.sections.push_back(methods_section(data, citations));
  document.sections.push_back(provenance_section(data));
  document.sections.push_back(review_section());
  const auto is_empty = [](const Section& section) { return section.blocks.empty(); };
  document.sections.erase(std::remove_if(document.sections.begin(), document.sections.end(), is_empty),
                          document.sections.end());
  return document;
}

}  // namespace emmetrope::report
