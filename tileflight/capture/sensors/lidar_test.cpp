#include "tileflight/capture/sensors/lidar.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::lidar_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// sRGB of a mid grey, and its linear value.
constexpr int kGrey = 188;
const double kAlbedo = render::srgb_decode(kGrey);

imaging::TexturedMesh square(const Vec3& corner, const Vec3& side, const Vec3& other, int grey = kGrey) {
  imaging::TexturedMesh mesh;
  mesh.mesh.vertices = {corner, corner + side, corner + side + other, corner + other};
  mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.uv = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.texture = render::test_scenes::texture(4, 4, [=](int, int) { return render::test_scenes::grey(grey); });
  return mesh;
}

const Vec3 kLow(-4, -7, -2), kHigh(9, 5, 3);

scene::Scene closed_box() {
  const Vec3 e = kHigh - kLow, x(e.x(), 0, 0), y(0, e.y(), 0), z(0, 0, e.z());
  return scene::Scene({square(kLow, x, y), square(kLow, x, z), square(kLow, y, z), square(kLow + x, y, z),
                       square(kLow + y, x, z), square(kLow + z, x, y)});
}

scene::Scene ground() { return scene::Scene({square(Vec3(-500, -500, 0), Vec3(1000, 0, 0), Vec3(0, 1000, 0))}); }

/// Distance from inside the box to its walls (slab method).
double distance_to_walls(const Vec3& origin, const Vec3& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double wall = direction[axis] > 0 ? kHigh[axis] : kLow[axis];
    if (direction[axis] != 0.0) nearest = std::min(nearest, (wall - origin[axis]) / direction[axis]);
  }
  return nearest;
}

LidarOptions exact(const LidarPattern& pattern) {
  LidarOptions options;
  options.pattern = pattern;
  options.min_range_m = 0.0;
  options.max_range_m = 1000.0;
  options.range_sigma_m = 0.0;
  return options;
}

render::PoseFunction still(const SE3& T_local_camera) {
  return [=](double) { return T_local_camera; };
}

LidarOptions looking_down(const LidarPattern& pattern) {
  LidarOptions options = exact(pattern);
  // Forward is down, left is west (a camera that looks straight down has its top to the north).
  options.T_camera_lidar = LidarOptions::upright_on_camera();
  return options;
}

TEST(Lidar, InAClosedBoxEveryBeamMeetsItsWall) {
  const scene::Scene scene = closed_box();
  const SE3 T_local_camera = render::test_scenes::looking_along(Vec3(1, -2, 0.5), Vec3(0.3, 1, 0.2));
  const Lidar lidar(scene, exact(lidar_preset("vlp-16").pattern));
  const LidarScan scan = lidar.scan(0, 5.0, still(T_local_camera));
  EXPECT_EQ(scan.points.size(), scan.beams);
  EXPECT_EQ(scan.time_s, 5.0);
  const std::vector<LidarBeam> beams = generate_beams(lidar_preset("vlp-16").pattern, 0);
  for (std::size_t i = 0; i < beams.size(); ++i) {
    const Vec3 direction = scan.T_local_lidar.rotation * beams[i].direction;
    ASSERT_NEAR(scan.points[i].position.cast<double>().norm(),
                distance_to_walls(scan.T_local_lidar.translation, direction), 2e-5);
    ASSERT_LT((scan.points[i].position.cast<double>().normalized() - beams[i].direction).norm(), 1e-6);
    ASSERT_EQ(scan.points[i].ring, beams[i].ring);
    ASSERT_FLOAT_EQ(scan.points[i].time_s, static_cast<float>(beams[i].time_s));
  }
}

