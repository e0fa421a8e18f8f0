#pragma once
#include <string>

#include "pipeline/base/json.hpp"
#include "raytrace/tracer/tracer.hpp"

/// What is said of one eye's picture.
namespace emmetrope::raytrace {

/// On standard error: a blank picture, rays lost in the eye, more noise than was asked for.
void warn_of_doubts(const TraceResult& result, const TraceSettings& settings);

/// What a pixel is in the picture's middle, on the retina and as an angle of the scene, and in what pixels are
/// equidistant; null where the eye sees nothing there.
Json scale_of(const EyeModel& eye, const TraceSettings& settings);

/// Rays, time, device, scale of the pixels.
/// \param image  where the picture is
Json picture_json(const TraceResult& result, const std::string& image, const EyeModel& eye,
                  const TraceSettings& settings);

/// The same in a line of text.
std::string picture_line(const std::string& eye, const Json& picture);

}  // namespace emmetrope::raytrace
