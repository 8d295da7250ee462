#include "tileflight/core/base/strict_section.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::base::strict_section_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class YamlFile : public testing::Test {
 protected:
  StrictSection load(const std::string& text) {
    std::ofstream(folder_ / "a.yaml") << text;
    return StrictSection::load(folder_ / "a.yaml");
  }
  /// The error message of `read` for a file with this text.
  template <class Read>
  std::string fault(const std::string& text, const Read& read) {
    return tests::refusal_of([&] {
      StrictSection section = load(text);
      read(section);
    });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(YamlFile, ValuesOfEachKind) {
  StrictSection section =
      load("a: text\nb: 2.5\nc: 7\nd: true\ne: [1, 2, 3]\nf: sub/x.txt\ng: {h: 1}\ni: [{h: 2}, {h: 3}]\nj:\n");
  EXPECT_EQ(section.text("a"), "text");
  EXPECT_EQ(section.number("b"), 2.5);
  EXPECT_EQ(section.integer("c"), 7);
  EXPECT_EQ(section.boolean("d"), true);
  EXPECT_THAT(section.numbers("e", 1, 3).value(), ElementsAre(1, 2, 3));
  EXPECT_EQ(section.path("f"), folder_ / "sub/x.txt");
  EXPECT_EQ(section.section("g")->integer("h"), 1);
  EXPECT_EQ(section.sections("i").at(1).integer("h"), 3);
  EXPECT_EQ(section.number("j"), std::nullopt);
  EXPECT_EQ(section.text("absent"), std::nullopt);
  EXPECT_NO_THROW(section.require_all_keys_used());
}

/// One of the two would be ignored without a word.
TEST_F(YamlFile, AKeyThatIsThereTwiceIsRefused) {
  const auto nothing = [](StrictSection&) {};
  EXPECT_THAT(fault("a: 1\nb: 2\na: 3\n", nothing), HasSubstr("a.yaml:3: 'a' is there twice, first in line 1"));
  EXPECT_THAT(fault("m: [{x: 1}, {n: {x: 1, x: 2}}]\n", nothing), HasSubstr("a.yaml:1: 'x' is there twice"));
  EXPECT_EQ(load("a: &shared {x: 1}\nb: *shared\nc: {a: 1, b: {a: 2}}\n").keys().size(), 3U);
  // Aliases of aliases: as many maps as lines, however often each is repeated.
  std::string nested = "k0: &k0 {x: 1}\n";
  for (int i = 1; i < 40; ++i) {
    const std::string name = "k" + std::to_string(i), before = "*k" + std::to_string(i - 1);
    nested += name + ": &" + name + " [" + before + " , " + before + " , " + before + " ]\n";
  }
  EXPECT_EQ(load(nested).keys().size(), 40U);
}

/// `part:` with nothing after it is a section whose keys all have their defaults, not a section that is absent.
TEST_F(YamlFile, AKeyWithoutAValueIsAnEmptySection) {
  StrictSection section = load("part:\nentries:\n  -\n  - {a: 2}\nnamed:\n  first:\n  second: {a: 3}\n");
  ASSERT_TRUE(section.section("part"));
  EXPECT_EQ(section.section("part")->number("a"), std::nullopt);
  EXPECT_NO_THROW(section.section("part")->require_all_keys_used());
  EXPECT_FALSE(section.section("absent"));
  EXPECT_EQ(section.sections("entries").at(0).number("a"), std::nullopt);
  EXPECT_EQ(section.sections("entries").at(1).number("a"), 2.0);
  auto named = section.named_sections("named");
  ASSERT_EQ(named.size(), 2U);
  EXPECT_EQ(named[0].second.number("a"), std::nullopt);
  EXPECT_EQ(named[1].second.number("a"), 3.0);
}

TEST_F(YamlFile, FaultsSayFileLineAndKey) {
  const auto number = [](StrictSection& s) { s.number("b"); };
  EXPECT_THAT(fault("a: 1\nb: two\n", number), HasSubstr("a.yaml:2: 'b' must be a number"));
  EXPECT_THAT(fault("b: .inf\n", number), HasSubstr("'b' must be a number"));
  EXPECT_THAT(fault("b: 1.5\n", [](StrictSection& s) { s.integer("b"); }), HasSubstr("must be a whole number"));
  EXPECT_THAT(fault("b: 99999999999\n", [](StrictSection& s) { s.integer("b"); }), HasSubstr("must be a whole number"));
  EXPECT_THAT(fault("b: maybe\n", [](StrictSection& s) { s.boolean("b"); }), HasSubstr("must be true or false"));
  EXPECT_THAT(fault("b: [1]\n", [](StrictSection& s) { s.numbers("b", 2, 3); }), HasSubstr("a list of 2 to 3 numbers"));
  EXPECT_THAT(fault("b: [1, .nan]\n", [](StrictSection& s) { s.numbers("b", 2, 2); }), HasSubstr("a list of numbers"));
  EXPECT_THAT(fault("b: x\n",
                    [](StrictSection& s) {
                      s.choice("b", {"y", "z"});
                    }),
              HasSubstr("'b' is 'x'; it must be one of: y, z"));
  EXPECT_THAT(fault("b: 3\n", [](StrictSection& s) { s.section("b"); }), HasSubstr("'b' must be a map of keys"));
  EXPECT_THAT(fault("b: {c: [1]}\n", [](StrictSection& s) { s.section("b")->number("c"); }),
              HasSubstr("'b.c' must be"));
  EXPECT_THAT(fault("b: 3\n", [](StrictSection& s) { s.sections("b"); }), HasSubstr("'b' must be a list"));
}

TEST_F(YamlFile, KeysThatNothingAskedForAreNamedWithTheNearest) {
  EXPECT_THAT(fault("voxel: 1\nvoxle: 2\n",
                    [](StrictSection& s) {
                      s.number("voxel");
                      s.require_all_keys_used();
                    }),
              HasSubstr("a.yaml:2: 'voxle' is not a key here; did you mean 'voxel'?"));
  EXPECT_THAT(fault("photogrammetry: 2\n",
                    [](StrictSection& s) {
                      for (const char* key : {"voxel", "fps", "voxel"}) s.number(key);
                      s.require_all_keys_used();
                    }),
              HasSubstr("'photogrammetry' is not a key here; there are fps, voxel"));
}

TEST_F(YamlFile, BrokenFiles) {
  const auto nothing = [](StrictSection&) {};
  EXPECT_THAT(fault("a: [1\n", nothing), HasSubstr("not valid YAML"));
  EXPECT_THAT(fault("- 1\n- 2\n", nothing), HasSubstr("the file must be a map of keys"));
  EXPECT_THAT(fault("", nothing), HasSubstr("the file must be a map of keys"));
  EXPECT_THAT([&] { StrictSection::load(folder_ / "absent.yaml"); },
              ThrowsMessage<InputError>(HasSubstr("absent.yaml: cannot be opened")));
}

std::string fault_in(const char* text, const std::function<void(StrictSection&)>& read) {
  const nlohmann::json json = nlohmann::json::parse(text);
  return tests::refusal_of([&] {
    StrictSection section(json, "a.json");
    read(section);
    section.require_all_keys_used();
  });
}

TEST(JsonSection, ValuesOfEachKind) {
  const nlohmann::json json = nlohmann::json::parse(
      R"({"a": "${HOME}", "b": 2.5, "c": 7, "d": true, "e": [1, 2], "f": {"g": {"h": 3}}, "i": [{"h": 4}], "j": null,
          "k": ["x", "y"], "l": 0, "m": "FISHEYE"})");
  StrictSection section(json, "a.json");
  EXPECT_EQ(section.required_text("a"), "${HOME}") << "only YAML has variables";
  EXPECT_EQ(section.required_number("b"), 2.5);
  EXPECT_EQ(section.integer("c"), 7);
  EXPECT_EQ(section.boolean("d"), true);
  EXPECT_THAT(section.required_counts("e"), ElementsAre(1, 2));
  EXPECT_EQ(section.named_sections("f").at(0).second.integer("h"), 3);
  EXPECT_EQ(section.sections("i").at(0).integer("h"), 4);
  EXPECT_FALSE(section.section("j").has_value());
  EXPECT_TRUE(std::isnan(section.required_number("j")));
  EXPECT_THAT(section.required_texts("k"), ElementsAre("x", "y"));
  EXPECT_EQ(section.number("l", 1.0, 0.0, 2.0), 0.0);
  EXPECT_EQ(section.number("absent", 1.0, 0.0, 2.0), 1.0);
  EXPECT_EQ(section.choice_in_any_case("m", {"pinhole", "fisheye"}), "fisheye");
  EXPECT_NO_THROW(section.require_all_keys_used());
}

