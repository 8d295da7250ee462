#include "tileflight/capture/render/daylight_shader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render::daylight_shader_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using imaging::TexturedMesh;
using scene::Scene;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using namespace test_scenes;

const geometry::Geodetic kPlace{35.31, -80.74, {190.0}};
constexpr float kGrey = 0.4F;  // albedo

DaylightOptions at_time(const char* time) { return {.utc_s = base::parse_iso_time_s(time)}; }

std::shared_ptr<const Daylight> daylight(const char* time) {
  return std::make_shared<const Daylight>(at_time(time), kPlace);
}

/// Removes the texture; one grey.
TexturedMesh plain(TexturedMesh mesh) {
  mesh.uv.clear();
  mesh.texture = nullptr;
  mesh.base_color = {kGrey, kGrey, kGrey, 1.0F};
  return mesh;
}

TexturedMesh plain_ground(const Vec3& center, double size_m) { return plain(ground(center, size_m, nullptr)); }

TexturedMesh box(const Vec3& low, const Vec3& high) {
  TexturedMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.mesh.vertices.emplace_back((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                                    (i & 4) != 0 ? high.z() : low.z());
  }
  mesh.mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                         {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return plain(mesh);
}

/// Convex, so that it cannot shadow itself.
TexturedMesh ball(const Vec3& center, double radius_m, std::uint32_t segments) {
  TexturedMesh mesh;
  for (std::uint32_t j = 0; j <= segments; ++j) {
    for (std::uint32_t i = 0; i <= 2 * segments; ++i) {
      const double polar = std::numbers::pi * j / segments, around = std::numbers::pi * i / segments;
      mesh.mesh.vertices.push_back(center + radius_m * Vec3(std::sin(polar) * std::cos(around),
                                                            std::sin(polar) * std::sin(around), std::cos(polar)));
    }
  }
  const std::uint32_t columns = 2 * segments + 1;
  for (std::uint32_t j = 0; j < segments; ++j) {
    for (std::uint32_t i = 0; i + 1 < columns; ++i) {
      const std::uint32_t a = j * columns + i;
      mesh.mesh.triangles.push_back({a, a + columns, a + 1});
      mesh.mesh.triangles.push_back({a + 1, a + columns, a + columns + 1});
    }
  }
  return plain(mesh);
}

LightFrame light_from(const CameraRenderer& renderer, const SE3& T_local_camera) {
  return renderer.render_light({1, 1, {T_local_camera}});
}

/// Whether the ray from `point` along `direction` hits the box (slab test).
bool meets(const geometry::Box3& box, const Vec3& point, const Vec3& direction) {
  double near = 0.0, far = 1e9;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.min()[axis] - point[axis]) / direction[axis];
    const double b = (box.max()[axis] - point[axis]) / direction[axis];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near < far;
}

/// An image from above of a box on level ground.
struct BoxShadow {
  std::shared_ptr<const Daylight> light;
  geometry::Box3 box_m;
  imaging::Camera camera = imaging::make_pinhole(400, 400, 40.0);
  SE3 T_local_camera = looking_down({120.0, -80.0, 160.0});
  LightFrame frame;

  explicit BoxShadow(const char* time)
      : light(daylight(time)), box_m(Vec3(118.0, -83.0, 0.0), Vec3(122.0, -77.0, 12.0)) {
    const Scene scene({plain_ground({120.0, -80.0, 0.0}, 400.0), box(box_m.min(), box_m.max())});
    frame = light_from(CameraRenderer(scene, camera, {.daylight = light}), T_local_camera);
  }
  /// Ground point of a pixel; nullopt: the pixel shows the box.
  std::optional<Vec3> ground_at(int x, int y) const {
    if (frame.depth_m(x, y) < 159.9F) return std::nullopt;
    const Vec3 ray = T_local_camera.rotation * *camera.unproject(Vec2(x, y));
    return T_local_camera.translation - ray * (T_local_camera.translation.z() / ray.z());
  }
  bool is_dark(int x, int y) const {
    return frame.light(x, y)[1] <
           kGrey * (light->diffuse({0, 0, 1})[1] + 0.5F * light->toward_sun()[2] * light->sunlight()[1]);
  }
};

