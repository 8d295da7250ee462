// `render --outputs` writes further outputs beside the images; the place is small.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tests/run_program.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/photometric.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::render_outputs_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec2;
using geometry::Vec3;
using imaging::FloatImage;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

// Along a seam of the quarters, with the horizon in view.
constexpr const char* kFlight = R"(camera: camera.yaml
fps: 4
speed_m_s: 8
max_frames: 4
waypoints:
  - {position: [-10, -18, 112], yaw_deg: 20, pitch_deg: -30}
  - {position: [10, -15, 113], yaw_deg: 30, pitch_deg: -35}
)";

class RenderOutputs : public ::testing::Test {
 protected:
  RenderOutputs() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", kFlight);
  }

  ProgramResult render(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> call{
        "render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",  (folder_ / out).string(),     "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  tests::TemporaryFolder folder_;
};

std::set<std::string> files_of(const fs::path& folder) {
  std::set<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.insert(fs::relative(entry.path(), folder).string());
  }
  return files;
}

TEST_F(RenderOutputs, AgreeWithEachOtherAndWithTheGround) {
  const ProgramResult result = render("all", {"--outputs", "depth,range,normals,segmentation,infrared,flow,visibility",
                                              "--center-local", "0,0,100", "--size", "60,60,20", "--threads", "2"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const fs::path out = folder_ / "all";
  const dataset::Dataset set = dataset::read_dataset(out);
  const imaging::Camera& camera = set.calibration.camera;
  const geometry::SE3 T = set.groundtruth->poses[1].T_local_camera, next = set.groundtruth->poses[2].T_local_camera;
  const FloatImage depth = imaging::read_exr(out / "depth/000001.exr");
  const FloatImage range = imaging::read_exr(out / "range/000001.exr");
  const FloatImage right = imaging::read_exr_channel(out / "flow/000001.exr", "R");
  const FloatImage down = imaging::read_exr_channel(out / "flow/000001.exr", "G");
  const imaging::Gray16Image ids = imaging::read_gray16(out / "segmentation/000001.png");
  const imaging::GrayImage infrared = imaging::read_gray(out / "infrared/000001.png");
  const imaging::GrayImage visibility = imaging::read_gray(out / "visibility/000001.png");
  std::array<FloatImage, 3> normals;
  for (std::size_t c = 0; c < 3; ++c) {
    normals[c] = imaging::read_exr_channel(out / "normals/000001.exr", std::string(1, "RGB"[c]));
  }
  std::map<int, std::set<std::pair<bool, bool>>> quarters_of_id;
  int surface = 0, outside = 0, followed = 0;
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      const auto ray = camera.unproject(Vec2(x, y));
      const bool hit = std::isfinite(range(x, y));
      ASSERT_EQ(hit, ids(x, y) != 0);
      ASSERT_EQ(infrared(x, y), ids(x, y));  // there are four
      if (!hit) {
        ASSERT_EQ(visibility(x, y), 0);
        ASSERT_TRUE(std::isnan(right(x, y)) && std::isnan(normals[0](x, y)));
        continue;
      }
      ++surface;
      ASSERT_NEAR(range(x, y) * ray->z(), depth(x, y), 1e-4);
      const Vec3 point = T * (range(x, y) * *ray);
      ASSERT_NEAR(point.z(), TinyPlace::height(point.x(), point.y()), 0.1) << x << " " << y;
      const Vec3 normal(normals[0](x, y), normals[1](x, y), normals[2](x, y));
      ASSERT_NEAR(normal.norm(), 1.0, 1e-5);
      ASSERT_LT(normal.dot(*ray), 0.0);
      ASSERT_GT((T.rotation * normal).z(), 0.8);  // the hills' slopes are below 0.5
      const double to_rim_m = 30.0 - std::max(std::abs(point.x()), std::abs(point.y()));
      if (std::abs(to_rim_m) > 0.01) {
        ASSERT_EQ(visibility(x, y), to_rim_m > 0 ? 255 : 0) << point.transpose();
      }
      outside += to_rim_m < 0 ? 1 : 0;
      if (std::min(std::abs(point.x()), std::abs(point.y())) > 0.01) {
        quarters_of_id[ids(x, y)].insert({point.x() > 0, point.y() > 0});
      }
      if (std::isnan(right(x, y))) continue;
      ++followed;
      const auto pixel = camera.project(next.inverse() * point);
      ASSERT_NEAR(pixel->x(), x + right(x, y), 2e-3);
      ASSERT_NEAR(pixel->y(), y + down(x, y), 2e-3);
    }
  }
  EXPECT_GT(surface, 20000);
  EXPECT_GT(outside, 1000);
  EXPECT_GT(followed, surface / 2);
  EXPECT_GE(quarters_of_id.size(), 3U);
  for (const auto& [id, quarters] : quarters_of_id) EXPECT_EQ(quarters.size(), 1U) << id;
  EXPECT_THAT(file_text(out / "segmentation.csv"), ::testing::StartsWith("id,tile,mesh,feature,name\n1,"));
  EXPECT_FALSE(fs::exists(out / "flow/000003.exr"));  // there is no frame after it
  EXPECT_TRUE(fs::exists(out / "range/000003.exr"));
}