TEST(JsonSection, FaultsSayFileAndKey) {
  EXPECT_EQ(fault_in(R"({"b": "2"})", [](StrictSection& s) { s.number("b"); }), "a.json: 'b' must be a number");
  EXPECT_EQ(fault_in(R"({})", [](StrictSection& s) { s.required_number("b"); }), "a.json: 'b' is missing");
  EXPECT_EQ(fault_in(R"({"b": -1})", [](StrictSection& s) { s.required_count("b"); }),
            "a.json: 'b' must be a whole number, not negative");
  EXPECT_EQ(fault_in(R"({"b": {"c": 0.5}})", [](StrictSection& s) { s.required_section("b").integer("c"); }),
            "a.json: 'b.c' must be a whole number");
  EXPECT_EQ(fault_in(R"({"b": 3})", [](StrictSection& s) { s.number("b", 1.0, 0.0, 2.0); }),
            "a.json: 'b' is 3, out of range: from 0 to 2");
  EXPECT_EQ(fault_in(R"({"b": 0})", [](StrictSection& s) { s.positive_number("b"); }),
            "a.json: 'b' must be more than 0");
  EXPECT_EQ(fault_in(R"({"width": 1, "widht": 2})", [](StrictSection& s) { s.number("width"); }),
            "a.json: 'widht' is not a key here; did you mean 'width'?");
}

