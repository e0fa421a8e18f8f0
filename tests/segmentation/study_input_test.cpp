#include "segmentation/study_input.hpp"

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

}  // namespace
}  // namespace emmetrope::segmentation