// Down on a plane 20 m below: range 20 / cos, intensity albedo * cos, with the distance's square if wanted.
TEST(Lidar, OnAPlaneRangeAndIntensityFollowTheIncidence) {
  const scene::Scene scene = ground();
  const RasterPattern pattern{.columns = 31, .rows = 21, .horizontal_fov_deg = 80, .vertical_fov_deg = 60};
  LidarOptions options = looking_down(pattern);
  const render::PoseFunction pose = still(render::test_scenes::looking_down(Vec3(3, 4, 20)));
  const LidarScan scan = Lidar(scene, options).scan(0, 0.0, pose);
  options.intensity_falls_with_range = true;
  options.intensity_reference_m = 10.0;
  const LidarScan falling = Lidar(scene, options).scan(0, 0.0, pose);
  ASSERT_EQ(scan.points.size(), 31U * 21U);
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Vec3 p = scan.points[i].position.cast<double>();
    const double cosine = p.x() / p.norm();
    ASSERT_NEAR(p.x(), 20.0, 1e-5);
    ASSERT_NEAR(scan.points[i].intensity, kAlbedo * cosine, 2e-3);
    ASSERT_NEAR(falling.points[i].intensity, kAlbedo * cosine * std::pow(10.0 / p.norm(), 2), 2e-3);
  }
}

// The camera moves east at 15 m/s and turns; what the lidar says in its own frame then, put back with the motion, is
// the ground, and corrected points are that in the frame of the start.
TEST(Lidar, MotionDistortsAScanAndCanBeTakenOut) {
  const scene::Scene scene = ground();
  const RasterPattern pattern{
      .rate_hz = 5.0, .columns = 20, .rows = 20, .horizontal_fov_deg = 50, .vertical_fov_deg = 50};
  const render::PoseFunction moving = [](double t) {
    SE3 T = render::test_scenes::looking_down(Vec3(15 * t, 2 * t, 30 + t));
    T.rotation = T.rotation * geometry::so3_exp(Vec3(0.3 * t, -0.2 * t, 0.5 * t));
    return T;
  };
  LidarOptions options = looking_down(pattern);
  const auto scan_with = [&](ScanMotion motion) {
    options.motion = motion;
    return Lidar(scene, options).scan(0, 1.0, moving);
  };
  const LidarScan distorted = scan_with(ScanMotion::kDistorted), corrected = scan_with(ScanMotion::kCorrected),
                  frozen = scan_with(ScanMotion::kFrozen);
  ASSERT_EQ(distorted.points.size(), corrected.points.size());
  double distortion_m = 0.0;
  for (std::size_t i = 0; i < distorted.points.size(); ++i) {
    const SE3 T_local_lidar = moving(1.0 + distorted.points[i].time_s) * options.T_camera_lidar;
    const Vec3 put_back = T_local_lidar * distorted.points[i].position.cast<double>();
    const Vec3 by_start = corrected.T_local_lidar * corrected.points[i].position.cast<double>();
    ASSERT_NEAR(put_back.z(), 0.0, 1e-4);
    ASSERT_LT((put_back - by_start).norm(), 1e-4);
    ASSERT_NEAR((frozen.T_local_lidar * frozen.points[i].position.cast<double>()).z(), 0.0, 1e-4);
    const Vec3 as_if_still = distorted.T_local_lidar * distorted.points[i].position.cast<double>();
    distortion_m = std::max(distortion_m, (as_if_still - by_start).norm());
  }
  EXPECT_GT(distortion_m, 3.0);  // 15 m/s for a fifth of a second
}

TEST(Lidar, RangeNoiseHasItsSize) {
  const scene::Scene scene = ground();
  LidarOptions options = looking_down(RasterPattern{.columns = 100, .rows = 100, .vertical_fov_deg = 40});
  options.range_sigma_m = 0.03;
  options.range_sigma_share = 0.001;
  const render::PoseFunction pose = still(render::test_scenes::looking_down(Vec3(0, 0, 40)));
  const LidarScan scan = Lidar(scene, options).scan(0, 0.0, pose);
  double sum = 0.0, squares = 0.0;
  for (const LidarPoint& point : scan.points) {
    const double range = point.position.cast<double>().norm(), truth = 40.0 * range / point.position.x();
    const double normal = (range - truth) / std::hypot(0.03, 0.001 * truth);
    sum += normal;
    squares += normal * normal;
  }
  EXPECT_NEAR(sum / 1e4, 0.0, 0.04);
  EXPECT_NEAR(std::sqrt(squares / 1e4), 1.0, 0.03);
}

