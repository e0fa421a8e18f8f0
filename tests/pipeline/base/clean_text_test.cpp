#include "pipeline/base/clean_text.hpp"

#include <gtest/gtest.h>

namespace emmetrope {
namespace {

TEST(CleanText, HasNoCharacterThatSteersWhatShowsIt) {
  EXPECT_EQ(clean_utf8("a\u202eb\u2066c\u200ed\x1b[31me\x07"
                       "f\x01g"),
            "abcd[31mefg");
  EXPECT_EQ(clean_utf8(std::string("a\0b\xff", 4)), "ab\uFFFD");
  EXPECT_EQ(clean_utf8("Sch\u00e4del \u982d T2*"), "Sch\u00e4del \u982d T2*");
}

TEST(CleanText, KeepsWordsApart) {
  EXPECT_EQ(clean_utf8("two\nlines\tand\u2028more\u2029"), "two lines and more ");
}

}  // namespace
}  // namespace emmetrope
