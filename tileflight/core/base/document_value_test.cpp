#include "tileflight/core/base/document_value.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base::canonical_yaml_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::string of(const std::string& text) { return canonical_yaml(YAML::Load(text)); }

TEST(CanonicalYaml, IsTheSameHoweverItIsWritten) {
  const std::string one = of("place: {source: tiles/tileset.json, size: [80, 80, 20.0]}\nname: tiny\n");
  for (const char* other : {"# a comment\nname: tiny   # another\nplace:\n  size:\n  - 80\n  - 8.0e1\n  - 20\n  "
                            "source: \"tiles/tileset.json\"\n",
                            "{\"name\": 'tiny', \"place\": {size: [80.000, 80, +20], source: tiles/tileset.json}}",
                            "---\nname: >-\n  tiny\nplace: {size: [80, 80, 20], source: 'tiles/tileset.json'}\n...\n",
                            "common: &c [80, 80, 20]\nplace: {source: tiles/tileset.json, size: *c}\nname: tiny\n"}) {
    const std::string text = of(other);
    if (std::string(other).find("&c") == std::string::npos)
      EXPECT_EQ(text, one) << other;
    else
      EXPECT_NE(text.find("\"place\":{\"size\":[80,80,20],\"source\":\"tiles/tileset.json\"}"), std::string::npos)
          << text;
  }
}

TEST(CanonicalYaml, TellsWhatDiffers) {
  const std::string one = of("a: [1, 2]\nb: text\nc: {d: 0.1}\n");
  for (const char* other : {"a: [2, 1]\nb: text\nc: {d: 0.1}\n", "a: [1, 2]\nb: Text\nc: {d: 0.1}\n",
                            "a: [1, 2]\nb: text\nc: {d: 0.10000000000000002}\n", "a: [1, 2]\nb: text\nc: {e: 0.1}\n",
                            "a: [1, 2]\nb: text\n", "a: '[1, 2]'\nb: text\nc: {d: 0.1}\n",
                            "a: [1, [2]]\nb: text\nc: {d: 0.1}\n", "a: [1, 2]\nb: [text]\nc: {d: 0.1}\n"})
    EXPECT_NE(of(other), one) << other;
  EXPECT_NE(of("seed: 9007199254740993"), of("seed: 9007199254740992")) << "a double holds both alike";
  EXPECT_NE(of("a: 'x, b: y'"), of("{a: x, b: y}"));
  EXPECT_NE(of("a: 'x\",\"b'"), of("a: [x, b]"));
  EXPECT_NE(of("a: 'x\\\", y'"), of("a: 'x\", y'"));
  EXPECT_EQ(of("a: -0.0"), of("a: 0"));
  EXPECT_EQ(of("a: ~"), of("a:"));
}

TEST(CanonicalYaml, VariablesAreFilledIn) {
  ASSERT_EQ(setenv("TILEFLIGHT_YAML_MEANING", "7", 1), 0);
  EXPECT_EQ(of("a: ${TILEFLIGHT_YAML_MEANING}"), of("a: 7"));
  EXPECT_EQ(of("a: ${TILEFLIGHT_NO_SUCH_THING:-8}"), of("a: 8"));
  EXPECT_EQ(of("a: ${TILEFLIGHT_NO_SUCH_THING}"), of("a: '${TILEFLIGHT_NO_SUCH_THING}'"));
}

TEST(CanonicalYaml, AnAliasOfItselfIsAnError) {
  EXPECT_THAT([&] { of("a: &a [*a]"); }, ThrowsMessage<InputError>(HasSubstr("nested too deeply")));
}

TEST(CanonicalYaml, WhatIsNoMapIsItsText) {
  const std::string dso = "Pinhole 0.5 0.5 0.5 0.5 0\n640 480\n";
  EXPECT_EQ(canonical_yaml_text(dso), dso);
  const std::string broken = "a: [1, 2\n";
  EXPECT_EQ(canonical_yaml_text(broken), broken);
  EXPECT_EQ(canonical_yaml_text("a: 1 # one\n"), canonical_yaml_text("a: 1.0\n"));
}

}  // namespace
}  // namespace tileflight::base::canonical_yaml_test

namespace tileflight::base::known_keys_test {
namespace {

/// The recursive definition itself, exponential in the lengths.
std::size_t edit_distance_by_definition(std::string_view a, std::string_view b) {
  if (a.empty()) return b.size();
  if (b.empty()) return a.size();
  const std::size_t substituted =
      edit_distance_by_definition(a.substr(1), b.substr(1)) + (a.front() == b.front() ? 0 : 1);
  const std::size_t deleted = edit_distance_by_definition(a.substr(1), b) + 1;
  const std::size_t inserted = edit_distance_by_definition(a, b.substr(1)) + 1;
  return std::min({substituted, deleted, inserted});
}

TEST(EditDistance, KnownValues) {
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("abc", ""), 3U);
  EXPECT_EQ(edit_distance("same", "same"), 0U);
}

TEST(EditDistance, EqualsItsRecursiveDefinition) {
  const std::vector<std::string> words = {"", "a", "ab", "ba", "abc", "cab", "fps", "fsp", "voxel", "vexol", "edges"};
  for (const auto& a : words) {
    for (const auto& b : words) {
      EXPECT_EQ(edit_distance(a, b), edit_distance_by_definition(a, b)) << a << " " << b;
    }
  }
}

TEST(NearestKey, NamesTheMostSimilar) {
  EXPECT_EQ(nearest_key("trajectry", {"camera", "trajectory", "fps"}), "trajectory");
  EXPECT_EQ(nearest_key("fsp", {"camera", "fps"}), "fps");
}

TEST(NearestKey, FirstOfEqualsAndEmptyWithoutKeys) {
  EXPECT_EQ(nearest_key("x", {"a", "b"}), "a");
  EXPECT_EQ(nearest_key("x", {}), "");
}

TEST(DidYouMean, NamesWhatIsNearAndNothingElse) {
  const std::vector<std::string> commands{"extract", "render", "evaluate", "tile", "run"};
  EXPECT_EQ(did_you_mean("rnder", commands), "; did you mean 'render'?");
  EXPECT_EQ(did_you_mean("Extract", commands), "; did you mean 'extract'?");
  EXPECT_EQ(did_you_mean("eval", commands), "; did you mean 'evaluate'?");
  EXPECT_EQ(did_you_mean("tlie", commands), "; did you mean 'tile'?") << "two letters that changed places";
  EXPECT_EQ(did_you_mean("photogrammetry", commands), "");
  EXPECT_EQ(did_you_mean("x", {}), "");
}

}  // namespace
}  // namespace tileflight::base::known_keys_test
