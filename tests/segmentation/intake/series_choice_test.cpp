#include "segmentation/intake/series_choice.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"

namespace emmetrope::segmentation {
namespace {

TEST(SeriesChoice, IsASeriesOrItsImagesWithAValue) {
  EXPECT_FALSE(parse_series_choice("1.2.3").images_with);
  const SeriesChoice choice = parse_series_choice("1.2.3,ImageType=A,B=C");
  EXPECT_EQ(choice.series, "1.2.3");
  EXPECT_EQ(choice.images_with.value().keyword, "ImageType");
  EXPECT_EQ(choice.images_with.value().value, "A,B=C");
  for (const char* text : {"2", "1.2.3,EchoTime=91", "1.2.3,EchoTime="})
    EXPECT_EQ(to_string(parse_series_choice(text)), text);
}

TEST(SeriesChoice, OtherFormsAreRefused) {
  for (const char* text : {"1.2.3,", "1.2.3,EchoTime", "1.2.3,=91", "1=2,3"}) {
    try {
      parse_series_choice(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << text;
    }
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
