#include "tileflight/evaluation/scoring/evaluate_trajectories.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::scoring::evaluate_trajectories_test {
namespace {

using testing::HasSubstr;

class TrajectoriesAlone : public testing::Test {
 protected:
  /// Writes a curved flight, with each quaternion as x, y, z, w or as w, x, y, z.
  void write(const std::string& name, bool has_w_first) const {
    std::string text;
    for (int i = 0; i < 80; ++i) {
      const Eigen::Quaterniond q = geometry::so3_exp({0.02 * i, 0.3 + 0.05 * i, 0.1 * std::sin(0.2 * i)});
      std::vector<double> numbers{0.1 * i, 10 * std::sin(0.05 * i), 8 * std::cos(0.03 * i), 0.2 * i};
      if (has_w_first) numbers.push_back(q.w());
      numbers.insert(numbers.end(), {q.x(), q.y(), q.z()});
      if (!has_w_first) numbers.push_back(q.w());
      for (const double number : numbers) {
        base::append_number(text, number);
        text += ' ';
      }
      text += '\n';
    }
    base::write_file(folder_ / name, text);
  }
  nlohmann::json evaluate(const std::string& estimate, const std::string& truth) const {
    return evaluate_trajectories({.estimates = {folder_ / estimate}, .truth = folder_ / truth}, folder_ / "m.json");
  }

  tests::TemporaryFolder folder_;
};

TEST_F(TrajectoriesAlone, AQuaternionWithWFirstIsNamed) {
  write("usual.txt", false);
  write("w-first.txt", true);
  EXPECT_TRUE(evaluate("usual.txt", "usual.txt")["warnings"].empty());
  const nlohmann::json estimate = evaluate("w-first.txt", "usual.txt")["warnings"];
  ASSERT_EQ(estimate.size(), 1U);
  EXPECT_EQ(estimate[0]["severity"], "warning");
  EXPECT_THAT(estimate[0]["message"].get<std::string>(), HasSubstr("the estimate with w first"));
  EXPECT_THAT(evaluate("usual.txt", "w-first.txt")["warnings"].dump(), HasSubstr("the truth with w first"));
  base::write_file(folder_ / "named.txt",
                   "# timestamp tx ty tz qw qx qy qz\n" + base::read_text(folder_ / "w-first.txt"));
  const nlohmann::json named = evaluate("named.txt", "usual.txt");
  EXPECT_TRUE(named["warnings"].empty());
  EXPECT_LT(named["trajectory"]["rpe_frames"][0]["rotation_rmse_deg"], 1e-6);
}

TEST_F(TrajectoriesAlone, AGapInTheMiddleIsNamed) {
  write("truth.txt", false);
  std::string part;
  std::istringstream lines(base::read_text(folder_ / "truth.txt"));
  std::string line;
  for (int i = 0; std::getline(lines, line); ++i)
    if (i < 20 || i >= 52) part += line + "\n";
  base::write_file(folder_ / "gap.txt", part);
  const nlohmann::json result = evaluate("gap.txt", "truth.txt");
  EXPECT_NEAR(result["trajectory"]["time_covered"], (7.9 - 3.3) / 7.9, 1e-9);
  ASSERT_EQ(result["warnings"].size(), 2U);
  EXPECT_THAT(result["warnings"][0]["message"].get<std::string>(),
              HasSubstr("the estimate covers 58 % of the truth's time"));
  EXPECT_THAT(result["warnings"][1]["message"].get<std::string>(),
              HasSubstr("no poses from 1.90 to 5.20 s: 42 % of the"));
  EXPECT_EQ(result["warnings"][1]["severity"], "warning");
}

}  // namespace
}  // namespace tileflight::scoring::evaluate_trajectories_test
