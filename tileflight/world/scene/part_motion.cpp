#include "tileflight/world/scene/part_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::scene {
namespace {

using Eigen::Affine3d;
using geometry::Box3;
using geometry::Mat3;
using geometry::Vec3;

constexpr double kSmallestVolume = 1e-12;  // of a unit cube in a pose

void check_pose(const Affine3d& pose, const std::string& name) {
  if (!pose.matrix().allFinite()) throw InputError(name, "its pose is not finite");
  if (!(pose.linear().determinant() >= kSmallestVolume))
    throw InputError(name, "its pose mirrors it or makes it flat; scales must be above 0");
}

/// Between two poses the part must not be mirrored or flat either: (1 - s) I + s Q is regular for all s from 0 to 1,
/// with Q the change of the pose, if Q turns all vectors by less than a right angle.
void check_step(const Affine3d& from, const Affine3d& to, const std::string& name) {
  const Mat3 change = from.linear().inverse() * to.linear();
  const Mat3 twice_symmetric = change + change.transpose();
  if (twice_symmetric.llt().info() != Eigen::Success)
    throw InputError(name, "turns by a right angle or more from one pose to the next; give more poses");
}

/// Returns the bounds of the box's corners in all poses. Points move on straight lines from pose to pose, so the bounds
/// hold between these, too.
Box3 swept_box(const Box3& box, const std::vector<Affine3d>& poses) {
  Box3 around;
  if (box.isEmpty()) return around;
  for (const Affine3d& pose : poses) {
    for (int i = 0; i < 8; ++i) around.extend(pose * box.corner(static_cast<Box3::CornerType>(i)));
  }
  return around;
}

}  // namespace

Affine3d placed_at(const geometry::SE3& T_local_part, const Vec3& scale) {
  Affine3d pose = Affine3d::Identity();
  pose.linear() = T_local_part.rotation.toRotationMatrix() * scale.asDiagonal();
  pose.translation() = T_local_part.translation;
  return pose;
}

PartMotion::PartMotion(const PlacedPart& placed, const Vec3& anchor)
    : poses_(placed.poses), part_anchor_(placed.part->frame().anchor()), anchor_(anchor) {
  if (poses_.empty()) throw InputError(placed.name, "has no pose");
  for (const Affine3d& pose : poses_) check_pose(pose, placed.name);
  for (std::size_t i = 1; i < poses_.size(); ++i) check_step(poses_[i - 1], poses_[i], placed.name);
  bounds_ = swept_box(placed.part->bounds(), poses_);
  first_ = transform_of(poses_.front());
}

Affine3d PartMotion::pose(double time) const {
  if (poses_.size() == 1) return poses_.front();
  const double at = std::clamp(time, 0.0, 1.0) * static_cast<double>(poses_.size() - 1);
  const auto step = std::min(static_cast<std::size_t>(at), poses_.size() - 2);
  const double share = at - static_cast<double>(step);
  Affine3d between = poses_[step];
  between.matrix() += share * (poses_[step + 1].matrix() - poses_[step].matrix());
  return between;
}

PartTransform PartMotion::transform(float time) const {
  return poses_.size() == 1 ? first_ : transform_of(pose(static_cast<double>(time)));
}

PartTransform PartMotion::transform_of(const Affine3d& pose) const {
  const Mat3 linear = pose.linear();
  const Mat3 inverse = linear.inverse();
  return {inverse.cast<float>(), linear.cast<float>(), (linear.determinant() * inverse.transpose()).cast<float>(),
          (pose * part_anchor_ - anchor_).cast<float>()};
}

}  // namespace tileflight::scene
