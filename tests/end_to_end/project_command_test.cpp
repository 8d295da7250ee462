#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/tiny_experiments.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/video/video.h"

namespace tileflight {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyExperiments;
using tests::TinyPlace;

/// A rendered flight as a camera would leave it: a video, and subtitles with positions beside it.
class ARecording : public ::testing::Test {
 protected:
  static constexpr const char* kOrigin = "47,8,0";

  ARecording() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", TinyExperiments::flight(TinyExperiments::kFramesOfTwo));
    const ProgramResult rendered =
        run_tileflight({"render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(), "--out",
                        (folder_ / "rendered").string(), "--quiet"});
    if (rendered.exit_code != 0) throw std::runtime_error(rendered.err);
    fs::create_directories(folder_ / "card");
    const dataset::Dataset data = dataset::read_dataset(folder_ / "rendered");
    video::VideoWriter video(folder_ / "card/DJI_0001.MP4", 320, 240,
                             {.frames_per_second = 10.0, .compression = {.crf = 12}});
    for (const dataset::Frame& frame : data.frames) video.add(imaging::read_rgb(frame.image));
    video.finish();
    base::write_file(folder_ / "card/DJI_0001.SRT", subtitles());
  }

  /// Heights above the sea, as most receivers have them.
  std::string subtitles() const {
    const geometry::LocalFrame frame({47.0, 8.0, {0.0}});
    std::string text;
    int number = 0;
    for (const geometry::StampedPose& pose : geometry::read_tum(folder_ / "rendered/groundtruth.txt").poses) {
      const geometry::Geodetic place = frame.geodetic_from_local(pose.T_local_camera.translation);
      const int ms = static_cast<int>(1000 * pose.time_s + 0.5);
      text += base::formatted("%d\n00:00:%02d,%03d --> 00:00:%02d,%03d\n", ++number, ms / 1000, ms % 1000,
                              (ms + 50) / 1000, (ms + 50) % 1000);
      text += base::formatted("[latitude: %.9f] [longitude: %.9f] [altitude: %.3f]\n\n", place.latitude_deg,
                              place.longitude_deg, geometry::orthometric_from_ellipsoidal(place).m);
    }
    return text;
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  tests::TemporaryFolder folder_;
};

TEST_F(ARecording, BecomesAScoredMapByOneCommand) {
  const std::vector<std::string> call{
      "run",      path("card/DJI_0001.MP4"), "--place", path("place"), "--origin", kOrigin,
      "--camera", path("camera.yaml"),       "--out",   path("out")};
  const ProgramResult result = run_tileflight(call);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("DJI_0001.SRT"));
  const json results = base::read_json(folder_ / "out/results.json");
  EXPECT_EQ(results["real"]["kind"], "video");
  EXPECT_EQ(results["real"]["odometry"]["frames_tracked"], TinyExperiments::kFramesOfTwo);
  EXPECT_LT(results["real"]["surface"]["median"].get<double>(), 0.5);
  EXPECT_LT(results["simulated"]["surface"]["median"].get<double>(), 0.5);
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
  // The path is compared with the recorded positions; an error that may be the receiver's decides no prediction.
  EXPECT_LT(results["real"]["trajectory"]["ate_rmse"].get<double>(), 0.5);
  EXPECT_NEAR(results["real"]["trajectory"]["receiver"]["expected_rmse_m"].get<double>(), std::sqrt(6.0), 1e-6);
  EXPECT_THAT(results["comparison"].dump(), Not(HasSubstr("ate_rmse")));
  // A changed project is not made again.
  const fs::path experiment = folder_ / "out/project/experiment.yaml";
  std::string text = base::read_text(experiment);
  text.replace(text.find("name: \"DJI_0001\""), 16, "name: \"mine\"");
  base::write_file(experiment, text);
  const ProgramResult again = run_tileflight(call);
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("as it is"));
  EXPECT_EQ(base::read_json(folder_ / "out/results.json")["name"], "mine");
}

TEST_F(ARecording, WithoutAPlaceHasAPath) {
  const ProgramResult result = run_tileflight(
      {"run", path("card/DJI_0001.MP4"), "--camera", path("camera.yaml"), "--out", path("out"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json results = json::parse(result.out);
  EXPECT_TRUE(results["truth"].is_null());
  EXPECT_TRUE(results["comparison"].is_null());
  // The excerpt begins where the image moves.
  EXPECT_GE(results["real"]["odometry"]["frames_tracked"].get<int>(), 45);
  EXPECT_LT(results["real"]["trajectory"]["ate_rmse"].get<double>(), 0.3);
  EXPECT_THAT(results["warnings"].dump(), HasSubstr("no place is given"));
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
}

TEST_F(ARecording, InPartsGoesThroughAnotherSystem) {
  fs::copy(folder_ / "card/DJI_0001.MP4", folder_ / "card/DJI_0002.MP4");
  fs::create_directories(folder_ / "slam");
  TinyPlace::write_file(folder_ / "slam/adapter.yaml",
                        "name: mine\ntitle: My SLAM\ntakes: {inputs: [images], lenses: [any]}\n");
  TinyPlace::write_file(folder_ / "slam/run",
                        "#!/bin/sh\nwhile read -r name time rest; do echo $time $time 0 0 0 0 0 1; done < "
                        "\"$DATASET/times.txt\" > \"$OUT/trajectory.txt\"\n");
  fs::permissions(folder_ / "slam/run", fs::perms::owner_all);
  const auto call = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{"run",      path("card/DJI_0001.MP4"), path("card/DJI_0002.MP4"),
                                   "--camera", path("camera.yaml"),       "--out",
                                   path("out")};
    words.insert(words.end(), more.begin(), more.end());
    return run_tileflight(words);
  };
  const ProgramResult result = call({"--from", "4", "--to", "6.05", "--system", path("slam"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json odometry = json::parse(result.out)["real"]["odometry"];
  EXPECT_EQ(odometry["system"]["title"], "My SLAM");
  EXPECT_EQ(odometry["frames_tracked"], 21) << "on both sides of the 5 s at which the second part begins";
  const std::string experiment = base::read_text(folder_ / "out/project/experiment.yaml");
  EXPECT_THAT(experiment, HasSubstr("/slam\""));
  EXPECT_THAT(experiment, HasSubstr("DJI_0002.MP4"));
  const ProgramResult other = call({"--system", "tileflight"});
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err, HasSubstr("was made without `--system tileflight`"));
  const ProgramResult mixed =
      run_tileflight({"run", path("card/DJI_0001.MP4"), path("flight.yaml"), "--out", path("x")});
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_THAT(mixed.err, HasSubstr("flight.yaml"));
}

TEST_F(ARecording, IsRefusedWithTheOptionsOfAnExperiment) {
  const ProgramResult result =
      run_tileflight({"run", path("flight.yaml"), "--place", path("place"), "--out", path("out")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("is for a video or photos"));
}

}  // namespace
}  // namespace tileflight