TEST(JsonSection, UnknownKeysAreWarningsWhereTheyAreCollected) {
  const nlohmann::json json = nlohmann::json::parse(R"({"part": {"widht": 2, "color": 1}})");
  std::vector<std::string> warnings;
  StrictSection section(json, "a.json", "", &warnings);
  StrictSection part = section.required_section("part");
  part.ignore({"color"});
  part.number("width");
  part.require_all_keys_used();
  EXPECT_THAT(warnings, ElementsAre("a.json: 'part.widht' is not a key here; did you mean 'width'? (ignored)"));
}

TEST(JsonSection, OtherProgramsValuesAreClampedAndTheirKeysIgnoredWithAWarning) {
  const nlohmann::json json = nlohmann::json::parse(
      R"({"rate": 2000, "count": 0, "length": -1, "noise": true, "blur": 0, "gain": false, "none": null, "map": {}})");
  std::vector<std::string> warnings;
  StrictSection section(json, "a.json", "", &warnings);
  EXPECT_EQ(section.clamped_number("rate", 1.0, 0.01, 1000.0), 1000.0);
  EXPECT_EQ(section.clamped_integer("count", 5, 1, 8), 1);
  EXPECT_EQ(section.clamped_integer("absent", 0, 1, 8), 0) << "a default may be out of the range";
  EXPECT_EQ(tests::refusal_of([&] { section.clamped_number("length", 1.0, 0.0, 9.0); }),
            "a.json: 'length' is -1, out of range: from 0 to 9");
  section.ignore_with_warning({"noise", "blur", "gain", "none", "map", "absent"}, "images have none");
  section.require_all_keys_used();
  EXPECT_THAT(warnings, ElementsAre("a.json: 'rate' is 2000, out of range: from 0.01 to 1000; taken as 1000",
                                    "a.json: 'count' is 0, out of range: from 1 to 8; taken as 1",
                                    "a.json: 'noise' has no effect here: images have none"));
  StrictSection strict(json, "a.json");
  EXPECT_NE(tests::refusal_of([&] { strict.clamped_number("rate", 1.0, 0.01, 1000.0); }), "no error");
}

TEST(ExpandVariables, AsInAShell) {
  setenv("TILEFLIGHT_YAML_TEST", "deep", 1);
  EXPECT_EQ(expand_variables("a/${TILEFLIGHT_YAML_TEST}/${TILEFLIGHT_UNSET:-b}", "f"), "a/deep/b");
  EXPECT_EQ(expand_variables("no variables, $ alone", "f"), "no variables, $ alone");
  EXPECT_THAT([&] { expand_variables("${TILEFLIGHT_UNSET}", "f"); },
              ThrowsMessage<InputError>(HasSubstr("the environment variable TILEFLIGHT_UNSET is not set")));
  EXPECT_THAT([&] { expand_variables("${OPEN", "f"); }, ThrowsMessage<InputError>(HasSubstr("'${' without '}'")));
}

TEST(ExpandVariables, ValuesAreNotExpandedAgain) {
  setenv("TILEFLIGHT_YAML_TEST", "${TILEFLIGHT_YAML_TEST}", 1);
  EXPECT_EQ(expand_variables("${TILEFLIGHT_YAML_TEST}", "f"), "${TILEFLIGHT_YAML_TEST}");
}

}  // namespace
}  // namespace tileflight::base::strict_section_test
