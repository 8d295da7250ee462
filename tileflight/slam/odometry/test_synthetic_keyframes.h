#pragma once

// For the tests of odometry: features, pictures and points of keyframes over rendered ground, with their true
// distances.

#include <vector>

#include "tileflight/slam/keyframes/features.h"
#include "tileflight/slam/loop_closure/keyframe_image.h"
#include "tileflight/slam/mapping/map.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::test_support {

/// Gentle hills, height amplitude 1.2 m, finest texture wavelength 0.5 m.
inline keyframes::test_support::Relief hilly_terrain() {
  return keyframes::test_support::sine_hills({.amplitude_m = 1.2, .k_x = 0.3, .k_y = 0.25}, 0.5);
}

class KeyframeMaker {
 public:
  explicit KeyframeMaker(const keyframes::test_support::Relief& relief)
      : scene_(imaging::make_fisheye(320, 240, 120.0), relief) {
    lens_ = keyframes::build_lens_pyramid(scene_.camera(), 4);
  }

  const imaging::Camera& camera() const { return scene_.camera(); }
  const keyframes::LensPyramid& lens() const { return lens_; }

  std::vector<keyframes::Feature> features(const geometry::SE3& T_local_camera) const {
    std::vector<keyframes::Feature> features = keyframes::find_features(pyramid(T_local_camera), lens_, {});
    for (keyframes::Feature& feature : features) feature.rho = rho(T_local_camera, feature.ray);
    return features;
  }
  loop_closure::KeyframeImage image(const geometry::SE3& T_local_camera) const {
    return loop_closure::keep_image(pyramid(T_local_camera));
  }
  /// One point in each cell of 5 x 5 pixels that shows ground; `keyframe`: id of their host.
  std::vector<mapping::MapPoint> points(const geometry::SE3& T_local_camera, int keyframe) const {
    std::vector<mapping::MapPoint> points;
    const keyframes::RayTable& rays = lens_.rays[0];
    for (int y = 2; y < rays.height; y += 5) {
      for (int x = 2; x < rays.width; x += 5) {
        mapping::MapPoint point;
        point.keyframe = keyframe;
        point.ray = rays.at(x, y);
        point.rho = point.ray.isZero(0) ? 0.0F : rho(T_local_camera, point.ray);
        point.rho_variance = 1e-4F * point.rho * point.rho;
        points.push_back(point);
      }
    }
    return points;
  }
  keyframes::Pyramid pyramid(const geometry::SE3& T_local_camera) const {
    return keyframes::build_pyramid(keyframes::luminance(scene_.render(T_local_camera), nullptr), 4);
  }
  /// True inverse distance along a ray of the camera; 0: sky.
  float rho(const geometry::SE3& T_local_camera, const Eigen::Vector3f& ray) const {
    const double distance = keyframes::test_support::hit_distance(scene_.relief(), T_local_camera.translation,
                                                                  T_local_camera.rotation * ray.cast<double>());
    return distance > 0 ? static_cast<float>(1.0 / distance) : 0.0F;
  }

 private:
  keyframes::test_support::ReliefCamera scene_;
  keyframes::LensPyramid lens_;
};

}  // namespace tileflight::odometry::test_support