// albedo cos >= (r / white)^2 with r = h / cos: cos^3 >= (h / white)^2 / albedo.
TEST(Lidar, WeakReturnsAreLost) {
  const scene::Scene scene = ground();
  LidarOptions options =
      looking_down(RasterPattern{.columns = 61, .rows = 61, .horizontal_fov_deg = 120, .vertical_fov_deg = 120});
  options.white_range_m = 60.0;
  const render::PoseFunction pose = still(render::test_scenes::looking_down(Vec3(0, 0, 30)));
  const LidarScan scan = Lidar(scene, options).scan(0, 0.0, pose);
  const double least_cosine = std::cbrt(0.25 / kAlbedo);
  std::size_t expected = 0;
  for (const LidarBeam& beam : generate_beams(options.pattern, 0))
    expected += beam.direction.x() > least_cosine ? 1 : 0;
  EXPECT_GT(expected, 500U);
  EXPECT_NEAR(static_cast<double>(scan.points.size()), static_cast<double>(expected), 2.0);
  for (const LidarPoint& point : scan.points)
    EXPECT_GT(point.position.x() / point.position.norm(), least_cosine - 1e-3);

  options.white_range_m = std::numeric_limits<double>::infinity();
  options.max_incidence_deg = 30.0;
  const LidarScan steep = Lidar(scene, options).scan(0, 0.0, pose);
  ASSERT_FALSE(steep.points.empty());
  for (const LidarPoint& point : steep.points)
    EXPECT_GT(point.position.x() / point.position.norm(), std::cos(30.01 * M_PI / 180));
  options.max_incidence_deg = 90.0;
  options.dropout_share = 0.25;
  const LidarScan thinned = Lidar(scene, options).scan(0, 0.0, pose);
  EXPECT_NEAR(static_cast<double>(thinned.points.size()) / 3721.0, 0.75, 0.03);
}

TEST(Lidar, NeitherNearerNorFartherThanItsLimits) {
  const scene::Scene scene = ground();
  LidarOptions options =
      looking_down(RasterPattern{.columns = 41, .rows = 41, .horizontal_fov_deg = 140, .vertical_fov_deg = 100});
  options.min_range_m = 22.0;
  options.max_range_m = 40.0;
  const LidarScan scan = Lidar(scene, options).scan(0, 0.0, still(render::test_scenes::looking_down(Vec3(0, 0, 20))));
  EXPECT_GT(scan.points.size(), 300U);
  EXPECT_LT(scan.points.size(), 1681U);
  for (const LidarPoint& point : scan.points) {
    EXPECT_GE(point.position.norm(), 22.0F);
    EXPECT_LE(point.position.norm(), 40.0F);
  }
}

TEST(Lidar, WhatIsDarkToTheEyeMayBeBrightToALaser) {
  const scene::Scene scene = ground();
  LidarOptions options = looking_down(RasterPattern{.columns = 3, .rows = 3});
  const render::PoseFunction pose = still(render::test_scenes::looking_down(Vec3(0, 0, 20)));
  const auto intensity_at = [&](double gain) {
    options.albedo_gain = gain;
    return Lidar(scene, options).scan(0, 0.0, pose).points.at(4).intensity;  // straight down
  };
  EXPECT_NEAR(intensity_at(1.5), 1.5 * kAlbedo, 3e-3);
  EXPECT_NEAR(intensity_at(10.0), 1.0, 1e-6);
}

TEST(Lidar, TheColourUnderTheBeamMakesTheIntensity) {
  std::vector<imaging::TexturedMesh> meshes;
  meshes.push_back(square(Vec3(-50, -50, 0), Vec3(50, 0, 0), Vec3(0, 100, 0), 255));
  meshes.push_back(square(Vec3(0, -50, 0), Vec3(50, 0, 0), Vec3(0, 100, 0), 60));
  meshes[1].texture = nullptr;  // red by its base colour alone
  meshes[1].uv.clear();
  meshes[1].base_color = {0.5F, 0.0F, 0.0F, 1.0F};
  const scene::Scene scene(std::move(meshes));
  const LidarOptions options = looking_down(RasterPattern{.columns = 10, .rows = 2, .horizontal_fov_deg = 60});
  for (const LidarPoint& point :
       Lidar(scene, options).scan(0, 0.0, still(render::test_scenes::looking_down(Vec3(0, 0, 10)))).points) {
    const double cosine = point.position.x() / point.position.norm();
    const double albedo = point.position.y() > 0 ? 1.0 : 0.5 * 0.2126;  // left is west
    EXPECT_NEAR(point.intensity, albedo * cosine, 3e-3);
  }
}

