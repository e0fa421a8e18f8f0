#include "segmentation/intake/tags.hpp"

#include <gtest/gtest.h>

#include <set>

namespace emmetrope::segmentation {
namespace {

TEST(Tags, OfADataSetAreReadOnce) {
  std::set<std::pair<int, int>> read;
  const auto note = [&](const auto& tags) {
    for (const Tag& tag : tags) EXPECT_TRUE(read.emplace(tag.group, tag.element).second) << tag.keyword;
  };
  note(tag::of_data_set);
  note(tag::of_identity);
  note(tag::of_study);
}

}  // namespace
}  // namespace emmetrope::segmentation
