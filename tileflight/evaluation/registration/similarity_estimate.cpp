#include "tileflight/evaluation/registration/similarity_estimate.h"

#include <algorithm>
#include <cmath>

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

Vec7 motion_between(const Sim3& reference, const Sim3& T, const Vec3& center) {
  const Sim3 beyond = T * reference.inverse();
  Vec7 motion;
  motion << beyond * center - center, geometry::so3_log(beyond.rotation), std::log(beyond.scale);
  return motion;
}

Sim3 apply_motion(const Sim3& T, const Vec7& motion, const Vec3& center) {
  const Sim3 about_center(std::exp(motion[6]), geometry::so3_exp(motion.segment<3>(3)), Vec3::Zero());
  const Vec3 translation = center + motion.head<3>() - about_center * center;
  return Sim3(about_center.scale, about_center.rotation, translation) * T;
}

namespace {

/// Change of a motion's centre: x_new = C x_old.
Mat7 change_of_center(const Vec3& from, const Vec3& to) {
  Mat7 change = Mat7::Identity();
  const Vec3 arm = to - from;
  change.block<3, 3>(0, 3) = -geometry::skew(arm);  // w x arm
  change.block<3, 1>(0, 6) = arm;
  return change;
}

}  // namespace

SimilarityEstimate SimilarityEstimate::recentered(const Vec3& new_center) const {
  const Mat7 back = change_of_center(new_center, center);  // x_old = back x_new
  return {T_target_source, new_center, back.transpose() * information * back};
}

double motion_sigma_m(const Mat7& covariance, const Sim3& T, const Vec3& center, const alignment::PointSpread& points) {
  // A motion (t, w, s) moves a point by t + w x p + s p, where p is its place relative to the centre. The mean square
  // of that is linear in the mean and the second moment of p.
  const Vec3 mean = T * points.mean - center;
  const geometry::Mat3 spread = points.second_moment - points.mean * points.mean.transpose();
  const geometry::Mat3 R = T.rotation.toRotationMatrix();
  const geometry::Mat3 moment = T.scale * T.scale * R * spread * R.transpose() + mean * mean.transpose();
  Mat7 squares = Mat7::Zero();  // of which the trace with the covariance is the mean square
  squares.block<3, 3>(0, 0).setIdentity();
  squares.block<3, 3>(0, 3) = -geometry::skew(mean);
  squares.block<3, 1>(0, 6) = mean;
  squares.block<3, 3>(3, 3) = moment.trace() * geometry::Mat3::Identity() - moment;
  squares(6, 6) = moment.trace();
  squares.block<3, 3>(3, 0) = squares.block<3, 3>(0, 3).transpose();
  squares.block<1, 3>(6, 0) = mean.transpose();
  return std::sqrt(std::max(0.0, (covariance * squares).trace()));
}

}  // namespace tileflight::registration
