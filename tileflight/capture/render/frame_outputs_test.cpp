#include "tileflight/capture/render/frame_outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <map>
#include <mutex>

#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::frame_outputs_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using imaging::Camera;
using scene::Scene;
using test_scenes::ground;
using test_scenes::looking_along;
using test_scenes::looking_down;
using testing::ElementsAre;

const Vec3 kGround(120.0, -80.0, 2880.0);  // far from the origin, as real places are
constexpr OutputChannels kAll{.range = true, .normals = true, .objects = true, .flow = true, .visibility = true};

std::vector<Camera> lenses() {
  return {imaging::make_pinhole(160, 120, 90.0), imaging::make_fisheye(101, 57, 155.0, {-1.0 / 24, 1.0 / 1920, 0, 0}),
          imaging::make_fisheye(90, 91, 200.0)};
}

/// A level plane, large enough to have no rim in view.
Scene plane() { return Scene({ground(kGround, 20000.0, nullptr)}); }

OutputImages outputs_of(const Scene& scene, const Camera& camera, const OutputChannels& outputs, const SE3& T,
                        const std::optional<SE3>& next = {}) {
  const CameraRenderer renderer(scene, camera, {});
  const OutputRenderer maker(renderer, scene, outputs);
  return next ? maker.render({&T, 1}, {&*next, 1}) : maker.render({&T, 1}, {});
}

/// Intersection of the pixel's ray with the level z = kGround.z, in double precision; nullopt at or above the horizon.
std::optional<Vec3> point_on_plane(const Camera& camera, const SE3& T, int x, int y) {
  const auto ray = camera.unproject(Vec2(x, y));
  if (!ray) return std::nullopt;
  const Vec3 direction = T.rotation * *ray;
  if (direction.z() > -0.02) return std::nullopt;
  return T.translation + (kGround.z() - T.translation.z()) / direction.z() * direction;
}

TEST(FrameOutputs, RangeIsDepthOverTheCosineAndNormalsPointUp) {
  const Scene scene = plane();
  const SE3 T = looking_along(kGround + Vec3(3.0, -2.0, 30.0), Vec3(0.3, 0.8, -0.7));
  const Vec3 up_in_camera = T.rotation.conjugate() * Vec3::UnitZ();
  for (const Camera& camera : lenses()) {
    const CameraRenderer renderer(scene, camera, {});
    const imaging::FloatImage depth_m = renderer.render(T).depth_m;
    const OutputImages images = outputs_of(scene, camera, {.range = true, .normals = true}, T);
    int surface = 0;
    for (int y = 0; y < camera.height(); ++y) {
      for (int x = 0; x < camera.width(); ++x) {
        const auto ray = camera.unproject(Vec2(x, y));
        ASSERT_EQ(ray.has_value(), !std::isnan(images.range_m(x, y)));
        ASSERT_EQ(std::isfinite(images.range_m(x, y)), !std::isnan(images.normals(x, y)[0]));
        const auto point = point_on_plane(camera, T, x, y);
        if (!point) continue;
        ++surface;
        const double range_m = (*point - T.translation).norm();
        EXPECT_NEAR(images.range_m(x, y), range_m, 1e-4 + 1e-6 * range_m * range_m / 30.0);
        EXPECT_NEAR(images.range_m(x, y) * ray->z(), depth_m(x, y), 1e-6 * range_m);
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(images.normals(x, y)[static_cast<std::size_t>(c)], up_in_camera[c], 1e-6);
      }
    }
    EXPECT_GT(surface, camera.width() * camera.height() / 4);
  }
}

TEST(FrameOutputs, NormalsAreOfTheSideThatIsSeen) {
  const Scene scene = plane();
  const SE3 T_up(geometry::Mat3(geometry::Mat3::Identity()), kGround + Vec3(0, 0, -3.0));  // from below, looking up
  const OutputImages images = outputs_of(scene, imaging::make_pinhole(9, 7, 60.0), {.normals = true}, T_up);
  EXPECT_THAT(images.normals(4, 3), ElementsAre(testing::FloatNear(0, 1e-6), testing::FloatNear(0, 1e-6), -1.0F));
}

