#include "tileflight/core/alignment/gravity.h"

#include <Eigen/Eigenvalues>

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Vec3;

std::optional<Vec3> estimate_up_from_trajectory(const geometry::Trajectory& trajectory) {
  if (trajectory.empty()) return std::nullopt;
  Mat3 sideways = Mat3::Zero();
  Vec3 tops = Vec3::Zero();
  for (const geometry::StampedPose& pose : trajectory.poses) {
    const Vec3 x = pose.T_local_camera.rotation * Vec3::UnitX();
    sideways += x * x.transpose() / static_cast<double>(trajectory.size());
    tops -= pose.T_local_camera.rotation * Vec3::UnitY();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(sideways);
  constexpr double kTurned = 0.01;  // smallest mean squared sine of the rotation: about six degrees
  constexpr double kClearer = 4.0;  // smallest ratio of rotation to roll, as mean squares
  const Vec3 spread = eigen.eigenvalues();
  if (spread[1] < kTurned || spread[1] < kClearer * spread[0]) return std::nullopt;
  const Vec3 up = eigen.eigenvectors().col(0);
  return up.dot(tops) >= 0.0 ? up : Vec3(-up);
}

}  // namespace tileflight::alignment
