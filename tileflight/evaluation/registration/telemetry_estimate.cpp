#include "tileflight/evaluation/registration/telemetry_estimate.h"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/decompositions.h"

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

using Eigen::Quaterniond;
using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

Quaterniond nearest_rotation(const Mat3& m) {
  const Eigen::JacobiSVD<Mat3> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return Quaterniond(Mat3(svd.matrixU() * Vec3(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose()));
}

/// Weiszfeld iteration on the chordal distance, robust to outliers.
Quaterniond robust_mean(const std::vector<Quaterniond>& rotations) {
  Mat3 sum = Mat3::Zero();
  for (const Quaterniond& q : rotations) sum += q.toRotationMatrix();
  Quaterniond mean = nearest_rotation(sum);
  constexpr int kIterations = 30;
  constexpr double kLeast = 1e-4;
  for (int k = 0; k < kIterations; ++k) {
    sum.setZero();
    for (const Quaterniond& q : rotations)
      sum += q.toRotationMatrix() / std::max(kLeast, (q.toRotationMatrix() - mean.toRotationMatrix()).norm());
    mean = nearest_rotation(sum);
  }
  return mean;
}

}  // namespace

std::optional<RotationEstimate> rotation_from_attitudes(const geometry::Trajectory& T_map_camera,
                                                        const std::vector<AttitudeFix>& fixes) {
  std::vector<Quaterniond> rotations;
  double tilt_rad = 0.0, yaw_rad = 0.0;
  for (const AttitudeFix& fix : fixes) {
    const auto pose = geometry::interpolate(T_map_camera, fix.time_s);
    if (!pose) continue;
    rotations.push_back(fix.R_local_camera * pose->rotation.conjugate());
    tilt_rad = std::max(tilt_rad, fix.tilt_sigma_rad);
    yaw_rad = std::max(yaw_rad, fix.yaw_sigma_rad);
  }
  if (rotations.empty()) return std::nullopt;
  RotationEstimate estimate;
  estimate.R_local_map = robust_mean(rotations);
  estimate.fixes = rotations.size();
  estimate.covariance = Vec3(tilt_rad * tilt_rad, tilt_rad * tilt_rad, yaw_rad * yaw_rad).asDiagonal();
  return estimate;
}

RotationEstimate upright_rotation(const UpDirection& up) {
  RotationEstimate estimate;
  estimate.R_local_map = geometry::rotation_between(up.up_map, Vec3::UnitZ());
  const double tilt2 = up.sigma_rad * up.sigma_rad;
  const double unknown2 = std::pow(1e3 * std::numbers::pi, 2);
  estimate.covariance = Vec3(tilt2, tilt2, unknown2).asDiagonal();
  return estimate;
}

