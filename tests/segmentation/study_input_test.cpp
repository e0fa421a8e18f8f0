#include "segmentation/study_input.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace emmetrope::segmentation {
namespace {

/// Two series of one study and frame of reference that differ in nothing, the second computed.
class ComputedSeries : public testing::Test {
 protected:
  ComputedSeries() {
    SeriesInfo info;
    info.modality = "MR";
    info.study_uid = "1.2.3";
    info.frame_of_reference_uid = "1.2.3.9";
    info.repetition_time_ms = 3000;
    info.echo_time_ms = 91;
    info.inversion_time_ms = 900;
    info.flip_angle_deg = 90;
    info.usable = true;
    study_.series = {info, info};
    computed().computed = true;
  }
  SeriesInfo& acquired() { return study_.series.front(); }
  SeriesInfo& computed() { return study_.series.back(); }
  bool is_used() const { return choose_series(study_, {}).size() == 2; }
  StudyInventory study_;
};

TEST_F(ComputedSeries, IsNotUsedBesideTheAcquisitionThatItIsOf) {
  EXPECT_FALSE(is_used());
  computed().inversion_time_ms.reset();
  computed().flip_angle_deg.reset();
  EXPECT_FALSE(is_used());
  computed().repetition_time_ms.reset();
  EXPECT_FALSE(is_used());
  computed().echo_time_ms = 92;
  EXPECT_TRUE(is_used());
}

TEST_F(ComputedSeries, IsUsedWhereNoTimesAreToldToCompare) {
  computed().repetition_time_ms.reset();
  acquired().echo_time_ms.reset();
  EXPECT_TRUE(is_used());
}

TEST_F(ComputedSeries, IsUsedWhereNoFrameOfReferenceIsTold) {
  computed().frame_of_reference_uid.clear();
  acquired().frame_of_reference_uid.clear();
  EXPECT_TRUE(is_used());
}

/// Of one acquisition: in phase, and what was made of it.
class DixonSeries : public testing::Test {
 protected:
  SeriesInfo series_of(DixonPart part, double echo_time_ms) const {
    SeriesInfo info;
    info.name = "stack" + std::to_string(study_.series.size() + 1);
    info.study_uid = "1.2.3";
    info.frame_of_reference_uid = "1.2.3.9";
    info.repetition_time_ms = 600;
    info.echo_time_ms = echo_time_ms;
    info.usable = true;
    info.dixon_part = part;
    return info;
  }
  void add(DixonPart part, double echo_time_ms = 10) {
    study_.series.push_back(series_of(part, echo_time_ms));
  }
  std::string used() const {
    std::string names;
    for (const SeriesInfo* info : choose_series(study_, {})) names += info->name + " ";
    return names;
  }
  StudyInventory study_;
};

TEST_F(DixonSeries, OfPartsOfOneSignalTheInPhaseOneIsUsed) {
  for (const DixonPart part : {DixonPart::in_phase, DixonPart::fat, DixonPart::opposed_phase}) add(part);
  add(DixonPart::water, 12);  // says another of its echoes
  EXPECT_EQ(used(), "stack1 ");
  EXPECT_THAT(why_left_out(study_.series[1], study_),
              testing::HasSubstr("fat alone, in which no eye is seen"));
  EXPECT_THAT(why_left_out(study_.series[2], study_), testing::HasSubstr("opposed in phase"));
  EXPECT_THAT(why_left_out(study_.series[3], study_), testing::HasSubstr("shows water alone, from stack1"));
  for (SeriesInfo& info : study_.series) info.computed = true;  // so some scanners call all parts
  EXPECT_EQ(used(), "stack1 ");
}

TEST_F(DixonSeries, OfWaterIsUsedBesideNoOtherOfItsContrast) {
  add(DixonPart::fat);
  add(DixonPart::opposed_phase);
  add(DixonPart::water);
  EXPECT_EQ(used(), "stack3 ");
  add(DixonPart::in_phase);
  study_.series.back().repetition_time_ms = 3000;
  EXPECT_EQ(used(), "stack3 stack4 ");
  add(DixonPart::all);
  EXPECT_EQ(used(), "stack4 stack5 ");
}

TEST_F(DixonSeries, OfWaterThatWasReformattedIsNotUsedBesideTheAcquiredOne) {
  add(DixonPart::water);
  add(DixonPart::water);
  study_.series.back().computed = true;
  EXPECT_EQ(used(), "stack1 ");
}

TEST_F(DixonSeries, OfWaterThatWasAcquiredIsUsedBesideAComputedInPhaseOne) {
  add(DixonPart::water);
  add(DixonPart::in_phase);
  study_.series.back().computed = true;
  EXPECT_EQ(used(), "stack1 ");
}

TEST_F(DixonSeries, OfFatAloneIsUsedOnDemandOnly) {
  add(DixonPart::fat);
  try {
    used();
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::unsupported);
    EXPECT_THAT(error.what(),
                testing::HasSubstr("stack1: (0008,0008) ImageType says that it shows fat alone"));
  }
  EXPECT_EQ(choose_series(study_, {{"1", {}}}).size(), 1U);
}

}  // namespace
}  // namespace emmetrope::segmentation
