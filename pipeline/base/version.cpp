#include "pipeline/base/version.hpp"

#include "version_text.hpp"

namespace emmetrope {

std::string version() { return EMMETROPE_VERSION; }

}  // namespace emmetrope