namespace {

/// The path's positions at the fixes' times, without outliers.
struct Pairs {
  std::vector<Vec3> map, local;
  double horizontal_sigma_m = 0.0, vertical_sigma_m = 0.0;  ///< largest stated
};

Pairs pair_positions(const geometry::Trajectory& path, const std::vector<alignment::PositionFix>& fixes,
                     const alignment::TrajectoryAlignment& fit) {
  Pairs pairs;
  for (const alignment::PositionFix& fix : fixes) {
    const auto pose = geometry::interpolate(path, fix.time_s + fit.time_offset_s);
    constexpr double kOutlier_m = 3.0;
    const double inlier_m = std::max(kOutlier_m, 4.0 * fit.rmse_m);
    if (!pose || (fit.T_local_map * pose->translation - fix.position).norm() > inlier_m) continue;
    pairs.map.push_back(pose->translation);
    pairs.local.push_back(fix.position);
    pairs.horizontal_sigma_m = std::max(pairs.horizontal_sigma_m, fix.horizontal_sigma_m);
    pairs.vertical_sigma_m = std::max(pairs.vertical_sigma_m, fix.vertical_sigma_m);
  }
  return pairs;
}

using Mat37 = Eigen::Matrix<double, 3, 7>;

/// Derivative of a transformed position by a motion about `center`.
Mat37 position_jacobian(const Vec3& position, const Vec3& center) {
  const Vec3 arm = position - center;
  Mat37 jacobian;
  jacobian << Mat3::Identity(), -geometry::skew(arm), arm;
  return jacobian;
}

/// Weight of one position: a receiver's errors are correlated over seconds, so all positions together count as at most
/// a few independent ones.
double position_weight(const Pairs& pairs, const alignment::TrajectoryAlignment& fit) {
  constexpr double kLeastSigma_m = 0.02, kWitnesses = 6.0;
  const double noise_m = std::max(kLeastSigma_m, fit.rmse_m);
  return std::min(1.0, kWitnesses / static_cast<double>(pairs.map.size())) / (noise_m * noise_m);
}

Mat7 position_information(const Pairs& pairs, double weight, const Sim3& T, const Vec3& center) {
  Mat7 information = Mat7::Zero();
  for (const Vec3& p : pairs.map) {
    const Mat37 jacobian = position_jacobian(T * p, center);
    information += weight * jacobian.transpose() * jacobian;
  }
  return information;
}

/// Information after eliminating an error common to all positions (Schur complement).
Mat7 marginalize_common_bias(const Mat7& information, const Pairs& pairs) {
  constexpr double kLeastSigma_m = 0.02;
  const double across2 = std::pow(std::max(kLeastSigma_m, pairs.horizontal_sigma_m), 2);
  const double up2 = std::pow(std::max(kLeastSigma_m, pairs.vertical_sigma_m), 2);
  const Mat3 bias = Vec3(1.0 / across2, 1.0 / across2, 1.0 / up2).asDiagonal();
  const Eigen::Matrix<double, 7, 3> shared = information.leftCols<3>();
  return information - shared * (bias + information.topLeftCorner<3, 3>()).inverse() * shared.transpose();
}

/// Least-squares translation and scale of the positions for a rotation.
Sim3 fit_with_rotation(const Pairs& pairs, const Quaterniond& R, double fallback_scale) {
  Vec3 map_mean = Vec3::Zero(), local_mean = Vec3::Zero();
  const auto n = static_cast<double>(pairs.map.size());
  for (std::size_t i = 0; i < pairs.map.size(); ++i) map_mean += pairs.map[i] / n, local_mean += pairs.local[i] / n;
  double product = 0.0, square = 0.0;
  for (std::size_t i = 0; i < pairs.map.size(); ++i) {
    const Vec3 p = R * (pairs.map[i] - map_mean);
    product += p.dot(pairs.local[i] - local_mean);
    square += p.squaredNorm();
  }
  const double scale = square > 0.0 && product > 0.0 ? product / square : fallback_scale;
  return {scale, R, local_mean - scale * (R * map_mean)};
}

double squared_residuals(const Pairs& pairs, const Sim3& T) {
  double sum = 0.0;
  for (std::size_t i = 0; i < pairs.map.size(); ++i) sum += (T * pairs.map[i] - pairs.local[i]).squaredNorm();
  return sum;
}

/// Initial similarity for a rotation whose heading may be unknown (a sigma of half a turn or more): the best of one
/// every ten degrees.
Sim3 initial_similarity(const Pairs& pairs, const RotationEstimate& rotation, double fallback_scale) {
  constexpr int kTurns = 36;
  Sim3 best = fit_with_rotation(pairs, rotation.R_local_map, fallback_scale);
  if (rotation.covariance(2, 2) < std::numbers::pi * std::numbers::pi) return best;
  for (int k = 1; k < kTurns; ++k) {
    const Quaterniond heading(Eigen::AngleAxisd(2.0 * std::numbers::pi * k / kTurns, Vec3::UnitZ()));
    const Sim3 T = fit_with_rotation(pairs, heading * rotation.R_local_map, fallback_scale);
    if (squared_residuals(pairs, T) < squared_residuals(pairs, best)) best = T;
  }
  return best;
}

/// Rotation sigma with translation and scale eliminated from the information.
void set_rotation_sigma(TelemetryEstimate& telemetry) {
  const Mat7& I = telemetry.estimate.information;
  Eigen::Matrix4d others;
  Eigen::Matrix<double, 3, 4> shared;
  others << I.block<3, 3>(0, 0), I.block<3, 1>(0, 6), I.block<1, 3>(6, 0), I(6, 6);
  shared << I.block<3, 3>(3, 0), I.block<3, 1>(3, 6);
  const Mat3 left = I.block<3, 3>(3, 3) - shared * others.ldlt().solve(shared.transpose());
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(left);
  const double least = eigen.eigenvalues()[0];
  telemetry.worst_rotation_sigma_rad =
      least > 0.0 ? std::min(std::numbers::pi, 1.0 / std::sqrt(least)) : std::numbers::pi;
  telemetry.worst_axis_local = eigen.eigenvectors().col(0);
}

}  // namespace

