// Frames traced in regions, each from a scene of what it shows, against the same frames traced whole.
#include "tileflight/render/frame_renderer.h"

#include <gtest/gtest.h>

#include <cstring>

#include "tileflight/render/test_scenes.h"

namespace tileflight::render::frame_renderer_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::PixelRegion;
using scene::Scene;
using namespace test_scenes;

constexpr int kColumns = 8, kSide_m = 20;

/// A plate of the ground's mosaic.
imaging::TexturedMesh plate(int number) {
  const Vec3 centre((number % kColumns - 3.5) * kSide_m, (number / kColumns - 3.5) * kSide_m, 0.3 * (number % 5));
  imaging::TexturedMesh mesh =
      ground(centre, kSide_m, texture(32, 32, [number](int x, int y) { return grey(noise(x + 31 * number, y)); }));
  mesh.name = "plate" + std::to_string(number);
  return mesh;
}

/// A flight over the mosaic, with every effect that works across pixels, rows or times.
class FramesInRegions : public testing::Test {
 protected:
  FramesInRegions() {
    for (int i = 0; i < 6; ++i) {
      frames_.poses.push_back({0.1 * i, looking_along({-8.0 + 3.0 * i, 5.0, 28.0}, Vec3(0.4, 0.5, -0.7))});
    }
    options_.outputs = {.range = true, .normals = true, .objects = true, .flow = true, .visibility = true};
    options_.render.samples_per_pixel = 4;
    options_.inside_reach_m = 10.0;
  }

  /// The plates that a region of a frame shows, in their order.
  std::vector<imaging::TexturedMesh> shown(std::size_t index, const PixelRegion& region) const {
    std::vector<bool> is_shown(kColumns * kColumns, false);
    FlightRenderOptions plain;
    plain.outputs.objects = true;
    plain.render.samples_per_pixel = 16;
    const FrameRenderer renderer(whole_, camera_, frames_, {}, plain);
    // A region's outermost rays lie between those of pixel centres, so its neighbours count too.
    const TracedFrame frame = renderer.trace(index);
    for (int y = std::max(0, region.y0 - 6); y < std::min(camera_.height(), region.y1 + 6); ++y) {
      for (int x = std::max(0, region.x0 - 6); x < std::min(camera_.width(), region.x1 + 6); ++x) {
        if (const std::uint32_t label = frame.outputs.objects(x, y); label > 0)
          is_shown[static_cast<std::size_t>(std::stoi(frame.objects[label - 1].tile.substr(5)))] = true;
      }
    }
    std::vector<imaging::TexturedMesh> meshes;
    for (int i = 0; i < kColumns * kColumns; ++i) {
      if (is_shown[static_cast<std::size_t>(i)]) meshes.push_back(plate(i));
    }
    return meshes;
  }
  static std::vector<imaging::TexturedMesh> all_plates() {
    std::vector<imaging::TexturedMesh> meshes;
    for (int i = 0; i < kColumns * kColumns; ++i) meshes.push_back(plate(i));
    return meshes;
  }
  template <class Image>
  static void expect_same_bits(const Image& a, const Image& b, const char* what) {
    ASSERT_EQ(a.pixels.size(), b.pixels.size()) << what;
    EXPECT_EQ(std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(a.pixels[0])), 0) << what;
  }
  void expect_same_frames() const {
    const Vec3 anchor = whole_.anchor();
    for (std::size_t index = 0; index < 2; ++index) {
      const FrameRenderer renderer(whole_, camera_, frames_, {}, options_);
      const FlightFrame whole = renderer.develop(renderer.trace(index));
      DividedFrame divided;
      std::size_t fewest = kColumns * kColumns;
      for (const PixelRegion& region : {PixelRegion{0, 0, 56, 88}, {56, 0, 160, 88}, {0, 88, 160, 120}}) {
        std::vector<imaging::TexturedMesh> meshes = shown(index, region);
        fewest = std::min(fewest, meshes.size());
        const Scene scene(std::move(meshes), anchor);
        divided.add(region, FrameRenderer(scene, camera_, frames_, {}, with_gains()).trace_region(index, region));
      }
      EXPECT_LT(fewest, 40U) << "a region's scene lacks plates";
      renderer.check_path(index, divided.check());
      const FlightFrame sum = renderer.develop(divided.take_frame());
      expect_same_bits(sum.rgb, whole.rgb, "rgb");
      expect_same_bits(sum.depth_m, whole.depth_m, "depth");
      expect_same_bits(sum.outputs.range_m, whole.outputs.range_m, "range");
      expect_same_bits(sum.outputs.normals, whole.outputs.normals, "normals");
      expect_same_bits(sum.outputs.flow_px, whole.outputs.flow_px, "flow");
      expect_same_bits(sum.outputs.visibility, whole.outputs.visibility, "visibility");
      for (std::size_t i = 0; i < whole.outputs.objects.pixels.size(); ++i) {
        const std::uint32_t a = sum.outputs.objects.pixels[i], b = whole.outputs.objects.pixels[i];
        ASSERT_EQ(a == 0, b == 0);
        if (a == 0) continue;
        ASSERT_EQ(sum.objects[a - 1].tile, whole.objects[b - 1].tile);
      }
      EXPECT_EQ(sum.exposure_ms, whole.exposure_ms);
      EXPECT_EQ(sum.check.view.rays, whole.check.view.rays);
      EXPECT_EQ(sum.check.view.surfaces, whole.check.view.surfaces);
      EXPECT_EQ(sum.check.view.nearest_m, whole.check.view.nearest_m);
      EXPECT_EQ(sum.check.surroundings.above_ground_m, whole.check.surroundings.above_ground_m);
    }
  }
  /// Gains of the automatic exposure as metered in the whole scene.
  FlightRenderOptions with_gains() const {
    FlightRenderOptions options = options_;
    if (options.formation.auto_exposure.target == 0.0) return options;
    std::vector<double> times_s;
    for (const geometry::StampedPose& pose : frames_.poses) times_s.push_back(pose.time_s);
    std::optional<AutoExposureState> settled;
    options.exposure_gains = exposure_gains(options.formation.auto_exposure, times_s,
                                            meter_flight(whole_, camera_, frames_, options_), settled);
    return options;
  }

  imaging::Camera camera_ = imaging::make_fisheye(160, 120, 120.0);
  Scene whole_{all_plates()};
  geometry::Trajectory frames_;
  FlightRenderOptions options_;
};