void expect_same(const LidarScan& a, const LidarScan& b) {
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    ASSERT_EQ(a.points[i].position, b.points[i].position);
    ASSERT_EQ(a.points[i].intensity, b.points[i].intensity);
  }
}

TEST(Lidar, ThreadsChangeNothingAndTheSeedDecides) {
  const scene::Scene scene = closed_box();
  LidarOptions options = lidar_preset("livox-mid-40");
  options.dropout_share = 0.1;
  const render::PoseFunction pose = still(render::test_scenes::looking_along(Vec3(1, -2, 0.5), Vec3(0.3, 1, 0.2)));
  const Lidar lidar(scene, options);
  const LidarScan many = lidar.scan(4, 0.4, pose);
  {
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    expect_same(lidar.scan(4, 0.4, pose), many);
  }
  options.seed = 2;
  EXPECT_NE(Lidar(scene, options).scan(4, 0.4, pose).points.at(0).position, many.points.at(0).position);
  EXPECT_NE(lidar.scan(5, 0.5, pose).points.at(0).position, many.points.at(0).position);
}

TEST(Lidar, RefusesImpossibleOptions) {
  const scene::Scene scene = ground();
  LidarOptions options = exact(RasterPattern{});
  options.max_range_m = -1.0;
  EXPECT_THAT([&] { Lidar(scene, options); },
              ThrowsMessage<InputError>(HasSubstr("lidar max_range: must be more than min_range")));
  options = exact(RasterPattern{});
  options.dropout_share = 2.0;
  EXPECT_THAT([&] { Lidar(scene, options); },
              ThrowsMessage<InputError>(HasSubstr("lidar dropout_share: must be 0 to 1")));
}

}  // namespace
}  // namespace tileflight::sensors::lidar_test

namespace tileflight::sensors::lidar_pattern_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

double elevation_deg(const LidarBeam& beam) { return std::asin(beam.direction.z()) * 180.0 / M_PI; }
double azimuth_deg(const LidarBeam& beam) { return std::atan2(-beam.direction.y(), beam.direction.x()) * 180.0 / M_PI; }

void expect_sound(const LidarPattern& pattern, std::uint64_t scan) {
  const std::vector<LidarBeam> beams = generate_beams(pattern, scan);
  for (std::size_t i = 0; i < beams.size(); ++i) {
    ASSERT_NEAR(beams[i].direction.norm(), 1.0, 1e-12);
    ASSERT_GE(beams[i].time_s, i == 0 ? 0.0 : beams[i - 1].time_s);
    ASSERT_LT(beams[i].time_s, scan_period_s(pattern));
  }
}

double points_per_second(const std::string& preset) {
  const LidarPattern pattern = lidar_preset(preset).pattern;
  expect_sound(pattern, 0);
  expect_sound(pattern, 7);
  return static_cast<double>(generate_beams(pattern, 3).size()) / scan_period_s(pattern);
}

TEST(LidarPattern, PresetsFireAsOftenAsTheirDataSheetsSay) {
  EXPECT_NEAR(points_per_second("vlp-16"), 16 / 55.296e-6, 100.0);
  EXPECT_NEAR(points_per_second("os1-64"), 655360, 1.0);
  EXPECT_NEAR(points_per_second("hdl-64e"), 1.333e6, 1000.0);
  EXPECT_NEAR(points_per_second("livox-mid-40"), 1e5, 1.0);
  EXPECT_THAT([&] { lidar_preset("radar"); }, ThrowsMessage<InputError>(HasSubstr("lidar 'radar': is unknown")));
}

// VLP-16, table 9-1: laser 0 at -15 degrees, 1 at 1, 2 at -13; ring 0 is the lowest.
TEST(LidarPattern, ChannelsFireInTurnAndAreCountedFromBelow) {
  const std::vector<LidarBeam> beams = generate_beams(lidar_preset("vlp-16").pattern, 0);
  const double expected[] = {-15, 1, -13, 3};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(elevation_deg(beams[i]), expected[i], 1e-9);
    EXPECT_NEAR(beams[i].time_s, 2.304e-6 * static_cast<double>(i), 1e-12);
    EXPECT_EQ(beams[i].ring, (expected[i] + 15) / 2);
  }
  EXPECT_NEAR(beams[16].time_s, 0.1 / 1808, 1e-12);
  // A quarter of a turn after the start at the back it looks left (clockwise from above), after half of it forward.
  EXPECT_NEAR(azimuth_deg(beams[16 * 452]), -90.0, 1e-9);
  EXPECT_NEAR(azimuth_deg(beams[16 * 904]), 0.0, 1e-9);
}

