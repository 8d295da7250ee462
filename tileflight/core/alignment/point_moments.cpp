#include "tileflight/core/alignment/point_moments.h"

#include <Eigen/SVD>
#include <algorithm>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Vec3;

void PointMoments::add(const Vec3& p, const Vec3& q, double w) {
  weight += w;
  source += w * p;
  target += w * q;
  target_source += (w * q) * p.transpose();
  source_squared += w * p.squaredNorm();
}

PointMoments& PointMoments::operator+=(const PointMoments& other) {
  weight += other.weight;
  source += other.source;
  target += other.target;
  target_source += other.target_source;
  source_squared += other.source_squared;
  return *this;
}

namespace {

struct RotationFit {
  Mat3 rotation;
  double trace_ds;  ///< tr(D S) of Umeyama's equation (42)
  bool well_conditioned;
};

/// Umeyama's equations (38) to (43). A covariance of rank below two leaves the rotation about a line open.
RotationFit fit_rotation(const Mat3& covariance) {
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3 d = svd.singularValues();
  const bool reflected = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0;
  const Vec3 s(1.0, 1.0, reflected ? -1.0 : 1.0);
  constexpr double kRankTolerance = 1e-10;
  const bool two_directions = d[0] > 0.0 && d[1] > kRankTolerance * d[0];
  return {svd.matrixU() * s.asDiagonal() * svd.matrixV().transpose(), d.dot(s), two_directions};
}

/// Smallest rotation that maps the single direction of a rank-one covariance.
Mat3 rotation_of_line(const Mat3& covariance) {
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[0] > 0.0)) return Mat3::Identity();
  return geometry::rotation_between(svd.matrixV().col(0), svd.matrixU().col(0)).toRotationMatrix();
}

}  // namespace

ScaleRange scale_range(ScaleMode mode, double scale, double center, double max_change) {
  if (mode == ScaleMode::kFixed) return {scale, scale};
  if (!(center > 0.0)) center = scale;
  return {center / max_change, center * max_change};
}

SimilarityFit fit_similarity(const PointMoments& m, const ScaleRange& range) {
  const Vec3 mean_source = m.source / m.weight;
  const Vec3 mean_target = m.target / m.weight;
  const Mat3 covariance = m.target_source / m.weight - mean_target * mean_source.transpose();
  const double source_variance = std::max(0.0, m.source_squared / m.weight - mean_source.squaredNorm());

  RotationFit fit = fit_rotation(covariance);
  if (!fit.well_conditioned) fit.rotation = rotation_of_line(covariance);

  const double free_scale = source_variance > 0.0 ? fit.trace_ds / source_variance : 1.0;
  const double scale = std::clamp(free_scale, range.min, range.max);
  const Vec3 translation = mean_target - scale * (fit.rotation * mean_source);
  return {{scale, Eigen::Quaterniond(fit.rotation), translation}, fit.well_conditioned};
}

}  // namespace tileflight::alignment
