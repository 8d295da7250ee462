#include "tileflight/experiments/report/doubts_panel.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::report::doubts_panel_test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

json doubt(const char* what, const char* where, const char* how_sure) {
  return {{"what", what}, {"where", where}, {"how_sure", how_sure}, {"what_to_do", "look"}};
}

json two_flights(const char* verdict, json doubts) {
  return {{"simulated", {{"map", {{"mean", 0.4499}}}}},
          {"real", {{"map", {{"mean", 0.4755}}}, {"kind", "video"}}},
          {"comparison", {{"mean_difference", -0.0256}, {"verdict", verdict}}},
          {"doubts", std::move(doubts)}};
}

TEST(DoubtsPanel, TheSurerFirst) {
  const auto lines = doubt_lines(
      two_flights("equivalent", {doubt("a", "truth", "possible"), 7, json{{"what", 3}},
                                 doubt("b", "real/odometry", "certain"), doubt("c", "real/alignment", "likely")}));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].what, "b");
  EXPECT_EQ(lines[1].what, "c");
  EXPECT_EQ(lines[2].what, "a");
}

TEST(DoubtsPanel, NoVerdictWhileOneForbidsIt) {
  const json failed = two_flights("equivalent", {doubt("both alignments failed", "real/alignment", "certain"),
                                                 doubt("blurred", "real/dataset", "possible")});
  EXPECT_THAT(verdict(failed), HasSubstr("No verdict on whether simulation predicts the real flight's map: both "
                                         "alignments failed (real/alignment). By the published measure"));
  EXPECT_THAT(verdict(failed), Not(HasSubstr("Simulation predicted")));
}

TEST(DoubtsPanel, APossibleOneStandsBesideTheVerdict) {
  const std::string sentence = verdict(two_flights("equivalent", {doubt("blurred", "real/dataset", "possible")}));
  EXPECT_THAT(sentence, HasSubstr("Simulation predicted"));
  EXPECT_THAT(sentence, HasSubstr("There is one doubt about it."));
}

TEST(DoubtsPanel, ThePageListsThemEscaped) {
  const std::string page = doubts_panel(two_flights("equivalent", {doubt("<b>", "real/odometry", "likely")})).str();
  EXPECT_THAT(page, HasSubstr("Odometry, real flight: &lt;b&gt;. To do: look."));
  EXPECT_TRUE(doubts_panel(two_flights("equivalent", json::array())).empty());
  EXPECT_TRUE(doubts_panel(json{{"doubts", "none"}}).empty());
}

}  // namespace
}  // namespace tileflight::report::doubts_panel_test