TEST(LidarPattern, TheFieldOfViewCanBeCut) {
  SpinningPattern pattern{.columns = 360, .elevations_deg = {0.0}};
  pattern.azimuth_from_deg = -30;
  pattern.azimuth_to_deg = 60;
  const std::vector<LidarBeam> beams = generate_beams(pattern, 0);
  EXPECT_EQ(beams.size(), 91U);
  for (const LidarBeam& beam : beams) {
    EXPECT_GE(azimuth_deg(beam), -30 - 1e-9);
    EXPECT_LE(azimuth_deg(beam), 60 + 1e-9);
  }
}

TEST(LidarPattern, ARosetteFillsItsConeMoreAndMore) {
  const RosettePattern pattern;
  const auto cells_after = [&](int scans) {
    std::set<std::pair<int, int>> cells;
    for (int scan = 0; scan < scans; ++scan) {
      for (const LidarBeam& beam : generate_beams(pattern, scan)) {
        EXPECT_LE(std::acos(beam.direction.x()) * 180 / M_PI, 19.2 + 1e-9);
        cells.emplace(std::floor(beam.direction.y() * 150), std::floor(beam.direction.z() * 150));
      }
    }
    return static_cast<double>(cells.size());
  };
  const double all = M_PI * std::pow(150 * std::sin(19.2 * M_PI / 180), 2);
  EXPECT_LT(cells_after(1) / all, 0.9);
  EXPECT_GT(cells_after(10) / all, 0.98);
  EXPECT_GT(cells_after(10), 1.2 * cells_after(1));
}

TEST(LidarPattern, ARasterIsReadLikeAPage) {
  const RasterPattern pattern{
      .rate_hz = 5.0, .columns = 4, .rows = 2, .horizontal_fov_deg = 40, .vertical_fov_deg = 20};
  expect_sound(pattern, 0);
  const std::vector<LidarBeam> beams = generate_beams(pattern, 0);
  ASSERT_EQ(beams.size(), 8U);
  EXPECT_NEAR(azimuth_deg(beams[0]), -15.0, 1e-9);
  EXPECT_NEAR(elevation_deg(beams[0]), 5.0, 1e-9);
  EXPECT_NEAR(azimuth_deg(beams[7]), 15.0, 1e-9);
  EXPECT_NEAR(elevation_deg(beams[7]), -5.0, 1e-9);
}

TEST(LidarPattern, RefusesWhatCannotBe) {
  EXPECT_THAT([&] { check(LidarPattern(SpinningPattern{})); },
              ThrowsMessage<InputError>(HasSubstr("lidar columns: and channels must be 1 or more")));
  EXPECT_THAT([&] { check(LidarPattern(SpinningPattern{.elevations_deg = {91.0}})); },
              ThrowsMessage<InputError>(HasSubstr("lidar elevations: must lie between -90 and 90 degrees")));
  EXPECT_THAT(
      [&] {
        check(LidarPattern(SpinningPattern{.elevations_deg = {0, 1}, .channel_delay_s = 1.0}));
      },
      ThrowsMessage<InputError>(HasSubstr("lidar channel_delay: must be 0 or more")));
  EXPECT_THAT([&] { check(LidarPattern(RasterPattern{.rows = 0})); },
              ThrowsMessage<InputError>(HasSubstr("lidar rows: and columns must be 1 or more")));
  EXPECT_THAT([&] { check(LidarPattern(RasterPattern{.rate_hz = 0.0})); },
              ThrowsMessage<InputError>(HasSubstr("lidar rate: must lie between 0 and 1000 scans a second")));
  EXPECT_THAT([&] { check(LidarPattern(RosettePattern{.fov_deg = 200})); },
              ThrowsMessage<InputError>(HasSubstr("lidar fov: must lie between 0 and 180 degrees")));
}

}  // namespace
}  // namespace tileflight::sensors::lidar_pattern_test
