// `localize`: where each image of a flight was, against the place, from a ground truth and an odometry or from the
// tiles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/all_stages.h"
#include "tests/refused_command.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::localize_command_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::run_tileflight;

class LocalizeCommand : public ::testing::Test {
 protected:
  /// Locates the images of a flight of AllStages into `out`; `more`: further words.
  json localize(const std::string& flight, const std::vector<std::string>& more) {
    const fs::path folder = stages_ / "run" / flight;
    std::vector<std::string> words{"localize", (folder / "dataset").string(), "--out", out_.string(), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const tests::ProgramResult result = run_tileflight(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out);
  }
  std::vector<std::string> from_results(const std::string& flight) const {
    return {"--to", (stages_ / "run/truth").string(), "--odometry", (stages_ / "run" / flight / "odometry").string()};
  }

  /// Mean of the squared position errors, and of the same over the squared sigmas of quality.csv.
  struct Errors {
    double rms_m = 0.0, ratio = 0.0;
  };
  Errors errors(const std::string& flight) const {
    const auto truth = geometry::read_tum(stages_ / "run" / flight / "dataset/groundtruth.txt");
    const auto path = geometry::read_tum(out_ / "trajectory.txt");
    std::istringstream table(tests::file_text(out_ / "quality.csv"));
    std::string line;
    std::getline(table, line);
    EXPECT_EQ(line,
              "frame,time_s,source,sigma_east_m,sigma_north_m,sigma_up_m,sigma_position_m,sigma_rotation_deg,"
              "correlation,share_in_view,deviation,scale");
    EXPECT_EQ(path.size(), truth.size());
    Errors sum;
    for (std::size_t i = 0; i < truth.size() && std::getline(table, line); ++i) {
      std::istringstream fields(line);
      std::string field;
      for (int column = 0; column <= 6; ++column) std::getline(fields, field, ',');
      const double error =
          (path.poses[i].T_local_camera.translation - truth.poses[i].T_local_camera.translation).norm();
      sum.rms_m += error * error / static_cast<double>(truth.size());
      sum.ratio += std::pow(error / std::stod(field), 2) / static_cast<double>(truth.size());
    }
    sum.rms_m = std::sqrt(sum.rms_m);
    return sum;
  }

  fs::path stages_ = tests::AllStages::usual().made();
  tests::TemporaryFolder folder_;
  fs::path out_ = folder_ / "located";
};

TEST_F(LocalizeCommand, FindsEveryImageOfAFlight) {
  const json about = localize("simulated", from_results("simulated"));
  EXPECT_EQ(about.at("images"), 50);
  EXPECT_EQ(about.at("located"), 50);
  EXPECT_TRUE(about.at("lost").empty());
  EXPECT_EQ(about, json::parse(tests::file_text(out_ / "localize.json")));
  EXPECT_LT(errors("simulated").rms_m, 0.02);
}

TEST_F(LocalizeCommand, FindsTheImagesOfABadCameraWithHonestSigmas) {
  localize("real", from_results("real"));
  const Errors found = errors("real");
  EXPECT_LT(found.rms_m, 0.05);
  EXPECT_GT(found.ratio, 0.1);
  EXPECT_LT(found.ratio, 4.0);
}

TEST_F(LocalizeCommand, FindsTheFlightWithoutItsPositions) {
  std::vector<std::string> words = from_results("simulated");
  words.emplace_back("--search");
  localize("simulated", words);
  EXPECT_LT(errors("simulated").rms_m, 0.02);
}

TEST_F(LocalizeCommand, TakesATilesetAndTracksTheImagesItself) {
  localize("simulated", {"--to", (stages_ / "place").string(), "--center-local", "0,0,100", "--size", "80,80,20"});
  EXPECT_LT(errors("simulated").rms_m, 0.02);
  for (const char* file : {"odometry/odometry.json", "place/extract.json", "transform.json"})
    EXPECT_TRUE(fs::exists(out_ / file)) << file;
}

/// The second flight's path is compared with where its images are in the tiles; the built-in place knows the true
/// poses.
TEST_F(LocalizeCommand, AReferenceStandsInTheErrorBudget) {
  const auto budget = [&](const std::string& flight) {
    return json::parse(tests::file_text(stages_ / "run" / flight / "metrics.json")).at("error_budget");
  };
  EXPECT_TRUE(budget("simulated").at("reference").is_null());
  const json located = budget("real");
  out_ = stages_ / "run/real/localized";
  const double error_m = errors("real").rms_m, stated_m = located.at("reference").at("metres");
  EXPECT_GT(stated_m, 0.5 * error_m);
  EXPECT_LT(stated_m, 4.0 * error_m);
  EXPECT_TRUE(located.at("path").at("metres").is_number());
}

TEST_F(LocalizeCommand, RefusesInOneLineWhatItCannotUse) {
  const std::string dataset = (stages_ / "run/simulated/dataset").string(), truth = (stages_ / "run/truth").string();
  const auto refused = [&](std::vector<std::string> words, const std::string& message) {
    words.insert(words.begin(), "localize");
    words.insert(words.end(), {"--out", out_.string()});
    tests::expect_one_line_refusal(run_tileflight(words), message);
    EXPECT_FALSE(fs::exists(out_));
  };
  refused({"nowhere", "--to", truth}, "nowhere: no such dataset folder");
  refused({dataset, "--to", "nowhere"}, "nowhere: no such file or folder");
  refused({dataset, "--to", truth, "--odometry", dataset}, "has no trajectory.txt");
}

}  // namespace
}  // namespace tileflight::localize_command_test
