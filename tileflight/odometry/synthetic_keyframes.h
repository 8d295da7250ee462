#pragma once

// For this stage's tests: corners of keyframes over rendered ground, with their true distances.

#include <vector>

#include "tileflight/odometry/keyframe_matching.h"
#include "tileflight/odometry/synthetic_flight.h"

namespace tileflight::odometry::tests {

/// Gentle hills with details down to a decimetre or so.
inline Relief hilly_place() {
  Relief relief;
  relief.height_m = [](double x, double y) { return 1.2 * std::sin(0.3 * x) * std::cos(0.25 * y); };
  relief.highest_m = 1.2;
  relief.texel_m = 0.5;
  return relief;
}

class KeyframeMaker {
 public:
  explicit KeyframeMaker(const Relief& relief) : scene_(imaging::make_fisheye(320, 240, 120.0), relief) {
    lens_ = build_lens_pyramid(scene_.camera(), 4);
  }

  const imaging::Camera& camera() const { return scene_.camera(); }
  const LensPyramid& lens() const { return lens_; }

  std::vector<Feature> features(const SE3& T_local_camera) const {
    const Pyramid pyramid = build_pyramid(luminance(scene_.picture(T_local_camera), nullptr), 4);
    std::vector<Feature> features = find_features(pyramid, lens_, {});
    for (Feature& feature : features) feature.rho = rho(T_local_camera, feature.ray);
    return features;
  }
  /// True inverse distance along a ray of the camera; 0: sky.
  float rho(const SE3& T_local_camera, const Eigen::Vector3f& ray) const {
    const double distance =
        hit_distance(scene_.relief(), T_local_camera.translation, T_local_camera.rotation * ray.cast<double>());
    return distance > 0 ? static_cast<float>(1.0 / distance) : 0.0F;
  }

 private:
  ReliefCamera scene_;
  LensPyramid lens_;
};

}  // namespace tileflight::odometry::tests