TelemetryEstimate estimate_from_telemetry(const geometry::Trajectory& T_map_camera,
                                          const std::vector<alignment::PositionFix>& fixes,
                                          const alignment::TrajectoryAlignment& fit,
                                          const std::optional<RotationEstimate>& rotation) {
  const Pairs pairs = pair_positions(T_map_camera, fixes, fit);
  const double weight = position_weight(pairs, fit);
  Sim3 T = rotation ? initial_similarity(pairs, *rotation, fit.T_local_map.scale) : fit.T_local_map;
  const Quaterniond R_known = T.rotation;  // the known rotation; its heading may be unknown
  Vec3 center = Vec3::Zero();
  for (const Vec3& p : pairs.local) center += p / static_cast<double>(pairs.local.size());
  const Mat3 by_attitude = rotation ? Mat3(rotation->covariance.inverse()) : Mat3(Mat3::Zero());
  constexpr int kIterations = 10;
  for (int k = 0; k < kIterations && rotation; ++k) {
    Mat7 H = position_information(pairs, weight, T, center);
    Vec7 pull = Vec7::Zero();
    for (std::size_t i = 0; i < pairs.map.size(); ++i)
      pull += weight * position_jacobian(T * pairs.map[i], center).transpose() * (pairs.local[i] - T * pairs.map[i]);
    H.block<3, 3>(3, 3) += by_attitude;
    pull.segment<3>(3) -= by_attitude * geometry::so3_log(T.rotation * R_known.conjugate());
    constexpr double kDamping = 1e-12;
    const Mat7 damped = H + kDamping * H.trace() * Mat7::Identity();
    T = apply_motion(T, geometry::solve_symmetric(damped, pull), center);
  }
  TelemetryEstimate telemetry;
  telemetry.estimate = {T, center, marginalize_common_bias(position_information(pairs, weight, T, center), pairs)};
  telemetry.estimate.information.block<3, 3>(3, 3) += by_attitude;
  set_rotation_sigma(telemetry);
  return telemetry;
}

Vec3 distance_to_fixes(const geometry::Trajectory& T_map_camera, const std::vector<alignment::PositionFix>& fixes,
                       const geometry::Sim3& T_local_map, double time_offset_s) {
  const auto median_with = [&](double offset_s) -> std::optional<Vec3> {
    std::vector<double> x, y, z;
    for (const alignment::PositionFix& fix : fixes) {
      const auto pose = geometry::interpolate(T_map_camera, fix.time_s + offset_s);
      if (!pose) continue;
      const Vec3 apart_m = T_local_map * pose->translation - fix.position;
      x.push_back(apart_m.x()), y.push_back(apart_m.y()), z.push_back(apart_m.z());
    }
    if (x.empty()) return std::nullopt;
    return Vec3(base::median(x), base::median(y), base::median(z));
  };
  const std::optional<Vec3> as_stated_m = median_with(0.0), shifted_m = median_with(time_offset_s);
  if (as_stated_m && shifted_m) return shifted_m->norm() < as_stated_m->norm() ? *shifted_m : *as_stated_m;
  return as_stated_m.value_or(shifted_m.value_or(Vec3::Zero()));
}

}  // namespace tileflight::registration
