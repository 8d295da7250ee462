// `render` with another camera, size and length than the flight file's; and what dataset.yaml says of the frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::render_camera_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class RenderCamera : public ::testing::Test {
 protected:
  RenderCamera() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "narrow.yaml",
                          "cam0: {camera_model: pinhole, intrinsics: [600, 600, 319.5, 239.5], distortion_model: "
                          "radtan, distortion_coeffs: [0, 0, 0, 0], resolution: [640, 480]}\n");
    TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 4
speed_m_s: 8
max_frames: 6
waypoints:
  - {position: [-10, -18, 116], yaw_deg: 20, pitch_deg: -60}
  - {position: [10, -15, 116], yaw_deg: 30, pitch_deg: -60}
)");
  }

  ProgramResult render(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> call{
        "render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",  (folder_ / out).string(),     "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }
  dataset::Dataset rendered(const std::string& out, const std::vector<std::string>& more) const {
    const ProgramResult result = render(out, more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return dataset::read_dataset(folder_ / out);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(RenderCamera, OptionsStandBesideTheFlightFile) {
  const dataset::Dataset plain = rendered("plain", {});
  EXPECT_EQ(plain.frames.size(), 6U);
  const std::string narrow = (folder_ / "narrow.yaml").string();
  const dataset::Dataset other =
      rendered("other", {"--camera", narrow, "--resolution", "160,120", "--max-frames", "3"});
  EXPECT_EQ(other.frames.size(), 3U);
  EXPECT_EQ(other.calibration.camera.width(), 160);
  EXPECT_EQ(imaging::read_rgb(other.frames[0].image).height, 120);
  EXPECT_NEAR(other.calibration.camera.horizontal_fov_deg(), 2 * std::atan(320.0 / 600.0) * 180.0 / M_PI, 0.2);
  EXPECT_EQ(other.groundtruth->poses[2].T_local_camera.translation,
            plain.groundtruth->poses[2].T_local_camera.translation)
      << "the same path";
  // More frames than the flight file has do not come by asking for them.
  EXPECT_EQ(rendered("more", {"--max-frames", "100"}).frames.size(), 6U);
}

TEST_F(RenderCamera, WhatDoesNotGoIsOneLine) {
  const auto says = [&](const std::vector<std::string>& more, int exit_code, const std::string& text) {
    const ProgramResult result = render("bad", more);
    EXPECT_EQ(result.exit_code, exit_code) << more[0];
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "bad"));
  };
  says({"--resolution", "200,120"}, 1, "the aspect ratio differs");
  says({"--resolution", "8,6"}, 2, "--resolution");
  says({"--resolution", "160"}, 2, "--resolution");
  says({"--camera", (folder_ / "none.yaml").string()}, 1, "none.yaml");
  says({"--max-frames", "1"}, 2, "--max-frames");
}

TEST_F(RenderCamera, TheDatasetSaysWhatItsFrameIs) {
  const auto own = rendered("own", {"--max-frames", "2"}).metadata;
  EXPECT_EQ(own.at("frame.kind"), "tileset");
  EXPECT_EQ(own.count("frame.origin_lat"), 0U);
  const auto placed = rendered("placed", {"--max-frames", "2", "--origin", "50.8231,14.221,312.5"}).metadata;
  EXPECT_EQ(placed.at("frame.kind"), "east-north-up");
  EXPECT_EQ(placed.at("frame.origin_lat"), "50.8231");
  EXPECT_EQ(placed.at("frame.origin_lon"), "14.221");
  EXPECT_EQ(placed.at("frame.origin_height"), "312.5");

  // A filmed flight over the same place has the frame of its ground truth.
  ASSERT_EQ(run_tileflight({"extract", (folder_ / "place").string(), "--origin", "50.8231,14.221,312.5", "--voxel", "4",
                            "--out", (folder_ / "truth").string()})
                .exit_code,
            0);
  const ProgramResult ingested = run_tileflight({"ingest", (folder_ / "placed/images").string(), "--fps", "4",
                                                 "--camera", (folder_ / "placed/camera.yaml").string(), "--truth",
                                                 (folder_ / "truth").string(), "--out", (folder_ / "filmed").string()});
  ASSERT_EQ(ingested.exit_code, 0) << ingested.err;
  EXPECT_EQ(dataset::read_dataset(folder_ / "filmed").metadata.at("frame.origin_height"), "312.5");
}

}  // namespace
}  // namespace tileflight::render_camera_test
