#include "tileflight/experiments/report/warnings_panel.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::report::warnings_panel_test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

json warning(const char* message, const char* where, const char* severity) {
  return {{"message", message}, {"where", where}, {"severity", severity}, {"remedy", "look"}};
}

json two_flights(const char* verdict, json warnings) {
  return {{"simulated", {{"map", {{"mean", 0.4499}}}}},
          {"real", {{"map", {{"mean", 0.4755}}}, {"kind", "video"}}},
          {"comparison", {{"mean_difference", -0.0256}, {"verdict", verdict}}},
          {"warnings", std::move(warnings)}};
}

TEST(WarningsPanel, ErrorsBeforeWarningsBeforeNotes) {
  const auto lines = warning_lines(
      two_flights("equivalent", {warning("a", "truth", "note"), 7, json{{"message", 3}},
                                 warning("b", "real/odometry", "error"), warning("c", "real/alignment", "warning")}));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].message, "b");
  EXPECT_EQ(lines[1].message, "c");
  EXPECT_EQ(lines[2].message, "a");
}

TEST(WarningsPanel, NoVerdictWhileOneForbidsIt) {
  const json failed = two_flights("equivalent", {warning("both alignments failed", "real/alignment", "error"),
                                                 warning("blurred", "real/dataset", "note")});
  EXPECT_THAT(verdict(failed), HasSubstr("No verdict on whether simulation predicts the real flight's map: both "
                                         "alignments failed (real/alignment). By the published measure"));
  EXPECT_THAT(verdict(failed), Not(HasSubstr("Simulation predicted")));
}

TEST(WarningsPanel, ANoteStandsBesideTheVerdict) {
  const std::string sentence = verdict(two_flights("equivalent", {warning("blurred", "real/dataset", "note")}));
  EXPECT_THAT(sentence, HasSubstr("Simulation predicted"));
  EXPECT_THAT(sentence, HasSubstr("There is one warning about it."));
}

TEST(WarningsPanel, ThePageListsThemEscaped) {
  const std::string page =
      warnings_panel(two_flights("equivalent", {warning("<b>", "real/odometry", "warning")})).str();
  EXPECT_THAT(page, HasSubstr("Odometry, real flight: &lt;b&gt;. To do: look."));
  EXPECT_TRUE(warnings_panel(two_flights("equivalent", json::array())).empty());
  EXPECT_TRUE(warnings_panel(json{{"warnings", "none"}}).empty());
}

}  // namespace
}  // namespace tileflight::report::warnings_panel_test
