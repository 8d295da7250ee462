// Frames traced in regions, each from a scene of what it shows, and in layers, each with some of the meshes, against
// the same frames traced whole.
#include "tileflight/capture/render/frame_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "tests/refusal.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::frame_parts_test {
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

template <class Image>
void expect_same_bits(const Image& a, const Image& b, const char* what) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size()) << what;
  if (a.empty()) return;
  EXPECT_EQ(std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(a.pixels[0])), 0) << what;
}

void expect_same_frame(const FlightFrame& a, const FlightFrame& b) {
  expect_same_bits(a.rgb, b.rgb, "rgb");
  expect_same_bits(a.depth_m, b.depth_m, "depth");
  expect_same_bits(a.outputs.range_m, b.outputs.range_m, "range");
  expect_same_bits(a.outputs.normals, b.outputs.normals, "normals");
  expect_same_bits(a.outputs.flow_px, b.outputs.flow_px, "flow");
  expect_same_bits(a.outputs.visibility, b.outputs.visibility, "visibility");
  ASSERT_EQ(a.outputs.objects.pixels.size(), b.outputs.objects.pixels.size());
  for (std::size_t i = 0; i < b.outputs.objects.pixels.size(); ++i) {
    const std::uint32_t label = a.outputs.objects.pixels[i], expected = b.outputs.objects.pixels[i];
    ASSERT_EQ(label == 0, expected == 0);
    if (label == 0) continue;
    ASSERT_EQ(a.objects[label - 1].tile, b.objects[expected - 1].tile);
    ASSERT_EQ(a.objects[label - 1].is_placed, b.objects[expected - 1].is_placed);
  }
  EXPECT_EQ(a.exposure_ms, b.exposure_ms);
  EXPECT_EQ(a.check.view.rays, b.check.view.rays);
  EXPECT_EQ(a.check.view.surfaces, b.check.view.surfaces);
  EXPECT_EQ(a.check.view.back_faces, b.check.view.back_faces);
  EXPECT_EQ(a.check.view.nearest_m, b.check.view.nearest_m);
  EXPECT_EQ(a.check.surroundings.above_ground_m, b.check.surroundings.above_ground_m);
  EXPECT_EQ(a.check.surroundings.clearance_m, b.check.surroundings.clearance_m);
  EXPECT_EQ(a.check.surroundings.inside, b.check.surroundings.inside);
  EXPECT_EQ(a.check.path_is_blocked, b.check.path_is_blocked);
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
        divided.add_check(check_path(scene, frames_, index, {}, options_.clearance_m, options_.inside_reach_m));
        divided.add(region, FrameRenderer(scene, camera_, frames_, {}, with_gains()).trace_region(index, region));
      }
      EXPECT_LT(fewest, 40U) << "a region's scene lacks plates";
      divided.add_check(check_path(whole_, frames_, index, {}, options_.clearance_m, options_.inside_reach_m));
      const FlightFrame sum = renderer.develop(divided.take_frame());
      expect_same_frame(sum, whole);
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

