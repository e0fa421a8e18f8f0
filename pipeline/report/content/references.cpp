#include "pipeline/report/content/references.hpp"

#include <algorithm>
#include <iterator>

#include "pipeline/base/error.hpp"

namespace emmetrope::report {
namespace {

struct Reference {
  const char* cited_as;
  const char* text;
};
constexpr Reference references[] = {
    {"Wei et al. 2014",
     "Wei Q, Patkar S, Pai DK. Fast ray-tracing of human eye optics on graphics processing units. "
     "Computer Methods and Programs in Biomedicine 2014;114:302-314."},
    {"Thibos et al. 1997",
     "Thibos LN, Wheeler W, Horner D. Power vectors: an application of Fourier analysis to the "
     "description and statistical analysis of refractive error. Optometry and Vision Science "
     "1997;74:367-375."},
    {"ANSI Z80.28", "ANSI Z80.28: Methods for reporting optical aberrations of eyes."},
    {"Dubbelman and van der Heijde 2001, index",
     "Dubbelman M, van der Heijde GL. The shape of the aging human lens: curvature, equivalent "
     "refractive index and the lens paradox. Vision Research 2001;41:1867-1877 (lens index)."},
    {"Hoffmann and Huetz 2010",
     "Hoffmann PC, Huetz WW. Analysis of biometry and prevalence data for corneal astigmatism in 23,239 "
     "eyes. Journal of Cataract and Refractive Surgery 2010;36:1479-1485."},
    {"BMC Ophthalmology 2021;21",
     "Distribution of ocular biometric parameters in 28,709 adult cataract patients in China using "
     "swept-source optical biometry. BMC Ophthalmology 2021;21 (doi 10.1186/s12886-021-01932-4)."},
    {"Dubbelman et al. 2001",
     "Dubbelman M, van der Heijde GL, Weeber HA. The thickness of the aging human lens obtained from "
     "corrected Scheimpflug images. Optometry and Vision Science 2001;78:411-416."},
    {"Dubbelman and van der Heijde 2001",
     "Dubbelman M, van der Heijde GL. Vision Research 2001;41:1867-1877, radii at 20 to 70 years; within 0.4 mm of "
     "Navarro R. Adaptive model of the aging emmetropic eye. Journal of Vision 2014;14(13):21."},
    {"Tideman et al. 2018",
     "Tideman JWL, Polling JR, Vingerling JR, Jaddoe VWV, Williams C, Guggenheim JA, Klaver CCW. Axial length growth "
     "and the risk of developing myopia in European children. Acta Ophthalmologica 2018;96:301-309."},
    {"Rauscher et al. 2021",
     "Rauscher FG et al. Ocular biometry in children and adolescents from 4 to 17 years: a cross-sectional study in "
     "central Germany. Ophthalmic and Physiological Optics 2021;41:496-511 (means); standard deviations of Kaymak H "
     "et al. Die Ophthalmologie 2022;119, Suppl. 1 (doi 10.1007/s00347-021-01427-z)."},
    {"Dodgson 2004",
     "Dodgson NA. Variation and extrema of human interpupillary distance. Proc. SPIE 2004;5291:36-46."},
    {"Handan Eye Study",
     "Corneal Q value of 1,683 adults in the Handan Eye Study (PMC5436654): mean -0.28, standard deviation 0.18, over "
     "5 mm."},
    {"BMC Ophthalmology 2024;24",
     "Radius of the steepest curvature of the retinal pigment epithelium in 268 eyes with and without posterior "
     "staphyloma. BMC Ophthalmology 2024;24 (doi 10.1186/s12886-024-03321-z)."},
    {"Watson 2013",
     "Watson AB. A formula for the mean human optical modulation transfer function as a function of "
     "pupil size. Journal of Vision 2013;13(6):18."}};

const char* reference_text(const std::string& authors_and_year) {
  const auto* found =
      std::find_if(std::begin(references), std::end(references),
                   [&](const Reference& reference) { return reference.cited_as == authors_and_year; });
  if (found == std::end(references))
    throw Error(ExitStatus::fault, "no reference is called " + authors_and_year);
  return found->text;
}

}  // namespace

int Citations::number_of(const std::string& authors_and_year) {
  reference_text(authors_and_year);
  auto found = std::find(cited_.begin(), cited_.end(), authors_and_year);
  if (found == cited_.end()) found = cited_.insert(cited_.end(), authors_and_year);
  return static_cast<int>(found - cited_.begin()) + 1;
}

std::vector<std::string> Citations::list() const {
  std::vector<std::string> list;
  for (const std::string& work : cited_)
    list.push_back(std::to_string(list.size() + 1) + ". " + reference_text(work));
  return list;
}

}  // namespace emmetrope::report