TEST(DaylightShader, ABoxCastsTheShadowOfItsHeight) {
  for (const char* time : {"2024-03-20T13:30:00Z", "2024-06-20T19:00:00Z"}) {
    const BoxShadow test(time);
    const Vec3 sun = test.light->sun().direction;
    const Vec3 away = Vec3(-sun.x(), -sun.y(), 0.0).normalized();
    double farthest_m = -1e9, sideways_m = 0.0;
    int wrong = 0, dark = 0;
    for (int y = 0; y < 400; ++y) {
      for (int x = 0; x < 400; ++x) {
        const std::optional<Vec3> point = test.ground_at(x, y);
        if (!point) continue;
        wrong += test.is_dark(x, y) != meets(test.box_m, *point, sun) ? 1 : 0;
        if (!test.is_dark(x, y)) continue;
        ++dark;
        farthest_m = std::max(farthest_m, (*point - Vec3(120.0, -80.0, 0.0)).dot(away));
        sideways_m = std::max(sideways_m, std::abs((*point - Vec3(120.0, -80.0, 0.0)).dot(away.cross(Vec3::UnitZ()))));
      }
    }
    EXPECT_LE(wrong, 4) << time;
    EXPECT_GT(dark, 300) << time;
    // The corner that is farthest that way, and then height / tan(elevation); a pixel is 0.29 m.
    const double corner_m = 2.0 * std::abs(away.x()) + 3.0 * std::abs(away.y());
    EXPECT_NEAR(farthest_m, corner_m + 12.0 / std::tan(test.light->sun().elevation_rad), 0.3) << time;
    EXPECT_LT(sideways_m, 3.0 * std::abs(away.x()) + 2.0 * std::abs(away.y()) + 0.1) << time;
  }
}

TEST(DaylightShader, GreysAreWhatSkyAndSunMakeOfThem) {
  const BoxShadow test("2024-03-20T13:30:00Z");
  const LinearRgb sky = test.light->diffuse({0, 0, 1});
  for (int y = 0; y < 400; y += 3) {
    for (int x = 0; x < 400; x += 3) {
      if (!test.ground_at(x, y)) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const float expected = test.is_dark(x, y) ? kGrey * sky[c] : kGrey;  // full light on the level: 1
        EXPECT_NEAR(test.frame.light(x, y)[c], expected, 2e-3F);
      }
    }
  }
}

/// No self-shadowing: far from the camera and from the anchor, with the sun nearly in the surface's plane.
TEST(DaylightShader, ConvexShapesDoNotShadowThemselves) {
  const auto light = daylight("2024-03-20T11:50:00Z");  // a few degrees high
  ASSERT_LT(light->sun().elevation_rad, 0.1);
  for (const double distance_m : {5.0, 80.0, 1500.0}) {
    const Vec3 center(350.0, 900.0, 2880.0);
    const Scene scene({ball(center, 0.3 * distance_m, 40)}, center + Vec3(900.0, -700.0, 100.0));
    const imaging::Camera camera = imaging::make_pinhole(200, 200, 60.0);
    const CameraRenderer renderer(scene, camera, {.daylight = light});
    const SE3 T = looking_along(center - distance_m * Vec3(-0.8, 0.3, -0.52), Vec3(-0.8, 0.3, -0.52));
    const LightFrame frame = light_from(renderer, T);
    std::atomic<int> sunlit = 0, wrong = 0;
    renderer.visit_surface(std::span(&T, 1), [&](const SurfacePoint& point) {
      if (!point.hit) return;
      const Vec3 normal = Vec3(point.normal_local[0], point.normal_local[1], point.normal_local[2]).normalized();
      const double cosine = std::max(0.0, normal.dot(light->sun().direction));
      const std::array<float, 3> n{static_cast<float>(normal.x()), static_cast<float>(normal.y()),
                                   static_cast<float>(normal.z())};
      const double expected = kGrey * (light->diffuse(n)[1] + cosine * light->sunlight()[1]);
      if (cosine > 1e-3) ++sunlit;
      if (std::abs(frame.light(point.x, point.y)[1] - expected) > 0.004 * (1.0 + expected)) ++wrong;
    });
    EXPECT_GT(sunlit, 4000);
    EXPECT_EQ(wrong, 0) << distance_m;
  }
}

