#include "tileflight/core/alignment/similarity_chart.h"

#include <algorithm>
#include <cmath>

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

Vec7 SimilarityChart::coordinates(const Sim3& T) const {
  Vec7 x;
  x << T.translation - base_.translation, geometry::so3_log(T.rotation * base_.rotation.conjugate()) * length_m_,
      std::log(T.scale / base_.scale) * length_m_;
  return x;
}

Sim3 SimilarityChart::similarity(const Vec7& x) const {
  return {base_.scale * std::exp(x[6] / length_m_), geometry::so3_exp(x.segment<3>(3) / length_m_) * base_.rotation,
          base_.translation + x.head<3>()};
}

PointSpread compute_spread(const std::vector<Vec3>& points) {
  PointSpread spread;
  const auto n = static_cast<double>(points.size());
  for (const Vec3& p : points) {
    spread.mean += p / n;
    spread.second_moment += p * p.transpose() / n;
  }
  return spread;
}

double rms_motion_m(const Sim3& A, const Sim3& B, const PointSpread& points) {
  const Mat3 linear = A.scale * A.rotation.toRotationMatrix() - B.scale * B.rotation.toRotationMatrix();
  const Vec3 constant = A.translation - B.translation;
  const double squared = constant.squaredNorm() + 2.0 * constant.dot(linear * points.mean) +
                         (linear * points.second_moment * linear.transpose()).trace();
  return std::sqrt(std::max(0.0, squared));
}

Sim3 uncentered(const Sim3& T, const Vec3& source_center, const Vec3& target_center) {
  return {T.scale, T.rotation, target_center + T.translation - T.scale * (T.rotation * source_center)};
}

}  // namespace tileflight::alignment
