// Several OpenCL devices on one picture. PoCL offers the CPU twice where POCL_DEVICES says so, which it reads
// at the first OpenCL call of a process: CTest runs each case in one of its own. A machine's GPUs are left out, as
// they round differently.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/device/devices.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

class Devices : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const char* pocl = "/etc/OpenCL/vendors/pocl.icd";
    if (std::filesystem::exists(pocl)) setenv("OCL_ICD_VENDORS", pocl, 0);
    setenv("POCL_DEVICES", "pthread pthread", 1);
  }
};

TraceSettings odd_size() {
  TraceSettings settings;
  settings.grid = {45, 70, 0.9, 1.4, {0, 0}};
  settings.samples = 64;
  settings.verbosity.quiet = true;
  return settings;
}

void expect_same(const TraceResult& a, const TraceResult& b) {
  EXPECT_EQ(a.image.values, b.image.values);
  EXPECT_EQ(a.states, b.states);
  EXPECT_EQ(a.rays, b.rays);
  ASSERT_EQ(a.derivatives.size(), b.derivatives.size());
  for (std::size_t i = 0; i < a.derivatives.size(); ++i)
    EXPECT_EQ(a.derivatives[i].values, b.derivatives[i].values);
}

TEST_F(Devices, ShareAPictureToTheBit) {
  const Tracer one("0"), two("0,1"), all("all");
  EXPECT_NE(two.device_name().find(" + "), std::string::npos);
  const EyeModel eye = with_thin_lens(make_eye("navarro", {}), {-1, 0, 0}, 12);
  const auto scene = make_scene("letters:logmar=1,distance_mm=600");
  TraceSettings settings = odd_size();
  const TraceResult reference = one.trace(eye, *scene, settings);
  expect_same(two.trace(eye, *scene, settings), reference);
  expect_same(all.trace(eye, *scene, settings), reference);
  const EyeModel bare = make_eye("navarro", {});
  const std::vector<EyeTangent> bend{
      {with_thin_lens(bare, {-0.9, 0, 0}, 12), with_thin_lens(bare, {-1.1, 0, 0}, 12), 0.2}};
  expect_same(two.trace(eye, *scene, settings, bend), one.trace(eye, *scene, settings, bend));
  for (const auto way : {Representation::smooth, Representation::fast}) {
    settings.representation = way;
    expect_same(two.trace(eye, *scene, settings), one.trace(eye, *scene, settings));
  }
  settings.representation = Representation::analytic;
  settings.target_error = 3;
  settings.samples = 512;
  expect_same(two.trace(eye, *scene, settings), one.trace(eye, *scene, settings));
}

TEST_F(Devices, AreChosenByIndexOrName) {
  const auto devices = list_devices();
  ASSERT_EQ(devices.size(), 2U);
  const auto indices = [&](const std::string& wanted) {
    std::vector<int> found;
    for (const auto& device : chosen_devices(devices, wanted)) found.push_back(device.index);
    return found;
  };
  EXPECT_EQ(indices(""), (std::vector<int>{0}));
  EXPECT_EQ(indices("1"), (std::vector<int>{1}));
  EXPECT_EQ(indices("1,0"), (std::vector<int>{1, 0}));
  EXPECT_EQ(indices("all"), (std::vector<int>{0, 1}));
  EXPECT_EQ(indices(devices[0].name.substr(0, 7)),
            (std::vector<int>{0}));  // the first of those that are called so
  for (const char* wrong : {"2", "0,0", "0,", "gpu,0", "pthread,pthread"}) {
    try {
      chosen_devices(devices, wrong);
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::no_device) << wrong;
    }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