TEST(DaylightShader, UnderARoofThereIsTheSkysLightAlone) {
  const auto light = daylight("2024-06-20T17:00:00Z");
  const Scene scene({plain_ground({0, 0, 0}, 3000.0), plain_ground({0, 0, 20}, 3000.0)});
  const CameraRenderer renderer(scene, imaging::make_pinhole(64, 48, 60.0), {.daylight = light});
  const LightFrame below = light_from(renderer, looking_down({3, 2, 15}));
  const LightFrame above = light_from(renderer, looking_down({3, 2, 40}));
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(below.light(20, 20)[c], kGrey * light->diffuse({0, 0, 1})[c], 1e-3F);
    EXPECT_NEAR(above.light(20, 20)[c], kGrey, 1e-3F);
  }
}

TEST(DaylightShader, BothSidesOfASurfaceAreLitAsTheyFace) {
  const auto light = daylight("2024-03-20T13:30:00Z");  // from the east
  TexturedMesh wall = plain(ground({0, 0, 0}, 10.0, nullptr));
  for (Vec3& p : wall.mesh.vertices) p = Vec3(0.0, p.x(), p.y());  // across the way to the east
  TexturedMesh turned = wall;
  for (geometry::Triangle& t : turned.mesh.triangles) std::swap(t[1], t[2]);
  for (const double side : {1.0, -1.0}) {
    const SE3 T = looking_along({side * 8.0, 0.0, 0.0}, {-side, 0.0, 0.0});
    const imaging::Camera camera = imaging::make_pinhole(32, 32, 40.0);
    const Scene scene({wall}), turned_scene({turned});
    const LinearRgb seen = light_from(CameraRenderer(scene, camera, {.daylight = light}), T).light(16, 16);
    const LinearRgb other = light_from(CameraRenderer(turned_scene, camera, {.daylight = light}), T).light(16, 16);
    const float cosine = std::max(0.0F, static_cast<float>(side) * light->toward_sun()[0]);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(seen[c], other[c]);
      const float diffuse = light->diffuse({static_cast<float>(side), 0, 0})[c];
      EXPECT_NEAR(seen[c], kGrey * (diffuse + cosine * light->sunlight()[c]), 2e-3F);
    }
  }
}

TEST(DaylightShader, LevelTexturesKeepTheirValuesAndTheSkyIsBehind) {
  const auto light = daylight("2024-06-20T17:00:00Z");
  const Scene scene({ground({0, 0, 0}, 60.0, texture(4, 4, [](int, int) { return imaging::Rgb8{118, 90, 60}; }))});
  const imaging::Camera camera = imaging::make_pinhole(64, 48, 70.0);
  for (const int samples : {1, 4}) {
    const CameraRenderer renderer(scene, camera, {.samples_per_pixel = samples, .daylight = light});
    const imaging::Rgb8 seen = renderer.render(looking_down({0, 0, 20})).rgb(30, 20);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], (imaging::Rgb8{118, 90, 60}[c]), 1);
  }
  const CameraRenderer renderer(scene, camera, {.daylight = light});
  const SE3 T = looking_along({0, 0, 20}, {0.4, 0.9, 0.5});
  const Vec3 ray = T.rotation * *camera.unproject(Vec2(40, 6));
  const LinearRgb sky =
      light->sky({static_cast<float>(ray.x()), static_cast<float>(ray.y()), static_cast<float>(ray.z())});
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(light_from(renderer, T).light(40, 6)[c], sky[c], 1e-4F);
}

TEST(DaylightShader, HazeIsOfTheHorizonsOrOfAGivenColour) {
  const auto light = daylight("2024-06-20T17:00:00Z");
  const Scene scene({plain_ground({0, 0, 0}, 8000.0)});
  const imaging::Camera camera = imaging::make_pinhole(33, 33, 40.0);
  const SE3 T = looking_along({0, 0, 200}, {1.0, 0.2, -0.5});
  const imaging::Rgb8 brown{150, 120, 90};
  const CameraRenderer clear(scene, camera, {.daylight = light});
  const CameraRenderer own(scene, camera, {.haze_per_m = 0.002, .daylight = light});
  const CameraRenderer given(scene, camera, {.haze_per_m = 0.002, .haze_color = brown, .daylight = light});
  const LightFrame without = light_from(clear, T);
  const double distance_m = without.depth_m(16, 16);  // on the optical axis
  const double left = std::exp(-0.002 * distance_m);
  const LinearRgb horizon = light->horizon({1.0F, 0.2F, -0.5F});
  for (std::size_t c = 0; c < 3; ++c) {
    const double surface = left * without.light(16, 16)[c];
    EXPECT_NEAR(light_from(own, T).light(16, 16)[c], surface + (1.0 - left) * horizon[c], 1e-4);
    EXPECT_NEAR(light_from(given, T).light(16, 16)[c], surface + (1.0 - left) * srgb_decode(brown[c]), 1e-4);
  }
}

