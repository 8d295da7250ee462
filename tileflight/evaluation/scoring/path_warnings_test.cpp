#include "tileflight/evaluation/scoring/path_warnings.h"

#include <gmock/gmock.h>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/evaluation/scoring/warnings.h"

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
    EXPECT_EQ(warnings.at(1).severity, "warning") << "no image shows what is between two";
    return warnings.at(0);
  };
  EXPECT_EQ(answered(18, 0.2).severity, "note");
  EXPECT_THAT(answered(18, 0.2).remedy, HasSubstr("18 of 20 images, located in it, differ by 0.4 %"));
  EXPECT_EQ(answered(17, 0.2).severity, "warning") << "a part of the path is not measured";
  EXPECT_EQ(answered(20, 0.3).severity, "warning") << "the path is off";
  Warnings evaluated{answered(20, 0.1)};
  append_distinct(evaluated, {odometry_warnings(map)[0]});
  ASSERT_EQ(evaluated.size(), 1u) << "the answer stands in all that follows";
  answer_path_warnings({.map = folder.path() / "map.ply"}, {.tried = 20, .located = 20, .path_length_m = 9.0},
                       evaluated);
}

}  // namespace
}  // namespace tileflight::scoring::path_warnings_test
