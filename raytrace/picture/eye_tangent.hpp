#pragma once
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::raytrace {

/// A parameter by which the image is differentiated: the eye with the parameter a little above and a little
/// below where the image is wanted. Any parameter will do, of the spectacle, the eye's surfaces on either
/// side of the stop, its media or its retina, as long as rays move smoothly with it.
struct EyeTangent {
  EyeModel ahead, behind;
  double step = 1;  ///< the parameter's difference between the two
};

}  // namespace emmetrope::raytrace
