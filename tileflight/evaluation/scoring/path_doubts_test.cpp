#include "tileflight/evaluation/scoring/path_doubts.h"

#include <gmock/gmock.h>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/evaluation/scoring/doubts.h"

namespace tileflight::scoring::path_doubts_test {
namespace {

using testing::HasSubstr;

TEST(PathDoubts, AreAnsweredWhereImagesMeasuredThePath) {
  const tests::TemporaryFolder folder;
  base::write_file(folder.path() / "odometry.json", R"({"frames": 120, "frames_tracked": 120, "lost": false,
      "doubts": [{"what": "the scale may have drifted", "where": "odometry", "how_sure": "likely", "what_to_do": "look"},
                 {"what": "the camera jumps", "where": "odometry", "how_sure": "likely", "what_to_do": "look"}],
      "path_doubts": ["the scale may have drifted"]})");
  const MapInputs map{.map = folder.path()};
  const auto answered = [&](std::size_t located, double path_error_m) {
    Doubts doubts = odometry_doubts(map);
    answer_path_doubts(map, {.tried = 20, .located = located, .path_error_m = path_error_m, .path_length_m = 50.0},
                       doubts);
    EXPECT_EQ(doubts.at(1).how_sure, "likely") << "no image shows what is between two";
    return doubts.at(0);
  };
  EXPECT_EQ(answered(18, 0.2).how_sure, "possible");
  EXPECT_THAT(answered(18, 0.2).what_to_do, HasSubstr("18 of 20 images, located in it, differ by 0.4 %"));
  EXPECT_EQ(answered(17, 0.2).how_sure, "likely") << "a part of the path is not measured";
  EXPECT_EQ(answered(20, 0.3).how_sure, "likely") << "the path is off";
  Doubts evaluated{answered(20, 0.1)};
  append_distinct(evaluated, {odometry_doubts(map)[0]});
  ASSERT_EQ(evaluated.size(), 1u) << "the answer stands in all that follows";
  answer_path_doubts({.map = folder.path() / "map.ply"}, {.tried = 20, .located = 20, .path_length_m = 9.0}, evaluated);
}

}  // namespace
}  // namespace tileflight::scoring::path_doubts_test