/// Two squares side by side, the second with a western and an eastern half that are features 7 and 2 of its table, and
/// a third square above the first that occludes its northern half.
Scene three_squares() {
  imaging::TexturedMesh plain = ground(kGround + Vec3(-10, 0, 0), 20.0, nullptr);
  plain.name = "tile b";
  imaging::TexturedMesh roof = ground(kGround + Vec3(-10, 10, 5), 20.0, nullptr);
  roof.name = "tile b";  // another part of the same tile
  imaging::TexturedMesh halves = ground(kGround + Vec3(10, 0, 0), 20.0, nullptr);
  halves.name = "tile a";
  auto& vertices = halves.mesh.vertices;
  const Vec3 south = (vertices[0] + vertices[1]) / 2, north = (vertices[2] + vertices[3]) / 2;
  vertices = {vertices[0], south, north, vertices[3], south, vertices[1], vertices[2], north};
  halves.mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  halves.uv.clear();
  halves.feature_ids = {7, 7, 7, 7, 2, 2, 2, 2};
  auto table = std::make_shared<imaging::FeatureTable>();
  table->count = 8;
  table->properties["name"] = {"", "", "Kelvin Hall", "", "", "", "", ""};
  halves.features = table;
  return Scene({plain, halves, roof});
}

TEST(FrameOutputs, ObjectsAreFeaturesElseTiles) {
  const Scene scene = three_squares();
  const SceneObjects objects(scene);
  ASSERT_EQ(objects.all().size(), 3U);
  EXPECT_EQ(objects.all()[0].tile, "tile b");
  EXPECT_EQ(objects.all()[0].feature, imaging::kNoFeature);
  EXPECT_EQ(objects.all()[0].name, "");
  EXPECT_EQ(objects.all()[1].tile, "tile a");
  EXPECT_EQ(objects.all()[1].feature, 2U);
  EXPECT_EQ(objects.all()[1].name, "Kelvin Hall");
  EXPECT_EQ(objects.all()[2].feature, 7U);
  EXPECT_EQ(objects.all()[2].name, "");

  // A pixel is 0.25 m of the ground and 0.225 m of the roof's level.
  const Camera camera(imaging::PinholeRadtan{200, 200, 99.5, 59.5, {}}, 200, 120);
  const SE3 T = looking_down(kGround + Vec3(0, 0, 50));
  const OutputImages images = outputs_of(scene, camera, {.objects = true}, T);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 200; ++x) {
      const double east = (x - 99.5) / 4.0, north = (59.5 - y) / 4.0;
      const bool under_roof = 0.9 * east > -20 && 0.9 * east < 0 && 0.9 * north > 0 && 0.9 * north < 20;
      std::uint32_t expected = 0;
      if (std::abs(north) < 10 && east > -20 && east < 20) expected = east < 0 ? 1 : east < 10 ? 3 : 2;
      if (under_roof) expected = 1;
      ASSERT_EQ(images.objects(x, y), expected) << x << " " << y;
    }
  }
}

TEST(FrameOutputs, FeaturesOfDifferentTablesAreDifferentObjects) {
  const auto with_features = [](double east, std::uint32_t feature, std::shared_ptr<imaging::FeatureTable> table) {
    imaging::TexturedMesh mesh = ground(kGround + Vec3(east, 0, 0), 10.0, nullptr);
    mesh.name = "tile";
    mesh.feature_ids.assign(4, feature);
    mesh.features = std::move(table);
    return mesh;
  };
  const auto trees = std::make_shared<imaging::FeatureTable>(), houses = std::make_shared<imaging::FeatureTable>();
  const Scene scene({with_features(0, 0, trees), with_features(20, 0, houses), with_features(40, 0, trees),
                     with_features(60, imaging::kNoFeature, houses)});
  const SceneObjects objects(scene);
  ASSERT_EQ(objects.all().size(), 3U);
  EXPECT_EQ(objects.all()[1].mesh, 1U);
  EXPECT_EQ(objects.index_of(0, 0), objects.index_of(2, 1));
  EXPECT_NE(objects.index_of(0, 0), objects.index_of(1, 0));
  EXPECT_EQ(objects.index_of(3, 1), 2U);
}

