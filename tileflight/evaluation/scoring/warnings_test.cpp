#include "tileflight/evaluation/scoring/warnings.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
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
  EXPECT_THAT(warnings[0].message, HasSubstr("not tracked to its end: too few points"));
  EXPECT_EQ(warnings[1].message, "90 of 120 frames have a pose");
}

TEST_F(WarningsOfAFlight, AnOdometrysOwnListIsAll) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 90, "lost": true,
                            "warnings": [{"message": "the scale may have drifted", "where": "odometry", "severity": "warning",
                                        "remedy": "look"}]})");
  const Warnings warnings = odometry_warnings({.map = folder_.path()});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].message, "the scale may have drifted");
}

TEST_F(WarningsOfAFlight, AGapOfTheTrajectoryIsNamedForAnyOdometry) {
  std::string trajectory;
  for (int i = 0; i < 80; ++i)
    if (i < 20 || i >= 53) trajectory += base::formatted("%.1f %d 0 0 0 0 0 1\n", 0.1 * i, i);
  write("trajectory.txt", trajectory);
  for (const std::string list : {R"(, "warnings": [])", ""}) {
    write("odometry.json", R"({"frames": 47, "frames_tracked": 47)" + list + "}");
    const Warnings warnings = odometry_warnings({.map = folder_.path()});
    ASSERT_EQ(warnings.size(), 1u) << list;
    EXPECT_THAT(warnings[0].message, HasSubstr("no poses from 1.90 to 5.30 s: 43 % of the flight's time")) << list;
  }
}

TEST_F(WarningsOfAFlight, AWholeOneHasNone) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 120, "lost": false})");
  EXPECT_TRUE(odometry_warnings({.map = folder_.path()}).empty());
  EXPECT_TRUE(read_warnings(folder_.path() / "absent.json").empty());
  EXPECT_TRUE(dataset_warnings({}).empty());
}

TEST_F(WarningsOfAFlight, ATruthWithoutItsTiles) {
  const Warnings warnings = truth_warnings({.tiles_wanted = 40, .tiles_failed = 3, .complete = false});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].message, "3 of 40 tiles of the ground truth are missing");
  EXPECT_EQ(truth_warnings({.geometric_error_max_m = 2.5}).size(), 1u);
  EXPECT_TRUE(truth_warnings({.geometric_error_max_m = 0.2}).empty());
}

TEST(CommonPlaceWarnings, InvalidPointsAtTheOrigin) {
  constexpr double kShare = 0.05;
  const Warnings warnings = common_place_warnings({{0.0, 0.0, 2.5}, 300}, 1000, kShare);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0].message,
              HasSubstr("300 of the map's 1000 points lie at one and the same place, [0.00, 0.00, 2.50]"));
  EXPECT_EQ(warnings[0].severity, Severity::kWarning);
  EXPECT_TRUE(common_place_warnings({{0.0, 0.0, 2.5}, 50}, 1000, kShare).empty());
  EXPECT_TRUE(common_place_warnings({{0.0, 0.0, 2.5}, 1}, 3, kShare).empty()) << "a point that is alone";
}

TEST_F(WarningsOfAFlight, AListThatIsNoneIsAnError) {
  write("transform.json", R"({"warnings": [{"severity": "note", "message": 3}]})");
  EXPECT_THAT([&] { read_warnings(folder_.path() / "transform.json"); },
              ThrowsMessage<InputError>(HasSubstr("transform.json: 'warnings[0].message' must be text")));
}

TEST_F(WarningsOfAFlight, TheSameTwiceStandsOnceAndAFlightsBearItsName) {
  Warnings warnings{{"a", "odometry", Severity::kWarning, "look"}};
  append_distinct(warnings,
                  {{"a", "odometry", Severity::kWarning, "look"}, {"b", "odometry", Severity::kWarning, "look"}});
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(prefix_with_flight(warnings, "real")[1].where, "real/odometry");
}

}  // namespace
}  // namespace tileflight::scoring::warnings_test

namespace tileflight::scoring::path_warnings_test {
namespace {

using testing::HasSubstr;

TEST(PathWarnings, AreAnsweredWhereImagesMeasuredThePath) {
  const tests::TemporaryFolder folder;
  base::write_file(folder.path() / "odometry.json", R"({"frames": 120, "frames_tracked": 120, "lost": false,
      "warnings": [{"message": "the scale may have drifted", "where": "odometry", "severity": "warning", "remedy": "look"},
                 {"message": "the camera jumps", "where": "odometry", "severity": "warning", "remedy": "look"}],
      "path_warnings": ["the scale may have drifted"]})");
  const MapInputs map{.map = folder.path()};
  const auto answered = [&](std::size_t located, double path_error_m) {
    Warnings warnings = odometry_warnings(map);
    answer_path_warnings(map, {.tried = 20, .located = located, .path_error_m = path_error_m, .path_length_m = 50.0},
                         warnings);
    EXPECT_EQ(warnings.at(1).severity, Severity::kWarning) << "no image shows what is between two";
    return warnings.at(0);
  };
  EXPECT_EQ(answered(18, 0.2).severity, Severity::kNote);
  EXPECT_THAT(answered(18, 0.2).remedy, HasSubstr("18 of 20 images, located in it, differ by 0.4 %"));
  EXPECT_EQ(answered(17, 0.2).severity, Severity::kWarning) << "a part of the path is not measured";
  EXPECT_EQ(answered(20, 0.3).severity, Severity::kWarning) << "the path is off";
  Warnings evaluated{answered(20, 0.1)};
  append_distinct(evaluated, {odometry_warnings(map)[0]});
  ASSERT_EQ(evaluated.size(), 1u) << "the answer stands in all that follows";
  answer_path_warnings({.map = folder.path() / "map.ply"}, {.tried = 20, .located = 20, .path_length_m = 9.0},
                       evaluated);
}

}  // namespace
}  // namespace tileflight::scoring::path_warnings_test