TEST_F(RenderOutputs, AreTheSameOnAnyNumberOfThreads) {
  for (const char* threads : {"1", "2"}) {
    const ProgramResult result = render(
        threads, {"--outputs", "depth,range,normals,segmentation,infrared,flow,visibility", "--threads", threads});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  ASSERT_FALSE(files_of(folder_ / "1").empty());
  EXPECT_EQ(files_of(folder_ / "1"), files_of(folder_ / "2"));
  for (const std::string& file : files_of(folder_ / "2")) {
    EXPECT_TRUE(file_text(folder_ / "1" / file) == file_text(folder_ / "2" / file)) << file;
  }
}

TEST_F(RenderOutputs, PhotometricFilesUndoWhatTheCameraDid) {
  constexpr double kExposure_s = 0.002;
  TinyPlace::write_file(folder_ / "degrade.yaml", R"(exposure_time: 0.002
exposure_samples: 1
vignetting: 0.5
auto_exposure: {target: 0.25, time_constant: 0.2}
exposure_steps: [{time: 0.3, gain: 0.8}]
gamma: 1.8
)");
  ASSERT_EQ(render("plain", {"--png"}).exit_code, 0);
  const ProgramResult result =
      render("camera", {"--png", "--degrade", (folder_ / "degrade.yaml").string(), "--outputs", "photometric"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const dataset::Dataset plain = dataset::read_dataset(folder_ / "plain");
  const dataset::Dataset camera = dataset::read_dataset(folder_ / "camera");
  const imaging::PhotometricCalibration calibration = imaging::read_photometric(camera.pcalib, camera.vignette);
  std::set<double> exposures;
  int compared = 0, wrong = 0;
  for (std::size_t i = 0; i < camera.frames.size(); ++i) {
    const imaging::RgbImage seen = imaging::read_rgb(camera.frames[i].image);
    const imaging::RgbImage true_colours = imaging::read_rgb(plain.frames[i].image);
    exposures.insert(camera.frames[i].exposure_ms);
    const double gain = camera.frames[i].exposure_ms / (1e3 * kExposure_s);
    for (std::size_t p = 0; p < seen.pixels.size(); ++p) {
      const int value = seen.pixels[p][1], colour = true_colours.pixels[p][1];
      if (value < 2 || value > 253 || colour < 2 || colour > 253) continue;
      // The tolerance is the rounding of both images.
      const auto light = [&](int v) {
        return calibration.inverse_response[static_cast<std::size_t>(v)] / 255.0 / calibration.vignette.pixels[p] /
               gain;
      };
      wrong += light(value - 1) < render::srgb_decode(colour + 1) && light(value + 1) > render::srgb_decode(colour - 1)
                   ? 0
                   : 1;
      ++compared;
    }
  }
  EXPECT_GT(compared, 200000);
  EXPECT_LE(wrong, 5);              // a silhouette may fall on either side of a pixel's centre
  EXPECT_EQ(exposures.size(), 3U);  // settled on the first frame, the second waits for what the first one saw
}

TEST_F(RenderOutputs, PicturesThroughAVideoCarryItsArtefactsAndOtherOutputsDoNot) {
  TinyPlace::write_file(folder_ / "degrade.yaml", "video_bitrate: 0.3\n");
  ASSERT_EQ(render("plain", {"--png", "--outputs", "depth"}).exit_code, 0);
  const ProgramResult result =
      render("video", {"--png", "--degrade", (folder_ / "degrade.yaml").string(), "--outputs", "depth"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(fs::file_size(folder_ / "video/video.mp4"), 1000U);
  const imaging::RgbImage plain = imaging::read_rgb(folder_ / "plain/images/000002.png");
  const imaging::RgbImage video = imaging::read_rgb(folder_ / "video/images/000002.png");
  double squares = 0.0;
  for (std::size_t p = 0; p < plain.pixels.size(); ++p) {
    squares += std::pow(plain.pixels[p][1] - video.pixels[p][1], 2) / static_cast<double>(plain.pixels.size());
  }
  EXPECT_GT(std::sqrt(squares), 2.0);   // grey levels
  EXPECT_LT(std::sqrt(squares), 40.0);  // still the same picture: the vertices' colours alone vary by more
  EXPECT_TRUE(file_text(folder_ / "plain/depth/000002.exr") == file_text(folder_ / "video/depth/000002.exr"));
  EXPECT_EQ(file_text(folder_ / "plain/times.txt"), file_text(folder_ / "video/times.txt"));
  TinyPlace::write_file(folder_ / "degrade.yaml", "video_bitrate: 1\nvideo_crf: 20\n");
  const ProgramResult both = render("both", {"--degrade", (folder_ / "degrade.yaml").string()});
  EXPECT_EQ(both.exit_code, 1);
  EXPECT_THAT(both.err, ::testing::HasSubstr("does not go together with 'video_crf'"));
}

TEST_F(RenderOutputs, LightBySunAndSkyNeedsAPlaceAndADay) {
  const std::vector<std::string> lit{"--png", "--degrade", (folder_ / "light.yaml").string()};
  std::vector<std::string> placed = lit;
  placed.insert(placed.end(), {"--origin", "0,0,0"});  // on the equator, at an equinox: the sun passes overhead
  TinyPlace::write_file(folder_ / "light.yaml", "light: {time: 2024-03-20T12:07:00Z}\n");
  const ProgramResult noon = render("noon", placed);
  ASSERT_EQ(noon.exit_code, 0) << noon.err;
  EXPECT_THAT(file_text(folder_ / "noon/dataset.yaml"),
              ::testing::ContainsRegex("sun (89\\.[5-9]|90\\.0) degrees high"));
  TinyPlace::write_file(folder_ / "light.yaml", "light: {time: 2024-03-20T16:07:00Z}\n");  // an hour is 15 degrees
  ASSERT_EQ(render("evening", placed).exit_code, 0);
  EXPECT_THAT(file_text(folder_ / "evening/dataset.yaml"),
              ::testing::ContainsRegex("sun (29\\.[5-9]|30\\.[0-5]) degrees high, azimuth (269|270|271)"));
  EXPECT_FALSE(file_text(folder_ / "noon/images/000001.png") == file_text(folder_ / "evening/images/000001.png"));

  const auto expect_refused = [&](const std::string& light, const std::vector<std::string>& more, const char* words) {
    TinyPlace::write_file(folder_ / "light.yaml", light);
    const ProgramResult result = render("refused", more);
    EXPECT_EQ(result.exit_code, 1) << light;
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, ::testing::HasSubstr(words));
    EXPECT_FALSE(fs::exists(folder_ / "refused"));
  };
  expect_refused("light: {time: 2024-03-20T23:00:00Z}\n", placed, "below the horizon");
  expect_refused("light: {}\n", placed, "has no time");
  expect_refused("light: {time: 2024-02-30T12:00:00Z}\n", placed, "a valid date and time");
  expect_refused("light: {time: 2024-03-20T12:07:00Z}\n", lit, "origin");
}

TEST_F(RenderOutputs, DepthAloneIsAFlagAndWordsAreChecked) {
  ASSERT_EQ(render("depth", {"--depth"}).exit_code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "depth/depth/000002.exr"));
  for (const char* other : {"range", "normals", "segmentation", "segmentation.csv", "flow", "visibility"}) {
    EXPECT_FALSE(fs::exists(folder_ / "depth" / other)) << other;
  }
  const ProgramResult wrong = render("wrong", {"--outputs", "depth,floe"});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_EQ(tests::line_count(wrong.err), 1) << wrong.err;
  EXPECT_THAT(wrong.err, ::testing::HasSubstr("--outputs: names 'floe', which is not an output; did you mean 'flow'?"));
  EXPECT_FALSE(fs::exists(folder_ / "wrong"));
}

}  // namespace
}  // namespace tileflight::render_outputs_test