TEST_F(FramesInRegions, AreTheSameWithoutEffects) { expect_same_frames(); }

TEST_F(FramesInRegions, AreTheSameWithEveryEffect) {
  options_.formation.exposure_time_s = 0.004;
  options_.formation.exposure_samples = 3;
  options_.formation.line_delay_s = 2e-5;
  options_.formation.sharpening = 0.8;
  options_.formation.sharpening_radius_px = 2.0;
  options_.formation.chromatic_red = 0.002;
  options_.formation.chromatic_blue = -0.001;
  options_.formation.vignetting = 0.4;
  options_.formation.white_electrons = 2000.0;
  options_.formation.haze_visibility_m = 300.0;
  options_.formation.auto_exposure = {.target = 0.2, .time_constant_s = 0.2};
  expect_same_frames();
}

TEST_F(FramesInRegions, AreTheSameInFogAndRain) {
  WeatherOptions weather{.fog_visibility_m = 200.0, .scale_height_m = 30.0, .rain_mm_per_h = 40.0, .wetness = 0.7};
  options_.render.weather = std::make_shared<const WeatherOptions>(weather);
  expect_same_frames();
  weather.snow_mm_per_h = 2.0;
  options_.render.weather = std::make_shared<const WeatherOptions>(weather);
  options_.formation.exposure_time_s = 0.004;
  options_.formation.exposure_samples = 3;
  options_.formation.line_delay_s = 2e-5;
  options_.formation.chromatic_red = 0.002;
  options_.formation.auto_exposure = {.target = 0.2, .time_constant_s = 0.2};
  expect_same_frames();
}

TEST_F(FramesInRegions, AreMeteredAsTheWhole) {
  options_.formation.vignetting = 0.5;
  const LightMeter meter = make_light_meter(whole_, camera_, options_);
  LinearImage sum;
  for (const PixelRegion& region : {PixelRegion{0, 0, 56, 88}, {56, 0, 160, 88}, {0, 88, 160, 120}}) {
    const Scene scene(shown(1, region), whole_.anchor());
    const LightMeter part = make_light_meter(scene, camera_, options_);
    const LinearImage seen = part.image(frames_.poses[1].T_local_camera);
    if (sum.empty()) sum = LinearImage(seen.width, seen.height);
    imaging::copy_region(part.region(region), seen, sum);
  }
  EXPECT_EQ(meter.mean_light(sum), meter_flight(whole_, camera_, frames_, options_)[1]);
}

}  // namespace
}  // namespace tileflight::render::frame_renderer_test
