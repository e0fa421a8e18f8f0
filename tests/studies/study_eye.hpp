#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"

/// One phantom eye of the accuracy study, fitted and written down.
namespace emmetrope::segmentation {

/// What is rendered and fitted.
struct StudyProtocol {
  std::string name = "surface-coil";  ///< surface-coil, head-t2, head-t1
  /// The second set: a scale error drawn from a normal distribution of 0.3 %, fat shifted by one pixel.
  bool distorted = false;
  bool keratoconus = false;  ///< a cone on each cornea
  double turn_deg = 0;       ///< rms per axis of the head's rotation between stacks
  double snr = 0;            ///< 0: the protocol's own
  std::string world;         ///< a phantom's world; empty: the model's own
  /// Nothing is left before a coronal plane, drawn evenly between 4 and 10 mm behind the apices: cornea and at least
  /// the lens's front are gone.
  bool defaced = false;

  /// "surface-coil", "surface-coil-distorted", "surface-coil-turned", "surface-coil-keratoconus": how records
  /// are named.
  std::string label() const {
    return name + (keratoconus ? "-keratoconus" : "") + (distorted ? "-distorted" : "") +
           (turn_deg > 0 ? "-turned" : "") + (defaced ? "-defaced" : "") + (world.empty() ? "" : "-" + world);
  }
};

/// Both eyes of the random head `seed`: bulge, muscles, lid, coil shading, Rician noise, gaze, head shifts of
/// 0.3 mm rms per axis between stacks. The stacks are those of the protocol, cropped to 19 mm around the
/// globes. A record holds
///   "protocol", "seed", "laterality", "status" ("measured", "refused", "not found") with "reasons",
///   "fitted_again_because": why the first fit was not taken (segmentation/judgement/judged_eye.hpp), empty where it was,
///   "truth": the eye's entry in the phantom's truth.json (biometry, "refraction", "optics", "geometry"),
///   "age_years", "lens_index": true index of the lens, which images do not show,
///   "fit": fit.json's "eye" (parameters, covariance); the scale's uncertainty comes on top,
///   "bound": covariance over the same parameters if the model were exact: noise and priors alone,
///   "bound_if_known": for each group of nuisance parameters the bound's standard deviations of
///   axial length (mm) and corneal power (D) if it were known,
///   "irregular_cornea", "irregularity_chi2": whether the cornea was found irregular, and by what,
///   "stated": what `emmetrope mesh` would state of it, "verdict": "measured", "partial" or "refused",
///   "surface_mm": mean distance of the fitted "retina" (hemisphere about the pole) and "cornea" (8 mm) from
///   the true ones, "fat_shift_mm", "chi2_per_voxel", "voxels", "iterations", "start_costs", "fit_s",
///   "render_s" (processor time).
std::vector<Json> study_head(const StudyProtocol& protocol, unsigned long long seed);

/// The same from CACHE/<label>-<seed>-<eye>.json, which are made where they are missing.
/// \param make  whether they are; if not, those that are there
std::vector<Json> cached_head(const std::filesystem::path& cache, const StudyProtocol& protocol,
                              unsigned long long seed, bool make = true);

}  // namespace emmetrope::segmentation