TEST(FrameOutputs, FlowIsWhereThePointIsSeenNext) {
  const Scene scene = plane();
  const SE3 T = looking_along(kGround + Vec3(3.0, -2.0, 30.0), Vec3(0.3, 0.8, -0.7));
  const SE3 next = looking_along(kGround + Vec3(3.8, -0.5, 30.4), Vec3(0.33, 0.78, -0.72));
  for (const Camera& camera : lenses()) {
    const OutputImages images = outputs_of(scene, camera, {.flow = true}, T, next);
    int seen = 0, lost = 0;
    for (int y = 0; y < camera.height(); ++y) {
      for (int x = 0; x < camera.width(); ++x) {
        const auto point = point_on_plane(camera, T, x, y);
        if (!point) continue;
        const auto pixel = camera.project(next.inverse() * *point);
        const std::array<float, 2> flow = images.flow_px(x, y);
        if (pixel && pixel->x() > 0 && pixel->y() > 0 && pixel->x() < camera.width() - 1 &&
            pixel->y() < camera.height() - 1) {
          ++seen;
          EXPECT_NEAR(flow[0], pixel->x() - x, 1e-3) << x << " " << y;
          EXPECT_NEAR(flow[1], pixel->y() - y, 1e-3) << x << " " << y;
        } else if (!pixel || pixel->x() < -1 || pixel->y() < -1 || pixel->x() > camera.width() ||
                   pixel->y() > camera.height()) {
          ++lost;
          EXPECT_TRUE(std::isnan(flow[0]) && std::isnan(flow[1])) << x << " " << y;
        }
      }
    }
    EXPECT_GT(seen, camera.width() * camera.height() / 4);
    EXPECT_GT(lost, 20);
  }
  EXPECT_TRUE(outputs_of(scene, lenses()[0], {.flow = true}, T).flow_px.empty());  // there is no next frame
}

TEST(FrameOutputs, FlowFindsTheRowOfARollingShutter) {
  const Scene scene = plane();
  const Camera camera = imaging::make_fisheye(101, 67, 120.0);
  const ImageFormation formation{.line_delay_s = 1e-3};
  // Forward, sinking and turning, all fast.
  const auto pose_at = [](double t) {
    return looking_along(kGround + Vec3(3.0, 15.0 * t, 30.0 - 6.0 * t), Vec3(0.3 + 0.9 * t, 0.8, -0.7 - 0.5 * t));
  };
  const auto rows = shutter_poses(formation, pose_at, 1.0, camera.height()).T_local_camera;
  const auto next = shutter_poses(formation, pose_at, 1.1, camera.height()).T_local_camera;
  const CameraRenderer renderer(scene, camera, {});
  const OutputImages images = OutputRenderer(renderer, scene, {.flow = true}).render(rows, next);

  // Brute force: the continuous row at which the moving camera sees the point in that very row, by bisection.
  const auto seen_from_row = [&](double row, const Vec3& point) {
    const SE3 T = pose_at(1.1 + (row - 0.5 * (camera.height() - 1)) * formation.line_delay_s);
    return camera.project(T.inverse() * point);
  };
  int compared = 0;
  double rolling_px = 0.0;
  for (int y = 0; y < camera.height(); y += 2) {
    for (int x = 0; x < camera.width(); x += 3) {
      const auto point = point_on_plane(camera, rows[static_cast<std::size_t>(y)], x, y);
      if (!point || !seen_from_row(0, *point)) continue;
      double low = 0.0, high = camera.height() - 1.0;
      if (seen_from_row(low, *point)->y() < low || seen_from_row(high, *point)->y() > high) continue;
      for (int i = 0; i < 50; ++i) {
        const double middle = 0.5 * (low + high);
        (seen_from_row(middle, *point)->y() > middle ? low : high) = middle;
      }
      const Vec2 pixel = *seen_from_row(low, *point);
      if (pixel.x() < 0 || pixel.x() > camera.width() - 1.0) continue;
      ++compared;
      EXPECT_NEAR(images.flow_px(x, y)[0], pixel.x() - x, 2e-3) << x << " " << y;
      EXPECT_NEAR(images.flow_px(x, y)[1], pixel.y() - y, 2e-3) << x << " " << y;
      const auto global = camera.project(pose_at(1.1).inverse() * *point);
      rolling_px = std::max(rolling_px, (pixel - *global).norm());
    }
  }
  EXPECT_GT(compared, 200);
  EXPECT_GT(rolling_px, 0.5);  // makes sure that the test is meaningful
}

