#include "raytrace/movement/movement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(Movement, RunsStraightBetweenItsMoments) {
  const test::TemporaryFolder folder;
  write_file(
      folder.path() / "m.csv",
      "\xEF\xBB\xBFtime_s,horizontal_deg,vergence_deg,pupil_mm\r\n0,0,0,3\r\n0.5,10,4,5\r\n\r\n1,10,4,4\r\n");
  const Movement movement = make_movement((folder.path() / "m.csv").string(), 1);
  EXPECT_EQ(movement.duration_s(), 1);
  const EyeMoment moment = movement.at(0.25);
  EXPECT_DOUBLE_EQ(moment.gaze.horizontal_deg, 5);
  EXPECT_DOUBLE_EQ(moment.vergence_deg, 2);
  EXPECT_DOUBLE_EQ(*moment.pupil_mm, 4);
  EXPECT_FALSE(movement.accommodates());
  // Convergence turns the right eye to the patient's left, +x, and the left one to the right.
  EXPECT_DOUBLE_EQ(moment.gaze_of(Laterality::od).horizontal_deg, 6);
  EXPECT_DOUBLE_EQ(moment.gaze_of(Laterality::os).horizontal_deg, 4);
  EXPECT_DOUBLE_EQ(movement.at(7).gaze.horizontal_deg, 10);
  EXPECT_DOUBLE_EQ(movement.at(-7).gaze.horizontal_deg, 0);
}

TEST(Movement, AccommodationBelowZeroIsARecordsNoise) {
  const test::TemporaryFolder folder;
  const auto recorded = [&](const std::string& text) {
    write_file(folder.path() / "m.csv", text);
    return make_movement((folder.path() / "m.csv").string(), 1);
  };
  const Movement relaxing = recorded("time_s,accommodation_D\n0,0.3\n1,-0.05\n2,-0.5\n");
  EXPECT_EQ(relaxing.at(0.5).accommodation_D, 0.15);
  EXPECT_EQ(relaxing.at(1.5).accommodation_D, 0);
  EXPECT_EQ(relaxing.least_accommodation_D(), -0.5);
  EXPECT_TRUE(relaxing.accommodates());
  EXPECT_FALSE(recorded("time_s,accommodation_D\n0,-0.05\n1,0\n").accommodates());
  EXPECT_EQ(recorded("time_s,accommodation_D\n0,0.05\n1,1\n").least_accommodation_D(), 0);
}

TEST(Movement, SaysWhatIsWrongWithATable) {
  const test::TemporaryFolder folder;
  const auto fault = [&](const std::string& text) -> std::string {
    write_file(folder.path() / "m.csv", text);
    try {
      make_movement((folder.path() / "m.csv").string(), 1);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "";
  };
  using testing::HasSubstr;
  EXPECT_THAT(fault("horizontal_deg\n1\n2\n"), HasSubstr("time_s"));
  EXPECT_THAT(fault("time_s,gaze\n0,1\n"), HasSubstr("\"gaze\" is unknown"));
  EXPECT_THAT(fault("time_s,time_s\n0,1\n"), HasSubstr("twice"));
  EXPECT_THAT(fault("time_s,vertical_deg\n0,1\n1\n"), HasSubstr("line 3"));
  EXPECT_THAT(fault("time_s,vertical_deg\n0,1 2\n1,0\n"), HasSubstr("vertical_deg \"1 2\""));
  EXPECT_THAT(fault("time_s,vertical_deg\n0,1\n1,nan\n"), HasSubstr("vertical_deg \"nan\""));
  EXPECT_THAT(fault("time_s\n0\n0\n"), HasSubstr("does not rise"));
  EXPECT_THAT(fault("time_s\n0\n"), HasSubstr("two moments"));
  EXPECT_THAT(fault("time_s,horizontal_deg\n0,1\n1,61\n"), HasSubstr("61"));
  EXPECT_THAT(fault("time_s,pupil_mm\n0,3\n1,12\n"), HasSubstr("pupil_mm 12"));
  EXPECT_THAT(fault("time_s,accommodation_D\n0,0\n1,-2\n"), HasSubstr("m.csv: accommodation_D -2"));
  EXPECT_THAT(fault("time_s,accommodation_D\n0,0\n1,-0.51\n"), HasSubstr("m.csv: accommodation_D -0.51"));
  EXPECT_THAT(fault(""), HasSubstr("unknown"));
}

TEST(Movement, ModelsSayWhatTheyKnow) {
  for (const char* wrong :
       {"saccades", "saccade:amplitude=3", "saccade:amplitude_deg=x", "saccade:amplitude_deg",
        "drift:diffusion_arcmin2_s=-1", "microsaccades:rate_hz=0", "fixation:rate_hz=7",
        "drift:duration_s=1e-5", "pursuit:duration_s=1e9", "saccade:", "saccade:amplitude_deg=3,",
        "saccade:start_s=0.2", "pursuit:latency_s=3", "saccade:amplitude_deg=5,amplitude_deg=6"}) {
    try {
      make_movement(wrong, 1);
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << wrong;
    }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
