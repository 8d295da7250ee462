#pragma once

// For the tests of odometry: features of keyframes over rendered ground, with their true distances.

#include <vector>

#include "tileflight/loops/keyframe_matching.h"
#include "tileflight/odometry/synthetic_flight.h"

namespace tileflight::odometry::test_support {

/// Gentle hills, height amplitude 1.2 m, finest texture wavelength 0.5 m.
inline photometry::test_support::Relief hilly_terrain() {
  photometry::test_support::Relief relief;
  relief.height_m = [](double x, double y) {
    return 1.2 * photometry::test_support::sine(0.3 * x) * photometry::test_support::cosine(0.25 * y);
  };
  relief.highest_m = 1.2;
  relief.texel_m = 0.5;
  return relief;
}

class KeyframeMaker {
 public:
  explicit KeyframeMaker(const photometry::test_support::Relief& relief)
      : scene_(imaging::make_fisheye(320, 240, 120.0), relief) {
    lens_ = photometry::build_lens_pyramid(scene_.camera(), 4);
  }

  const imaging::Camera& camera() const { return scene_.camera(); }
  const photometry::LensPyramid& lens() const { return lens_; }

  std::vector<loops::Feature> features(const geometry::SE3& T_local_camera) const {
    const photometry::Pyramid pyramid =
        photometry::build_pyramid(photometry::luminance(scene_.render(T_local_camera), nullptr), 4);
    std::vector<loops::Feature> features = loops::find_features(pyramid, lens_, {});
    for (loops::Feature& feature : features) feature.rho = rho(T_local_camera, feature.ray);
    return features;
  }
  /// True inverse distance along a ray of the camera; 0: sky.
  float rho(const geometry::SE3& T_local_camera, const Eigen::Vector3f& ray) const {
    const double distance = photometry::test_support::hit_distance(scene_.relief(), T_local_camera.translation,
                                                                   T_local_camera.rotation * ray.cast<double>());
    return distance > 0 ? static_cast<float>(1.0 / distance) : 0.0F;
  }

 private:
  photometry::test_support::ReliefCamera scene_;
  photometry::LensPyramid lens_;
};

}  // namespace tileflight::odometry::test_support
