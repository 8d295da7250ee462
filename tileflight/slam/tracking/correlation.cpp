#include "tileflight/slam/tracking/correlation.h"

#include <cmath>
#include <utility>
#include <vector>

namespace tileflight::tracking {

double correlation(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                   const keyframes::Pyramid& target, const geometry::SE3& T) {
  const ReferenceLevel& level = reference.levels[0];
  const keyframes::PyramidLevel& picture = target.levels[0];
  const Eigen::Matrix3f R = T.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T.translation.cast<float>();
  std::vector<std::pair<double, double>> pairs;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < level.size(); ++i) {
    Eigen::Vector2f pixel;
    if (!lens.lenses[0].project<float>(R * level.ray_of(i) + level.rho[i] * t, pixel)) continue;
    if (!picture.inside(pixel.x(), pixel.y(), 2.0F)) continue;
    const float seen = picture.sample(pixel.x(), pixel.y())[static_cast<int>(keyframes::kIntensity)];
    pairs.emplace_back(level.intensity[i], seen);
    mean += Eigen::Vector2d(level.intensity[i], seen);
  }
  if (pairs.size() < 3) return 0.0;
  mean /= static_cast<double>(pairs.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const auto& [expected, seen] : pairs) {
    const Eigen::Vector2d d = Eigen::Vector2d(expected, seen) - mean;
    spread += d * d.transpose();
  }
  const double contrast = std::sqrt(spread(0, 0) * spread(1, 1));
  return contrast > 0.0 ? spread(0, 1) / contrast : 0.0;
}

}  // namespace tileflight::tracking
