#include "tileflight/evaluation/scoring/doubts.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::scoring::doubts_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class DoubtsOfAFlight : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) { std::ofstream(folder_.path() / name) << text; }

  tests::TemporaryFolder folder_;
};

TEST_F(DoubtsOfAFlight, AnOdometryThatStoppedShort) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 90, "lost": true, "lost_reason": "too few points"})");
  const Doubts doubts = odometry_doubts({.map = folder_.path()});
  ASSERT_EQ(doubts.size(), 2u) << "of a program that has no list of its own";
  EXPECT_THAT(doubts[0].what, HasSubstr("not tracked to its end: too few points"));
  EXPECT_EQ(doubts[1].what, "90 of 120 frames have a pose");
}

TEST_F(DoubtsOfAFlight, AnOdometrysOwnListIsAll) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 90, "lost": true,
                            "doubts": [{"what": "the scale may have drifted", "where": "odometry", "how_sure": "likely",
                                        "what_to_do": "look"}]})");
  const Doubts doubts = odometry_doubts({.map = folder_.path()});
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_EQ(doubts[0].what, "the scale may have drifted");
}

TEST_F(DoubtsOfAFlight, AWholeOneHasNone) {
  write("odometry.json", R"({"frames": 120, "frames_tracked": 120, "lost": false})");
  EXPECT_TRUE(odometry_doubts({.map = folder_.path()}).empty());
  EXPECT_TRUE(read_doubts(folder_.path() / "absent.json").empty());
  EXPECT_TRUE(dataset_doubts({}).empty());
}

TEST_F(DoubtsOfAFlight, ATruthWithoutItsTiles) {
  const Doubts doubts = truth_doubts({.tiles_wanted = 40, .tiles_failed = 3, .complete = false});
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_EQ(doubts[0].what, "3 of 40 tiles of the ground truth are missing");
  EXPECT_EQ(truth_doubts({.geometric_error_max_m = 2.5}).size(), 1u);
  EXPECT_TRUE(truth_doubts({.geometric_error_max_m = 0.2}).empty());
}

TEST(CommonPlaceDoubts, InvalidPointsAtTheOrigin) {
  constexpr double kShare = 0.05;
  const Doubts doubts = common_place_doubts({{0.0, 0.0, 2.5}, 300}, 1000, kShare);
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_THAT(doubts[0].what,
              HasSubstr("300 of the map's 1000 points lie at one and the same place, [0.00, 0.00, 2.50]"));
  EXPECT_EQ(doubts[0].how_sure, "likely");
  EXPECT_TRUE(common_place_doubts({{0.0, 0.0, 2.5}, 50}, 1000, kShare).empty());
  EXPECT_TRUE(common_place_doubts({{0.0, 0.0, 2.5}, 1}, 3, kShare).empty()) << "a point that is alone";
}

TEST_F(DoubtsOfAFlight, AListThatIsNoneIsAnError) {
  write("transform.json", R"({"doubts": [{"what": 3}]})");
  EXPECT_THAT([&] { read_doubts(folder_.path() / "transform.json"); },
              ThrowsMessage<InputError>(HasSubstr("transform.json: 'doubts[0].what' must be text")));
}

TEST_F(DoubtsOfAFlight, TheSameTwiceStandsOnceAndAFlightsBearItsName) {
  Doubts doubts{{"a", "odometry", "likely", "look"}};
  append_distinct(doubts, {{"a", "odometry", "likely", "look"}, {"b", "odometry", "likely", "look"}});
  ASSERT_EQ(doubts.size(), 2u);
  EXPECT_EQ(prefix_with_flight(doubts, "real")[1].where, "real/odometry");
}

}  // namespace
}  // namespace tileflight::scoring::doubts_test
