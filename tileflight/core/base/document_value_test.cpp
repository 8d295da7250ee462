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
