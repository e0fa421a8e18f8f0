#include "segmentation/intake/weighting.hpp"

#include <gtest/gtest.h>

namespace emmetrope::segmentation {
namespace {

struct Sequence {
  const char* name;
  SequenceTimes times;
  std::optional<Weighting> told;
};

/// Times as vendors' protocols of orbit and head have them.
TEST(WeightingByTimes, IsToldWhereTheyLeaveNoDoubt) {
  for (const Sequence& sequence : std::initializer_list<Sequence>{
           {"MPRAGE at 3 T", {2300, 2.98, 900, 9}, Weighting::t1},
           {"MPRAGE at 1.5 T", {2400, 3.6, 1000, 8}, Weighting::t1},
           {"BRAVO", {8.2, 3.2, 450, 12}, Weighting::t1},
           {"spin echo", {500, 10, {}, 90}, Weighting::t1},
           {"turbo spin echo, refocused by 150 degrees", {650, 12, {}, 150}, Weighting::t1},
           {"turbo spin echo", {4000, 91, {}, 150}, Weighting::t2},
           {"SPACE", {3200, 408, {}, 120}, Weighting::t2},
           {"STIR", {4500, 66, 160, 150}, Weighting::t2},
           {"FLAIR", {9000, 90, 2500, 150}, {}},
           {"proton density", {3000, 12, {}, 150}, {}},
           {"CISS", {5.5, 2.4, {}, 50}, {}},
           {"T2* by gradient echoes", {600, 13, {}, 30}, {}},
           {"MP2RAGE, second inversion", {5000, 2.98, 2500, 5}, {}},
           {"spoiled gradient echo", {20, 4.6, {}, 25}, {}},
           {"echo time alone", {{}, 91, {}, {}}, {}},
           {"FLAIR, its inversion time not told", {9000, 90, {}, 150, "SE\\IR"}, {}},
           {"TrueFISP in one slice, whose repetition is the shot's", {400, 1.5, {}, 70, "GR"}, {}},
           {"MPRAGE, all told", {2300, 2.98, 900, 9, "GR\\IR"}, Weighting::t1},
           {"turbo spin echo, all told", {4000, 91, {}, 150, "SE"}, Weighting::t2},
           {"nothing", {}, {}}})
    EXPECT_EQ(weighting_by_times(sequence.times), sequence.told) << sequence.name;
}

}  // namespace
}  // namespace emmetrope::segmentation
