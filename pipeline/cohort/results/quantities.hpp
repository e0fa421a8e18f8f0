#pragma once
#include <string>
#include <vector>

namespace emmetrope::cohort {

/// A number of an eye that the table of a cohort has: four columns, value, ends of the 95 % interval and source.
struct Quantity {
  std::string column;  ///< "retina_q_240"
  std::string stage;   ///< folder of the case: "meshing"
  std::string file;    ///< below its folder of the eye
  std::string key;     ///< JSON pointer in it
  std::string unit;    ///< "mm", "D", "deg", "mm2", "mm3", or empty
  std::string description;
};
const std::vector<Quantity>& quantities();

}  // namespace emmetrope::cohort
