#include "tileflight/base/yaml_section.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::base::yaml_section_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class YamlFile : public testing::Test {
 protected:
  YamlSection load(const std::string& text) {
    std::ofstream(folder_ / "a.yaml") << text;
    return YamlSection::load(folder_ / "a.yaml");
  }
  /// The error message of `read` for a file with this text.
  template <class Read>
  std::string fault(const std::string& text, const Read& read) {
    return tests::refusal_of([&] {
      YamlSection section = load(text);
      read(section);
    });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(YamlFile, ValuesOfEachKind) {
  YamlSection section =
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

TEST_F(YamlFile, FaultsSayFileLineAndKey) {
  const auto number = [](YamlSection& s) { s.number("b"); };
  EXPECT_THAT(fault("a: 1\nb: two\n", number), HasSubstr("a.yaml:2: 'b' must be a number"));
  EXPECT_THAT(fault("b: .inf\n", number), HasSubstr("'b' must be a number"));
  EXPECT_THAT(fault("b: 1.5\n", [](YamlSection& s) { s.integer("b"); }), HasSubstr("must be a whole number"));
  EXPECT_THAT(fault("b: 99999999999\n", [](YamlSection& s) { s.integer("b"); }), HasSubstr("must be a whole number"));
  EXPECT_THAT(fault("b: maybe\n", [](YamlSection& s) { s.boolean("b"); }), HasSubstr("must be true or false"));
  EXPECT_THAT(fault("b: [1]\n", [](YamlSection& s) { s.numbers("b", 2, 3); }), HasSubstr("a list of 2 to 3 numbers"));
  EXPECT_THAT(fault("b: [1, .nan]\n", [](YamlSection& s) { s.numbers("b", 2, 2); }), HasSubstr("a list of numbers"));
  EXPECT_THAT(fault("b: x\n",
                    [](YamlSection& s) {
                      s.choice("b", {"y", "z"});
                    }),
              HasSubstr("'b' is 'x'; it must be one of: y, z"));
  EXPECT_THAT(fault("b: 3\n", [](YamlSection& s) { s.section("b"); }), HasSubstr("'b' must be a map of keys"));
  EXPECT_THAT(fault("b: {c: [1]}\n", [](YamlSection& s) { s.section("b")->number("c"); }), HasSubstr("'b.c' must be"));
  EXPECT_THAT(fault("b: 3\n", [](YamlSection& s) { s.sections("b"); }), HasSubstr("'b' must be a list"));
}

TEST_F(YamlFile, KeysThatNothingAskedForAreNamedWithTheNearest) {
  EXPECT_THAT(fault("voxel: 1\nvoxle: 2\n",
                    [](YamlSection& s) {
                      s.number("voxel");
                      s.require_all_keys_used();
                    }),
              HasSubstr("a.yaml:2: 'voxle' is not a key here; did you mean 'voxel'?"));
  EXPECT_THAT(fault("photogrammetry: 2\n",
                    [](YamlSection& s) {
                      for (const char* key : {"voxel", "fps", "voxel"}) s.number(key);
                      s.require_all_keys_used();
                    }),
              HasSubstr("'photogrammetry' is not a key here; there are fps, voxel"));
}

TEST_F(YamlFile, BrokenFiles) {
  const auto nothing = [](YamlSection&) {};
  EXPECT_THAT(fault("a: [1\n", nothing), HasSubstr("not valid YAML"));
  EXPECT_THAT(fault("- 1\n- 2\n", nothing), HasSubstr("the file must be a map of keys"));
  EXPECT_THAT(fault("", nothing), HasSubstr("the file must be a map of keys"));
  EXPECT_THAT([&] { YamlSection::load(folder_ / "absent.yaml"); },
              ThrowsMessage<InputError>(HasSubstr("absent.yaml: cannot be opened")));
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
}  // namespace tileflight::base::yaml_section_test
