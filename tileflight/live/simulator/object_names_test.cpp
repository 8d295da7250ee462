#include "tileflight/live/simulator/object_names.h"

#include <gmock/gmock.h>

#include <set>
#include <string>
#include <vector>

#include "tests/refusal.h"

namespace tileflight::simulator::object_names_test {
namespace {

constexpr std::uint32_t kNone = imaging::kNoFeature;

std::string name_of(const std::string& tile, std::uint32_t feature = kNone, const std::string& own = "") {
  return client_name({tile, 0, feature, own});
}

TEST(ObjectNames, AreTheTilesFilesInWordCharacters) {
  EXPECT_EQ(name_of("tiles/3-0-0.glb"), "tiles__3_0_0");
  EXPECT_EQ(name_of("tiles/3-0-0.glb", 12), "tiles__3_0_0___12");
  EXPECT_EQ(name_of("0.glb"), "0");
  EXPECT_EQ(name_of(""), "surface");
  EXPECT_EQ(name_of("", 3), "surface___3");
  EXPECT_EQ(tile_name("tiles/3-0-0.glb"), "tiles__3_0_0") << "meshes are named as objects are";
}

TEST(ObjectNames, OfFeaturesAreTheirOwn) {
  EXPECT_EQ(name_of("a.glb", 1, "Building_12"), "Building_12");
  EXPECT_EQ(name_of("b.glb", 9, "Building_12"), "Building_12") << "one building over two tiles is one object";
  EXPECT_EQ(name_of("a.glb", 1, "north-wall"), "north_wall");
}

TEST(ObjectNames, ThatLoseCharactersAreToldApartByDigits) {
  EXPECT_THAT(name_of("Tile_+012_-004.b3dm"), testing::MatchesRegex("Tile__012__004_b3dm_[0-9a-f]+"));
  EXPECT_THAT(name_of("a.glb", 1, "T\xc3\xbcrhaus 3"), testing::MatchesRegex("T__rhaus_3_[0-9a-f]+"));
  EXPECT_EQ(name_of("a b.glb"), name_of("a b.glb")) << "the same in every session";
}

/// Whatever a tileset calls its files: AirSim's pattern for all objects finds them, and no two share a name.
TEST(ObjectNames, AreWordsAndDifferent) {
  const std::vector<std::string> files{"a-b.glb",
                                       "a_b.glb",
                                       "a/b.glb",
                                       "a b.glb",
                                       "a+b.glb",
                                       "a--b.glb",
                                       "a__b.glb",
                                       "a-/b.glb",
                                       "a/-b.glb",
                                       "a#b.glb",
                                       "a.b.glb",
                                       "ab.glb",
                                       "a-b.b3dm",
                                       "-a-b.glb",
                                       "a-b-.glb",
                                       "A-b.glb",
                                       "../a-b.glb",
                                       "a\xc3\xa4"
                                       "b.glb",
                                       "a\xc3\xb6"
                                       "b.glb",
                                       "a-b.glb?v=1",
                                       "a-b.glb?v=2",
                                       ".glb",
                                       "/.glb",
                                       "a-b"};
  const NamePattern words("[\\w]*", NamePattern::Case::kIgnored);
  std::set<std::string> names;
  for (const std::string& file : files) {
    const std::string name = name_of(file);
    EXPECT_TRUE(words.matches(name)) << file << " is " << name;
    EXPECT_FALSE(name.empty()) << file;
    if (file != "a-b") names.insert(name);
  }
  EXPECT_EQ(names.size(), files.size() - 1) << "only the ending .glb makes no difference";
}

}  // namespace
}  // namespace tileflight::simulator::object_names_test

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