bool same_light(const LightFrame& a, const LightFrame& b) {
  return a.light.pixels.size() == b.light.pixels.size() &&
         std::memcmp(a.light.pixels.data(), b.light.pixels.data(), a.light.pixels.size() * sizeof(LinearRgb)) == 0;
}

TEST(DaylightShader, TheSameBytesForAnyNumberOfThreads) {
  const auto light = daylight("2024-03-20T12:30:00Z");
  const Scene scene({plain(hills({0, 0, 0}, 300.0, 40, nullptr, 20.0))});
  const CameraRenderer renderer(scene, imaging::make_fisheye(201, 113, 155.0),
                                {.haze_per_m = 0.001, .daylight = light});
  const SE3 T = looking_along({0, -60, 60}, {0.2, 1.0, -0.6});
  const LightFrame many = light_from(renderer, T);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same_light(many, light_from(renderer, T)));
}

geometry::Trajectory one_frame(const SE3& T_local_camera) {
  geometry::Trajectory frames;
  frames.poses = {{0.0, T_local_camera}};
  return frames;
}

imaging::RgbImage flown(const Scene& scene, const FlightRenderOptions& options) {
  imaging::RgbImage image;
  render_flight(scene, imaging::make_pinhole(64, 48, 60.0), one_frame(looking_down({0, 0, 50})), {}, options,
                [&](const FlightFrame& frame) { image = frame.rgb; });
  return image;
}

TEST(DaylightShader, AFlightIsLitWhereItsOriginIs) {
  const Scene scene({plain_ground({0, 0, 0}, 500.0)});
  FlightRenderOptions options;
  options.formation.light = at_time("2024-06-20T17:00:00Z");
  EXPECT_THAT([&] { flown(scene, options); },
              ThrowsMessage<InputError>(
                  HasSubstr("the place is not georeferenced, so the sun's position is unknown")));  // nowhere
  options.origin = kPlace;
  const int lit = flown(scene, options)(32, 24)[1];
  EXPECT_NEAR(lit, srgb_encode(kGrey), 1.0);
  options.formation.auto_exposure.target = 0.1;  // the meter sees the same light
  EXPECT_NEAR(flown(scene, options)(32, 24)[1], srgb_encode(0.1), 1.0);
  options.formation.auto_exposure.target = 0.0;
  options.formation.light->turbidity = 30.0;
  EXPECT_THAT([&] { flown(scene, options); },
              ThrowsMessage<InputError>(HasSubstr("light: turbidity: must lie between 2")));
}

TEST(DaylightShader, HazeKeepsTheBackgroundsColourUnlessToldAnother) {
  const Scene scene({plain_ground({0, 0, 0}, 500.0)});
  FlightRenderOptions options;
  options.formation.haze_visibility_m = 100.0;
  const imaging::RgbImage before = flown(scene, options);
  options.formation.haze_color = options.render.background;
  EXPECT_EQ(flown(scene, options).pixels, before.pixels);
  options.formation.haze_color = imaging::Rgb8{200, 150, 100};
  const double clear = std::pow(0.02, 50.0 / 100.0);
  const imaging::Rgb8 brown = flown(scene, options)(32, 24);
  for (std::size_t c = 0; c < 3; ++c) {
    const double air = srgb_decode(imaging::Rgb8{200, 150, 100}[c]);
    EXPECT_NEAR(brown[c], srgb_encode(clear * kGrey + (1.0 - clear) * air), 1.0);
  }
}

}  // namespace
}  // namespace tileflight::render::daylight_shader_test
