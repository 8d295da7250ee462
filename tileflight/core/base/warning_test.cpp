#include "tileflight/core/base/warning.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::warning_test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

Warnings read(const json& result) {
  base::StrictSection section(result, "metrics.json");
  return read_warnings(section);
}

TEST(Warnings, AreReadAsTheyWereWritten) {
  const Warnings written{{"a tile is missing", "truth", Severity::kError, "fetch it"},
                         {"the scale may have drifted", "odometry", Severity::kWarning, "look"},
                         {"an image was skipped", "dataset", Severity::kNote, ""}};
  const Warnings read_again = read(json{{"warnings", to_json(written)}});
  ASSERT_EQ(read_again.size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ(read_again[i].message, written[i].message);
    EXPECT_EQ(read_again[i].where, written[i].where);
    EXPECT_EQ(read_again[i].severity, written[i].severity);
    EXPECT_EQ(read_again[i].remedy, written[i].remedy);
  }
  EXPECT_TRUE(read(json::object()).empty());
}

TEST(Warnings, OnlyNotesAllowAVerdict) {
  EXPECT_TRUE(forbids_verdict({"", "", Severity::kError, ""}));
  EXPECT_TRUE(forbids_verdict({"", "", Severity::kWarning, ""}));
  EXPECT_FALSE(forbids_verdict({"", "", Severity::kNote, ""}));
}

TEST(Warnings, TheEarlierKeyIsRefusedWithTheNewOne) {
  const json earlier = {{"doubts", json::array()}};
  EXPECT_THAT(tests::refusal_of([&] { read(earlier); }), HasSubstr("metrics.json: 'doubts' is called 'warnings' now"));
  EXPECT_THAT(tests::refusal_of([&] { refuse_earlier_key(earlier, "run/results.json"); }),
              HasSubstr("run/results.json: 'doubts' is called 'warnings' now"));
  refuse_earlier_key(json{{"warnings", json::array()}}, "results.json");
  refuse_earlier_key(json::array(), "results.json");
}

TEST(Warnings, OtherSeveritiesAndTextsAreNamed) {
  const json likely = {{"warnings", {{{"severity", "likely"}, {"message", "m"}, {"where", "w"}, {"remedy", "r"}}}}};
  EXPECT_THAT(tests::refusal_of([&] { read(likely); }), HasSubstr("\"likely\" is no severity"));
  EXPECT_THAT(tests::refusal_of([&] { read(json{{"warnings", {"a text"}}}); }), HasSubstr("metrics.json"));
}

}  // namespace
}  // namespace tileflight::warning_test
