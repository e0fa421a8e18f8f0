#pragma once
#include <string>

#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/references.hpp"
#include "pipeline/report/document/document.hpp"

namespace emmetrope::report {

struct ContentOptions {
  /// "Name, born 1961-02-03" from the study's header; empty: pseudonymous.
  std::string identity;
  std::string study_date;  ///< YYYY-MM-DD, or empty
};

/// What could not be drawn or written, in words; costs a figure, never the report.
using Notes = std::vector<std::string>;

/// The whole report of a case.
Document make_document(const CaseData& data, const ContentOptions& options, Notes& notes);

// Its sections, in the order in which they are read.
Section result_section(const CaseData& data);
Section measured_section(const CaseData& data, Citations& citations);
Section images_section(const CaseData& data, Notes& notes);
Section cornea_section(const CaseData& data, Notes& notes);
Section retina_section(const CaseData& data, Notes& notes);
Section optics_section(const CaseData& data, Notes& notes, Citations& citations);
Section correction_section(const CaseData& data, Notes& notes);
Section peripheral_section(const CaseData& data);
Section lenses_section(const CaseData& data);
Section limits_section(const CaseData& data, const Notes& notes);
/// \param citations  of the sections before; it lists them
Section methods_section(const CaseData& data, Citations& citations);
Section review_section();
Section provenance_section(const CaseData& data);

/// Where on the retina the refractions are of, for a sentence: "on the eye's own axis".
std::string refracted_point(const CaseData& data);

/// The pupil that wavefront and pictures are of, which may be another than the refraction's: "an iris aperture of 4.0 mm".
std::string traced_pupil(const CaseData& data);

/// Through what the pictures of the trace stage were seen: "a spectacle of -2.25 DS at 12 mm"; empty: nothing. Wavefronts
/// are of the eye alone.
std::string worn_while_traced(const CaseData& data);

/// What the rows of letters are of the chart that was traced, a sentence with a space before it; empty of another scene.
std::string chart_rows(const CaseData& data);

/// Letters as each eye would see them at the estimate and at the end of its interval; none where that is narrow.
FigureRow letters_at_the_ends(const CaseData& data);

}  // namespace emmetrope::report
