#pragma once

#include <cmath>
#include <random>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/evaluation/localization/flight_mosaic.h"
#include "tileflight/world/scene/scene.h"

// Places with known appearance, for the tests of localization.
namespace tileflight::localization::test_places {

/// Multi-scale noise that resembles ground, 0 to 255, defined everywhere.
inline double blotches_at(double x, double y, int seed) {
  using render::test_scenes::noise;
  double value = 0.0;
  for (int k = 0; k < 6; ++k) {
    const double cell = 1 << k;
    const int i = static_cast<int>(std::floor(x / cell)), j = static_cast<int>(std::floor(y / cell));
    const double u = x / cell - i, v = y / cell - j;
    const auto at = [&](int a, int b) { return static_cast<double>(noise(i + a, j + b, seed + k)); };
    value += (1 - u) * (1 - v) * at(0, 0) + u * (1 - v) * at(1, 0) + (1 - u) * v * at(0, 1) + u * v * at(1, 1);
  }
  return value / 6.0;
}

inline std::shared_ptr<const imaging::RgbImage> blotches(int seed, int size = 512) {
  return render::test_scenes::texture(size, size, [seed](int x, int y) {
    return render::test_scenes::grey(static_cast<int>(blotches_at(x, y, seed)));
  });
}

/// Hills of 100 m x 100 m with the noise texture.
struct Hills {
  scene::Scene scene;

  explicit Hills(int seed) : scene({render::test_scenes::hills(geometry::Vec3(0, 0, 10), 100.0, 60, blotches(seed))}) {
    scene.build_ray_tree();
  }
};

/// Nine images on an arc about 25 m above the hills, and points of the visible surface. `lean_rad`: angle of the camera
/// axis from straight down.
struct Flight {
  imaging::Camera camera = imaging::make_pinhole(320, 240, 80.0);
  std::vector<geometry::SE3> T_local_camera;
  std::vector<imaging::RgbImage> rendered;
  std::vector<geometry::Vec3> points;  ///< local frame

  Flight(const Hills& place, double lean_rad) {
    using geometry::Vec3;
    const render::CameraRenderer renderer(place.scene, camera, {});
    std::mt19937_64 random(5);
    for (int k = 0; k < 9; ++k) {
      const double heading = 0.12 * k;
      geometry::SE3 pose = render::test_scenes::looking_down(Vec3(-14.0 + 4.0 * k, -9.0 + 0.3 * k * k, 35.0 + 0.3 * k));
      pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(heading, Vec3::UnitZ())) * pose.rotation *
                      geometry::so3_exp(Vec3(lean_rad, 0.0, 0.0));
      const render::RenderedFrame frame = renderer.render(pose);
      for (int i = 0; i < 500; ++i) {
        const int x = static_cast<int>(random() % 320), y = static_cast<int>(random() % 240);
        const float depth_m = frame.depth_m(x, y);
        const auto ray = camera.unproject(geometry::Vec2(x, y));
        if (std::isfinite(depth_m) && ray) points.push_back(pose * Vec3(*ray * (depth_m / ray->z())));
      }
      T_local_camera.push_back(pose);
      rendered.push_back(frame.rgb);
    }
  }

  /// The flight in a map frame. The Flight must outlive the result.
  FlightPictures pictures(const geometry::Sim3& T_map_local = {}) const {
    FlightPictures pictures{.camera = camera};
    for (const geometry::SE3& pose : T_local_camera)
      pictures.T_map_camera.emplace_back(T_map_local.rotation * pose.rotation, T_map_local * pose.translation);
    pictures.picture = [this](std::size_t k) { return rendered[k]; };
    return pictures;
  }
  std::vector<geometry::Vec3> points_in(const geometry::Sim3& T_map_local) const {
    std::vector<geometry::Vec3> moved;
    for (const geometry::Vec3& p : points) moved.push_back(T_map_local * p);
    return moved;
  }
};

}  // namespace tileflight::localization::test_places
