#include "pipeline/base/version.hpp"

namespace emmetrope {

std::string version() { return EMMETROPE_VERSION; }

}  // namespace emmetrope
