#include "tileflight/core/alignment/pose_alignment.h"

#include <Eigen/SVD>

#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

namespace {

Mat3 chordal_mean(const std::vector<SE3>& source, const std::vector<SE3>& target) {
  Mat3 sum = Mat3::Zero();
  for (std::size_t i = 0; i < source.size(); ++i)
    sum += (target[i].rotation * source[i].rotation.conjugate()).toRotationMatrix();
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Vec3(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

Vec3 mean_position(const std::vector<SE3>& poses) {
  Vec3 mean = Vec3::Zero();
  for (const SE3& pose : poses) mean += pose.translation / static_cast<double>(poses.size());
  return mean;
}

}  // namespace

Sim3 fit_poses(const std::vector<SE3>& source, const std::vector<SE3>& target) {
  if (source.empty() || source.size() != target.size())
    throw InputError("poses", "both lists must hold the same number of poses, at least one");
  const Mat3 rotation = chordal_mean(source, target);
  const Vec3 source_mean = mean_position(source), target_mean = mean_position(target);
  double product = 0.0, square = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Vec3 p = rotation * (source[i].translation - source_mean);
    product += p.dot(target[i].translation - target_mean);
    square += p.squaredNorm();
  }
  const double scale = square > 0.0 && product > 0.0 ? product / square : 1.0;
  return {scale, Eigen::Quaterniond(rotation), target_mean - scale * (rotation * source_mean)};
}

}  // namespace tileflight::alignment
