#include "tileflight/evaluation/scoring/warnings.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::scoring::warnings_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class WarningsOfAFlight : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) { std::ofstream(folder_.path() / name) << text; }

  tests::TemporaryFolder folder_;
};

TEST_F(WarningsOfAFlight, AnOdometryThatStoppedShort) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 90, "lost": true, "lost_reason": "too few points"})");
  const Warnings warnings = odometry_warnings({.map = folder_.path()});
  ASSERT_EQ(warnings.size(), 2u) << "of a program that has no list of its own";
  EXPECT_THAT(warnings[0].what, HasSubstr("not tracked to its end: too few points"));
  EXPECT_EQ(warnings[1].what, "90 of 120 frames have a pose");
}

TEST_F(WarningsOfAFlight, AnOdometrysOwnListIsAll) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 90, "lost": true,
                            "warnings": [{"message": "the scale may have drifted", "where": "odometry", "severity": "warning",
                                        "remedy": "look"}]})");
  const Warnings warnings = odometry_warnings({.map = folder_.path()});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].what, "the scale may have drifted");
}

TEST_F(WarningsOfAFlight, AWholeOneHasNone) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 120, "lost": false})");
  EXPECT_TRUE(odometry_warnings({.map = folder_.path()}).empty());
  EXPECT_TRUE(read_warnings(folder_.path() / "absent.json").empty());
  EXPECT_TRUE(dataset_warnings({}).empty());
}

TEST_F(WarningsOfAFlight, ATruthWithoutItsTiles) {
  const Warnings warnings = truth_warnings({{"complete", false}, {"tiles_failed", 3}, {"tiles_wanted", 40}});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].what, "3 of 40 tiles of the ground truth are missing");
  EXPECT_EQ(truth_warnings({{"geometric_error_max", 2.5}}).size(), 1u);
  EXPECT_TRUE(truth_warnings({{"geometric_error_max", 0.2}}).empty());
}

TEST(CommonPlaceWarnings, InvalidPointsAtTheOrigin) {
  constexpr double kShare = 0.05;
  const Warnings warnings = common_place_warnings({{0.0, 0.0, 2.5}, 300}, 1000, kShare);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0].what,
              HasSubstr("300 of the map's 1000 points lie at one and the same place, [0.00, 0.00, 2.50]"));
  EXPECT_EQ(warnings[0].severity, "warning");
  EXPECT_TRUE(common_place_warnings({{0.0, 0.0, 2.5}, 50}, 1000, kShare).empty());
  EXPECT_TRUE(common_place_warnings({{0.0, 0.0, 2.5}, 1}, 3, kShare).empty()) << "a point that is alone";
}

TEST_F(WarningsOfAFlight, AListThatIsNoneIsAnError) {
  write("transform.json", R"({"warnings": [{"message": 3}]})");
  EXPECT_THAT([&] { read_warnings(folder_.path() / "transform.json"); },
              ThrowsMessage<InputError>(HasSubstr("transform.json: 'warnings[0].what' must be text")));
}

TEST_F(WarningsOfAFlight, TheSameTwiceStandsOnceAndAFlightsBearItsName) {
  Warnings warnings{{"a", "odometry", "warning", "look"}};
  append_distinct(warnings, {{"a", "odometry", "warning", "look"}, {"b", "odometry", "warning", "look"}});
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(prefix_with_flight(warnings, "real")[1].where, "real/odometry");
}

}  // namespace
}  // namespace tileflight::scoring::warnings_test
