#include "tileflight/evaluation/registration/inertial_up.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace tileflight::registration {
namespace {

using geometry::Vec3;

constexpr double kGravity_m_s2 = 9.81;

/// Velocity by central differences, map units per second.
Vec3 velocity_at(const geometry::Trajectory& path, std::size_t i) {
  const std::size_t before = i == 0 ? 0 : i - 1, after = std::min(i + 1, path.size() - 1);
  return (path.poses[after].T_local_camera.translation - path.poses[before].T_local_camera.translation) /
         (path.poses[after].time_s - path.poses[before].time_s);
}

/// An interval of the flight: mean specific force in the map's axes, mean acceleration in map units.
struct Segment {
  Vec3 force = Vec3::Zero(), acceleration = Vec3::Zero();
};

std::optional<Segment> make_segment(const geometry::Trajectory& path, std::size_t first, std::size_t last,
                                    const std::vector<SpecificForce>& readings) {
  constexpr int kFewest = 10;  // readings per interval, to average out vibration and noise
  const double begin_s = path.poses[first].time_s, end_s = path.poses[last].time_s;
  Segment stretch;
  int count = 0;
  for (const SpecificForce& reading : readings) {
    if (reading.time_s < begin_s || reading.time_s > end_s) continue;
    const auto pose = geometry::interpolate(path, reading.time_s);
    if (!pose) continue;
    stretch.force += pose->rotation * reading.force_m_s2;
    ++count;
  }
  if (count < kFewest) return std::nullopt;
  stretch.force /= count;
  stretch.acceleration = (velocity_at(path, last) - velocity_at(path, first)) / (end_s - begin_s);
  return stretch;
}

std::vector<Segment> split_into_segments(const geometry::Trajectory& path, const std::vector<SpecificForce>& readings) {
  constexpr std::size_t kMost = 10, kLeastPoses = 4;
  std::vector<Segment> stretches;
  if (path.size() < 3 * kLeastPoses) return stretches;
  const std::size_t count = std::min(kMost, path.size() / kLeastPoses), last = path.size() - 1;
  for (std::size_t k = 0; k < count; ++k) {
    if (const auto stretch = make_segment(path, k * last / count, (k + 1) * last / count, readings))
      stretches.push_back(*stretch);
  }
  return stretches;
}

}  // namespace

std::optional<UpDirection> estimate_up_from_accelerometer(const geometry::Trajectory& T_map_camera,
                                                          const std::vector<SpecificForce>& readings) {
  constexpr std::size_t kFewest = 3;
  constexpr double kSizeShare = 0.05, kLeastSigma_rad = 0.01;  // sigma floor for the accelerometer's bias and mounting;
                                                               // chosen by hand
  const std::vector<Segment> stretches = split_into_segments(T_map_camera, readings);
  if (stretches.size() < kFewest) return std::nullopt;
  const auto rows = static_cast<Eigen::Index>(3 * stretches.size());
  Eigen::MatrixX4d A(rows, 4);  // scale, gravity upwards
  Eigen::VectorXd b(rows);
  for (std::size_t k = 0; k < stretches.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(3 * k);
    A.block<3, 1>(row, 0) = stretches[k].acceleration;
    A.block<3, 3>(row, 1).setIdentity();
    b.segment<3>(row) = stretches[k].force;
  }
  // At constant velocity the scale is not determined and not needed: take the minimum-norm solution.
  const Eigen::Vector4d x = A.completeOrthogonalDecomposition().solve(b);
  const Vec3 gravity = x.tail<3>();
  if (!(std::abs(gravity.norm() - kGravity_m_s2) < kSizeShare * kGravity_m_s2)) return std::nullopt;
  const double variance = (A * x - b).squaredNorm() / static_cast<double>(rows - 4);
  const Eigen::Matrix4d information = A.transpose() * A + 1e-9 * Eigen::Matrix4d::Identity();
  const double error = std::sqrt(variance * information.inverse().bottomRightCorner<3, 3>().trace());
  return UpDirection{gravity.normalized(), std::hypot(kLeastSigma_rad, error / kGravity_m_s2)};
}

}  // namespace tileflight::registration