TEST(FrameOutputs, VisibilityIsOfThePlaceThatCounts) {
  const Scene scene = plane();
  const Camera camera(imaging::PinholeRadtan{200, 200, 49.5, 29.5, {}}, 100, 60);  // 0.25 m a pixel
  const CameraRenderer renderer(scene, camera, {});
  const SE3 T = looking_down(kGround + Vec3(0, 0, 50));
  const OutputRenderer eastern(renderer, scene, {.visibility = true}, [](const Vec3& p) { return p.x() > 120.0; });
  const imaging::GrayImage mask = eastern.render({&T, 1}, {}).visibility;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) ASSERT_EQ(mask(x, y), x < 50 ? 0 : 255) << x << " " << y;
  }
  const SE3 T_away = looking_along(kGround + Vec3(0, 0, 50), Vec3(0, 1, 1e-3));
  const imaging::GrayImage horizon = outputs_of(scene, camera, {.visibility = true}, T_away).visibility;
  EXPECT_EQ(horizon(50, 10), 0);
  EXPECT_EQ(horizon(50, 55), 255);
}

/// Equal, treating NaN as equal to NaN.
template <class Pixel>
bool same_bytes(const imaging::Image<Pixel>& a, const imaging::Image<Pixel>& b) {
  if (a.pixels.empty() || b.pixels.empty()) return a.pixels.empty() && b.pixels.empty();
  return a.pixels.size() == b.pixels.size() &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Pixel)) == 0;
}

TEST(FrameOutputs, AFlightGivesTheSameForAnyNumberOfThreadsAndOnlyWhatIsAskedFor) {
  const Scene scene({test_scenes::hills(kGround, 120.0, 50, nullptr)});
  const Camera camera = imaging::make_fisheye(91, 61, 140.0);
  geometry::Trajectory frames;
  for (int i = 0; i < 5; ++i) {
    frames.poses.push_back({0.1 * i, looking_along(kGround + Vec3(-10 + 0.5 * i, -20, 25), Vec3(0.1, 0.8, -0.8))});
  }
  const auto fly = [&](std::size_t threads, const OutputChannels& outputs, double line_delay_s) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    std::mutex mutex;
    std::map<std::size_t, OutputImages> images;
    FlightRenderOptions options;
    options.outputs = outputs;
    options.formation.line_delay_s = line_delay_s;
    render_flight(scene, camera, frames, {}, options, [&](const FlightFrame& frame) {
      const std::scoped_lock lock(mutex);
      images[frame.index] = frame.outputs;
    });
    return images;
  };
  for (const double line_delay_s : {0.0, 1e-4}) {
    auto one = fly(1, kAll, line_delay_s), four = fly(4, kAll, line_delay_s);
    ASSERT_EQ(one.size(), 5U);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_TRUE(same_bytes(one[i].range_m, four[i].range_m));
      EXPECT_TRUE(same_bytes(one[i].normals, four[i].normals));
      EXPECT_TRUE(same_bytes(one[i].objects, four[i].objects));
      EXPECT_TRUE(same_bytes(one[i].flow_px, four[i].flow_px));
      EXPECT_TRUE(same_bytes(one[i].visibility, four[i].visibility));
      EXPECT_EQ(one[i].flow_px.empty(), i == 4);
    }
  }
  const OutputImages range_only = fly(2, {.range = true}, 0.0)[0];
  EXPECT_FALSE(range_only.range_m.empty());
  EXPECT_TRUE(range_only.normals.empty() && range_only.objects.empty() && range_only.flow_px.empty() &&
              range_only.visibility.empty());
}

}  // namespace
}  // namespace tileflight::render::frame_outputs_test