/// Buildings on a ground, all of which are there twice, with other textures and in another order; a part of the second
/// ones is divided into triangles along the other diagonal, so that which of two coincident surfaces is nearer is a
/// matter of rounding.
std::vector<imaging::TexturedMesh> doubled_city() {
  std::vector<imaging::TexturedMesh> meshes;
  const auto add = [&](int number, int copy) {
    const Vec3 centre((number % 5 - 2.0) * 18.0, (number / 5 - 2.0) * 18.0, number % 3 * 2.0);
    imaging::TexturedMesh mesh = ground(
        centre, 20.0, texture(16, 16, [=](int x, int y) { return grey(noise(x + 17 * number, y + 29 * copy)); }));
    if (copy == 1 && number % 2 == 0) {
      for (geometry::Triangle& t : mesh.mesh.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
    }
    mesh.name = "plate" + std::to_string(2 * number + copy);
    meshes.push_back(std::move(mesh));
  };
  for (int number = 0; number < 25; ++number) add(number, number % 2);
  for (int number = 24; number >= 0; --number) add(number, 1 - number % 2);
  return meshes;
}

/// Things that move over and through the city, and one that stands exactly where a plate is and is called as it is.
PlacedParts moving_things() {
  std::vector<imaging::TexturedMesh> meshes;
  for (int k = 0; k < 2; ++k) {
    meshes.push_back(
        hills({0.0, 0.0, 1.5 * k}, 9.0, 6, texture(16, 16, [k](int x, int y) { return grey(noise(x, y, 7 + k)); })));
  }
  const scene::SceneFrame frame(Vec3::Zero());
  const auto thing = std::make_shared<const scene::ScenePart>(std::move(meshes), frame);
  imaging::TexturedMesh same = doubled_city()[12];
  same.texture = texture(2, 2, [](int, int) { return grey(255); });
  const auto plate = std::make_shared<const scene::ScenePart>(std::vector{std::move(same)}, frame);
  return [thing, plate](double from_s, double to_s) {
    std::vector<scene::PlacedPart> placed{{doubled_city()[12].name, plate, {Eigen::Affine3d::Identity()}}};
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (int i = 0; i < 6; ++i) {
      const Vec3 start(30.0 * uniform(random), 30.0 * uniform(random), 3.0 + 3.0 * uniform(random));
      const Vec3 speed(12.0 * uniform(random), 12.0 * uniform(random), 2.0 * uniform(random));
      scene::PlacedPart part{"thing" + std::to_string(i), thing, {}};
      for (const double time_s : {from_s, to_s}) {
        if (time_s == from_s && !part.poses.empty()) continue;
        part.poses.push_back(
            scene::placed_at(SE3(geometry::so3_exp(Vec3(0.1, 0.2, i + time_s)), start + time_s * speed)));
      }
      placed.push_back(std::move(part));
    }
    return placed;
  };
}

/// Frames in layers of randomly chosen meshes; what is placed in them is a layer of its own.
class FramesInLayers : public testing::Test {
 protected:
  FramesInLayers() {
    for (int i = 0; i < 3; ++i)
      frames_.poses.push_back({0.1 * i, looking_along({-8.0 + 3.0 * i, 5.0, 28.0}, Vec3(0.4, 0.5, -0.7))});
    options_.outputs = {.range = true, .normals = true, .objects = true, .flow = true, .visibility = true};
    options_.inside_reach_m = 10.0;
  }

  void expect_same_frames() const {
    ASSERT_TRUE(has_one_ray_per_pixel(options_));
    const FrameRenderer renderer(whole_, camera_, frames_, {}, options_);
    std::mt19937 random(1);
    for (std::size_t index = 0; index < frames_.size(); ++index) {
      const FlightFrame whole = renderer.develop(renderer.trace(index));
      LayeredFrame layered, own, of_another;
      int number = 0;
      for (const std::vector<std::uint32_t>& ranks : layers(4, random)) {
        if (options_.placed && number == 2) {
          add_placed(index, layered);
          add_placed(index, index % 2 == 0 ? own : of_another);
        }
        add_layer(index, ranks, layered);
        add_layer(index, ranks, number++ % 2 == 0 ? own : of_another);
      }
      expect_same_frame(finished(renderer, layered), whole);
      own.add_packed(of_another.packed());
      own.add_packed(LayeredFrame().packed());
      expect_same_frame(finished(renderer, own), whole);
    }
  }
  FlightFrame finished(const FrameRenderer& renderer, LayeredFrame& frame) const {
    TracedFrame sum = frame.take_frame();
    renderer.finish_layers(sum, whole_.anchor().z());
    return renderer.develop(std::move(sum));
  }
  /// A layer with these of the doubled city's meshes.
  void add_layer(std::size_t index, const std::vector<std::uint32_t>& ranks, LayeredFrame& frame) const {
    std::vector<imaging::TexturedMesh> meshes;
    for (const std::uint32_t rank : ranks) meshes.push_back(doubled_city()[rank]);
    const Scene scene(std::move(meshes), whole_.anchor());
    FlightRenderOptions options = options_;
    options.placed = {};
    frame.add_check(check_path(scene, frames_, index, {}, options_.clearance_m, options_.inside_reach_m));
    frame.add(FrameRenderer(scene, camera_, frames_, {}, options).trace_layer(index), ranks);
  }
  /// A layer with what is placed, and nothing else.
  void add_placed(std::size_t index, LayeredFrame& frame) const {
    imaging::TexturedMesh nothing;
    nothing.mesh = {std::vector<Vec3>(3, Vec3::Zero()), {{0, 1, 2}}};
    const Scene scene({nothing}, whole_.anchor());
    frame.add(FrameRenderer(scene, camera_, frames_, {}, options_).trace_layer(index), {});
  }
  /// The meshes' numbers, dealt to layers, in increasing order.
  std::vector<std::vector<std::uint32_t>> layers(std::size_t count, std::mt19937& random) const {
    std::vector<std::vector<std::uint32_t>> all(count);
    for (std::uint32_t mesh = 0; mesh < whole_.meshes().size(); ++mesh) all[random() % count].push_back(mesh);
    return all;
  }

  imaging::Camera camera_ = imaging::make_fisheye(160, 120, 120.0);
  Scene whole_{doubled_city()};
  geometry::Trajectory frames_;
  FlightRenderOptions options_;
};

TEST_F(FramesInLayers, AreTheSameWithoutEffects) { expect_same_frames(); }

TEST_F(FramesInLayers, AreTheSameWithEveryEffectOfOneRayAPixel) {
  options_.formation.line_delay_s = 2e-5;
  options_.formation.exposure_time_s = 0.004;
  options_.formation.exposure_samples = 1;
  options_.formation.sharpening = 0.8;
  options_.formation.vignetting = 0.4;
  options_.formation.white_electrons = 2000.0;
  options_.formation.haze_visibility_m = 300.0;
  options_.render.weather =
      std::make_shared<const WeatherOptions>(WeatherOptions{.fog_visibility_m = 200.0, .wetness = 0.7});
  expect_same_frames();
}

TEST_F(FramesInLayers, AreTheSameWithThingsThatMove) {
  options_.placed = moving_things();
  options_.outputs.placed_objects = true;
  const FrameRenderer renderer(whole_, camera_, frames_, {}, options_);  // owns the frame's objects
  const TracedFrame frame = renderer.trace(0);
  const auto shown = std::ranges::count_if(frame.outputs.objects.pixels, [&](std::uint32_t label) {
    return label > 0 && frame.objects[label - 1].is_placed;
  });
  EXPECT_GT(shown, 200);
  expect_same_frames();
  options_.formation.line_delay_s = 5e-4;
  expect_same_frames();
  options_.outputs = {.placed_objects = true};
  options_.render.depth = false;
  expect_same_frames();
}

TEST_F(FramesInLayers, AreTheSameInRainAndSnow) {
  options_.placed = moving_things();
  options_.render.weather = std::make_shared<const WeatherOptions>(
      WeatherOptions{.fog_visibility_m = 200.0, .rain_mm_per_h = 40.0, .snow_mm_per_h = 2.0, .wetness = 0.7});
  expect_same_frames();
  options_.render.depth = false;
  options_.formation.line_delay_s = 2e-5;
  expect_same_frames();
}

TEST_F(FramesInLayers, AreMeteredAsTheWhole) {
  options_.formation.vignetting = 0.5;
  options_.render.samples_per_pixel = 4;
  std::mt19937 random(2);
  LayeredFrame sum;
  for (const std::vector<std::uint32_t>& ranks : layers(3, random)) {
    std::vector<imaging::TexturedMesh> meshes;
    for (const std::uint32_t rank : ranks) meshes.push_back(doubled_city()[rank]);
    const Scene scene(std::move(meshes), whole_.anchor());
    TracedLayer layer;
    layer.frame.light =
        make_light_meter(scene, camera_, options_).layer(frames_.poses[1].T_local_camera, layer.surfaces);
    sum.add(std::move(layer), ranks);
  }
  const LightMeter meter = make_light_meter(whole_, camera_, options_);
  EXPECT_EQ(meter.mean_light(sum.take_frame().light), meter_flight(whole_, camera_, frames_, options_)[1]);
}

TEST_F(FramesInLayers, RefusePackedLayersOfAnotherImage) {
  LayeredFrame own, other;
  add_layer(0, {0, 1, 2}, own);
  options_.outputs.range = false;
  add_layer(0, {3, 4, 12}, other);
  const std::string packed = other.packed();
  const auto fault_of = [](LayeredFrame& frame, const std::string& bytes) {
    return tests::message_of([&] { frame.add_packed(bytes); });
  };
  EXPECT_EQ(fault_of(own, packed), "a packed layer has other outputs");
  EXPECT_EQ(fault_of(other, packed.substr(0, packed.size() / 2)), "a packed layer ends early");
  LayeredFrame none;
  EXPECT_EQ(fault_of(none, packed), "a packed layer is of a larger image");
}

TEST_F(FramesInLayers, ShowNoObjectThatIsHidden) {
  const auto trace = [&](double height_m, const char* name, std::uint32_t rank, LayeredFrame& frame) {
    imaging::TexturedMesh mesh = ground({0.0, 0.0, height_m}, 400.0, texture(2, 2, [](int, int) { return grey(9); }));
    mesh.name = name;
    const Scene scene({std::move(mesh)}, Vec3::Zero());
    frame.add(FrameRenderer(scene, camera_, frames_, {}, options_).trace_layer(0), std::vector{rank});
  };
  LayeredFrame frame;
  trace(-3.0, "below", 0, frame);
  trace(0.0, "above", 1, frame);
  const TracedFrame sum = frame.take_frame();
  ASSERT_EQ(sum.objects.size(), 1U);
  EXPECT_EQ(sum.objects[0].tile, "above");
  EXPECT_EQ(std::ranges::count(sum.outputs.objects.pixels, 1U), sum.check.view.surfaces);
}

TEST(HasOneRayPerPixel, NotWithWhatNeedsSeveral) {
  EXPECT_TRUE(has_one_ray_per_pixel({}));
  const auto with = [](auto change) {
    FlightRenderOptions options;
    change(options);
    return has_one_ray_per_pixel(options);
  };
  EXPECT_FALSE(with([](FlightRenderOptions& o) { o.render.samples_per_pixel = 4; }));
  EXPECT_FALSE(with([](FlightRenderOptions& o) { o.formation.exposure_time_s = 0.01; }));
  EXPECT_FALSE(with([](FlightRenderOptions& o) { o.formation.chromatic_blue = 0.001; }));
  EXPECT_TRUE(with([](FlightRenderOptions& o) {
    o.render.weather = std::make_shared<const WeatherOptions>(WeatherOptions{.rain_mm_per_h = 3.0});
  })) << "drawn before the surfaces of all layers";
}

}  // namespace
}  // namespace tileflight::render::frame_parts_test
