#pragma once

// For the tests of mapping: a window of keyframes rendered over hilly ground, with their true poses and inverse
// distances.

#include <memory>
#include <vector>

#include "tileflight/mapping/marginalization.h"
#include "tileflight/photometry/options.h"
#include "tileflight/photometry/pixel_selector.h"
#include "tileflight/photometry/synthetic_scene.h"

namespace tileflight::mapping::test_support {

/// Images of a flight sideways and forwards, 20 m above hills of 2 m, by a lens of 130 degrees.
class RenderedFlight {
 public:
  imaging::RgbImage image(int i) const {
    return photometry::test_support::ReliefCamera(camera, relief).render(T_camera_map(i).inverse());
  }
  std::shared_ptr<const photometry::Pyramid> pyramid(int i) const {
    return std::make_shared<const photometry::Pyramid>(
        photometry::build_pyramid(photometry::luminance(image(i), nullptr), kLevels));
  }
  /// True pose of image i; the map frame is the relief's.
  static geometry::SE3 T_camera_map(int i) {
    return photometry::test_support::look_along(geometry::Vec3(0.5 * i, 0.35 * i, 20.0 + 0.1 * i),
                                                geometry::Vec3(0.01 * i, 1.0, -0.9))
        .inverse();
  }
  /// True inverse distance along a ray of image i, 1/m; 0: sky.
  float rho(int i, const Eigen::Vector3f& ray) const {
    const geometry::SE3 T_map_camera = T_camera_map(i).inverse();
    const double distance_m = photometry::test_support::hit_distance(relief, T_map_camera.translation,
                                                                     T_map_camera.rotation * ray.cast<double>());
    return distance_m > 0.0 ? static_cast<float>(1.0 / distance_m) : 0.0F;
  }
  /// Patches of up to `count` pixels of image i that see the ground.
  std::vector<photometry::Patch> patches(int i, const photometry::Pyramid& pyramid, int count) const {
    std::vector<photometry::Patch> out;
    for (const photometry::SelectedPixel& p :
         photometry::select_pixels(pyramid, lens.rays[0], count, options.selection)) {
      const auto patch = photometry::make_patch(pyramid.levels[0], lens.lenses[0], Eigen::Vector2f(p.x, p.y),
                                                options.window.gradient_weight);
      if (patch && rho(i, patch->ray) > 0.0F) out.push_back(*patch);
    }
    return out;
  }

  static constexpr int kLevels = 4;
  photometry::OdometryOptions options;
  imaging::Camera camera = imaging::make_fisheye(320, 240, 130.0);
  photometry::test_support::Relief relief =
      photometry::test_support::sine_hills({.amplitude_m = 2.0, .k_x = 0.15, .k_y = 0.12}, 0.7);
  photometry::LensPyramid lens = photometry::build_lens_pyramid(camera, kLevels);
};

/// Window of every second image, from 0 on, at the true poses and without points. Keyframe i is image 2 i.
inline photometry::Window make_true_window(const RenderedFlight& flight, int keyframes) {
  photometry::Window window;
  for (int i = 0; i < keyframes; ++i) {
    photometry::Keyframe keyframe;
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
inline std::vector<photometry::Observation> observe_everywhere(int host, int keyframes) {
  std::vector<photometry::Observation> observations;
  for (int t = 0; t < keyframes; ++t) {
    if (t == host) continue;
    observations.emplace_back();
    observations.back().target = t;
  }
  return observations;
}

}  // namespace tileflight::mapping::test_support
