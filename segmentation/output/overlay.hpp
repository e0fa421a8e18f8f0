#pragma once
#include <filesystem>
#include <optional>

#include "segmentation/edges/edge_reader.hpp"
#include "segmentation/fit/eye_fit.hpp"
#include "segmentation/judgement/quality.hpp"

namespace emmetrope::segmentation {

/// Edges whose numbers are told.
struct ToldEdges {
  EdgeReading reading;
  Eigen::Vector3d shift = {0, 0, 0};  ///< from where it was read to where the picture's stack has it, LPS mm
  bool with_axis = true;              ///< length, chamber and lens too
};

/// What of an eye's numbers are not its fit's.
struct OverlayNotes {
  Withholds withheld = Withholds::nothing;  ///< of the fit
  std::optional<ToldEdges> edges = {};      ///< told instead
};

/// Six slices of a stack through the eye, cropped to it, with the fitted borders in colour: cornea cyan, iris
/// violet, lens orange, inner wall green, outer wall yellow; in red what lies in the vitreous and is none. Borders
/// that are withheld are grey; of edges that are told instead the globe is blue, crosses lie on its axis, and the
/// slices say so.
/// \throw Error (not_writable)
void write_overlay(const std::filesystem::path& file, const EyeFit& fit, std::size_t view,
                   const OverlayNotes& notes = {});

/// The same of a stack that the eye was not fitted to.
/// \param shift  a point of it plus this is where it lies in the first stack of the fit, LPS mm
void write_overlay(const std::filesystem::path& file, const EyeFit& fit, const Stack& other,
                   const Eigen::Vector3d& shift, const OverlayNotes& notes = {});

/// The same of an eye that no fit was made of.
void write_edge_overlay(const std::filesystem::path& file, const Stack& stack, const ToldEdges& edges);

/// The same slices with the standardised residual (image minus model) of every voxel that was used: blue
/// below -4, red above 4 sigma, white none.
void write_residuals(const std::filesystem::path& file, const EyeFit& fit, std::size_t view);

/// Slices through a place where no eye could be fitted, without contours.
void write_plain(const std::filesystem::path& file, const Stack& stack, const Eigen::Vector3d& centre);

}  // namespace emmetrope::segmentation
