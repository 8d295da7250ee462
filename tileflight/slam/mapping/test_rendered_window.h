#pragma once

// For the tests of mapping: a window of keyframes rendered over hilly ground, with their true poses and inverse
// distances.

#include <memory>
#include <vector>

#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"
#include "tileflight/slam/mapping/marginalization.h"

namespace tileflight::mapping::test_support {

/// Images of a flight sideways and forwards, 20 m above hills of 2 m, by a lens of 130 degrees.
class RenderedFlight {
 public:
  imaging::RgbImage image(int i) const {
    return keyframes::test_support::ReliefCamera(camera, relief).render(T_camera_map(i).inverse());
  }
  std::shared_ptr<const keyframes::Pyramid> pyramid(int i) const {
    return std::make_shared<const keyframes::Pyramid>(
        keyframes::build_pyramid(keyframes::luminance(image(i), nullptr), kLevels));
  }
  /// True pose of image i; the map frame is the relief's.
  static geometry::SE3 T_camera_map(int i) {
    return keyframes::test_support::look_along(geometry::Vec3(0.5 * i, 0.35 * i, 20.0 + 0.1 * i),
                                               geometry::Vec3(0.01 * i, 1.0, -0.9))
        .inverse();
  }
  /// True inverse distance along a ray of image i, 1/m; 0: sky.
  float rho(int i, const Eigen::Vector3f& ray) const {
    const geometry::SE3 T_map_camera = T_camera_map(i).inverse();
    const double distance_m = keyframes::test_support::hit_distance(relief, T_map_camera.translation,
                                                                    T_map_camera.rotation * ray.cast<double>());
    return distance_m > 0.0 ? static_cast<float>(1.0 / distance_m) : 0.0F;
  }
  /// Patches of up to `count` pixels of image i that see the ground.
  std::vector<keyframes::Patch> patches(int i, const keyframes::Pyramid& pyramid, int count) const {
    std::vector<keyframes::Patch> out;
    for (const keyframes::SelectedPixel& p :
         keyframes::select_pixels(pyramid, lens.rays[0], count, options.selection)) {
      const auto patch = keyframes::make_patch(pyramid.levels[0], lens.lenses[0], Eigen::Vector2f(p.x, p.y),
                                               options.window.gradient_weight);
      if (patch && rho(i, patch->ray) > 0.0F) out.push_back(*patch);
    }
    return out;
  }

  static constexpr int kLevels = 4;
  keyframes::OdometryOptions options;
  imaging::Camera camera = imaging::make_fisheye(320, 240, 130.0);
  keyframes::test_support::Relief relief =
      keyframes::test_support::sine_hills({.amplitude_m = 2.0, .k_x = 0.15, .k_y = 0.12}, 0.7);
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, kLevels);
};

/// Window of every second image, from 0 on, at the true poses and without points. Keyframe i is image 2 i.
inline keyframes::Window make_true_window(const RenderedFlight& flight, int keyframes) {
  keyframes::Window window;
  for (int i = 0; i < keyframes; ++i) {
    keyframes::Keyframe keyframe;
    keyframe.id = i;
    keyframe.frame_index = 2 * i;
    keyframe.pyramid = flight.pyramid(2 * i);
    keyframe.T_camera_map_linear = RenderedFlight::T_camera_map(2 * i);
    keyframe.brightness_information = {1e6, 1e4};
    add_keyframe(window, std::move(keyframe));
  }
  return window;
}

/// Observations in all keyframes but the host.
inline std::vector<keyframes::Observation> observe_everywhere(int host, int keyframes) {
  std::vector<keyframes::Observation> observations;
  for (int t = 0; t < keyframes; ++t) {
    if (t == host) continue;
    observations.emplace_back();
    observations.back().target = t;
  }
  return observations;
}

}  // namespace tileflight::mapping::test_support
