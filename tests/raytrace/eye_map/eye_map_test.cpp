#include "raytrace/eye_map/eye_map.hpp"

#include <gtest/gtest.h>

#include <iostream>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope::raytrace {
namespace {

EyeStates states_of(const std::string& name, double largest_D) {
  return {[name](double accommodation_D) {
            EyeOptions options;
            options.accommodation_D = accommodation_D;
            return make_eye(name, options);
          },
          largest_D};
}

TEST(EyeMap, ComesNearExactRaysInEveryState) {
  EyeMapSettings settings;
  settings.threads = 2;
  for (const auto& [name, largest_D] : {std::pair{"navarro", 8.0}, {"arizona", 0.0}, {"gullstrand", 0.0}, {"liou-brennan", 0.0}, {"atchison:-4", 0.0}, {"le-grand", 6.}}) 
   for (double p : {4., 6.,7.}){
    settings.pupil_mm = p;
    try { const EyeMap map = make_eye_map(states_of(name, largest_D), settings);
    std::cerr << name << ": " << map.note() << "\n"; } catch (const Error& e) { std::cerr << name << " " << e.what() << "\n"; }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
