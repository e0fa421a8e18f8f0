#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/report/content/judgement.hpp"

/// What a busy reader takes from the first page in ten seconds.
namespace emmetrope::report {

/// The answer in one line with its uncertainty: a lens where the spherical equivalent is known to a dioptre, else the
/// spherical equivalent with its interval and what follows. Empty without a refraction.
std::string headline_of(const EyeData& eye, const Judgement& judgement);

/// Whether the cylinder's interval leaves one: else it has no axis, here and in every table and sentence.
bool has_axis(const Json& cylinder_D);

/// `text` with the wavelength put in where the prescription is of another light than refractions are (sodium's); else
/// nothing.
std::string light_of(const Json& prescription, const std::string& text);
/// " (of 589.3 nm)": refractions that are given are
std::string sodium_light();

/// What a given refraction made of the lens index; nothing where none was given, or where the index was known.
std::optional<Measured> given_lens_index(const EyeData& eye);

/// Beside the verdict: axial length, what limits the result, the images, what is assumed.
std::vector<std::pair<std::string, std::string>> facts_of(const EyeData& eye, const Judgement& judgement);

/// The one thing to do for this eye.
std::string next_step(const EyeData& eye, const Judgement& judgement);

/// Numbers that do not seem to fit together, each with what explains it.
std::vector<std::string> what_explains(const CaseData& data);

}  // namespace emmetrope::report
