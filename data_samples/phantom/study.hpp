#pragma once
#include <filesystem>
#include <vector>

#include "data_samples/phantom/render.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/progress.hpp"

namespace emmetrope::phantom {

enum class Compression { none, jpeg_lossless, jpeg_ls };

/// Unique identifiers of a study; the same parameters give the same ones, so that a study can be made again.
struct StudyIdentity {
  std::string parameters;  ///< all that decides the images, as text
  double age_years = 40;
  std::string uid(const std::string& of_what) const;  ///< "2.25.<128 bits of SHA-256>"
};

/// Writes one stack as a series of classic MR Image Storage objects, FOLDER/0001.dcm onwards.
/// \param series_number  from 1
/// \throw Error (not_writable)
void write_series(const std::filesystem::path& folder, const RenderedStack& stack, int series_number,
                  const StudyIdentity& identity, Compression compression);

/// What is to be made.
struct StudyRequest {
  HeadGeometry head;
  Protocol protocol;
  Compression compression = Compression::none;
};

/// Renders all stacks and writes OUT/dicom/<stack>/*.dcm and OUT/truth.json; OUT appears whole or not at all.
/// \param replace  an earlier phantom study at OUT gives way
/// \return truth.json
/// \throw Error (not_writable) when OUT exists and is not to be replaced, or is no phantom study
Json write_study(const std::filesystem::path& out, const StudyRequest& request, bool replace, int threads,
                 Verbosity verbosity);

}  // namespace emmetrope::phantom
