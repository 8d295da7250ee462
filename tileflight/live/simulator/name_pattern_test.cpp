#include "tileflight/live/simulator/name_pattern.h"

#include <gmock/gmock.h>

#include <string>

#include "tests/refusal.h"

namespace tileflight::simulator::name_pattern_test {
namespace {

using testing::HasSubstr;
using tests::refusal_of;

TEST(NamePattern, PatternsMatchWholeNamesInLinearTime) {
  EXPECT_TRUE(NamePattern("north.*", NamePattern::Case::kHeeded).matches("north wall"));
  EXPECT_FALSE(NamePattern("north", NamePattern::Case::kHeeded).matches("north wall"));
  EXPECT_FALSE(NamePattern("NORTH.*", NamePattern::Case::kHeeded).matches("north wall"));
  EXPECT_TRUE(NamePattern("NORTH.*", NamePattern::Case::kIgnored).matches("north wall"));
  // A backtracking matcher would not finish on these.
  EXPECT_FALSE(NamePattern("(a+)+$", NamePattern::Case::kHeeded).matches(std::string(5000, 'a') + "!"));
  EXPECT_FALSE(NamePattern("(a|aa)*(b|c)*d{0,50}x", NamePattern::Case::kHeeded).matches(std::string(5000, 'a')));
  EXPECT_THAT(refusal_of([] { NamePattern("(", NamePattern::Case::kHeeded); }), HasSubstr("regular expression"));
  EXPECT_THAT(refusal_of([] { NamePattern("(a)\\1", NamePattern::Case::kHeeded); }), HasSubstr("regular expression"));
  EXPECT_THAT(refusal_of([] { NamePattern("((((a{1000}){1000}){1000}){1000})", NamePattern::Case::kHeeded); }),
              HasSubstr("pattern"));
  EXPECT_THAT(refusal_of([] { NamePattern(std::string(1001, 'a'), NamePattern::Case::kHeeded); }), HasSubstr("1000"));
}

}  // namespace
}  // namespace tileflight::simulator::name_pattern_test
