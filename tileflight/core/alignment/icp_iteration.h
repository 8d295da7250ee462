#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/core/alignment/fixed_point.h"
#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/alignment/matcher.h"
#include "tileflight/core/alignment/ordered_sum.h"
#include "tileflight/core/alignment/plane_system.h"

namespace tileflight::alignment {

/// Source points relative to their centre, with the offsets to undo the centring. Coordinates near zero keep the second
/// moments accurate. Notation: p is a centred source point, y = T p a point relative to `target_center`; T starts at
/// `start` (translation zero).
struct CenteredSource {
  std::vector<geometry::Vec3> points;
  std::vector<geometry::Vec3> normals;  ///< unit length or zero; only filled for the generalised method
  geometry::Vec3 source_center = geometry::Vec3::Zero();
  geometry::Vec3 target_center = geometry::Vec3::Zero();  ///< the source's centre under the start
  geometry::Sim3 start;
  PointSpread spread;
  double length_m = 1.0;  ///< RMS distance of the transformed points from their centre
};

/// Sums over the matched points at one transform.
struct MatchSums {
  std::size_t matched = 0;
  double squares = 0.0;       ///< sum of the method's squared residuals, square metres
  double cost = 0.0;          ///< sum of their robust costs, square metres
  PointMoments moments;       ///< filled for point-to-point
  PointToPlaneSystem planes;  ///< filled for the other methods

  MatchSums& operator+=(const MatchSums& other) {
    matched += other.matched;
    squares += other.squares;
    cost += other.cost;
    moments += other.moments;
    planes += other.planes;
    return *this;
  }
};

/// Residual, radius, kernel and trimming to minimise over the matches.
struct ResidualModel {
  IcpMethod method = IcpMethod::kPointToPoint;
  double radius_m = 1.0;
  RobustKernel kernel{};
  double kept_share = 1.0;
};

/// One ICP iteration of any method, with any matcher.
template <class Matcher>
class IcpIteration {
 public:
  IcpIteration(Matcher& matcher, const CenteredSource& source, const ScaleRange& scale, const ResidualModel& residuals)
      : matcher_(matcher), source_(source), scale_(scale), residuals_(residuals) {}

  /// Evaluates T over every `stride`-th point.
  Evaluation evaluate(const geometry::Sim3& T, std::size_t stride = 1) {
    const std::size_t n = (source_.points.size() + stride - 1) / stride;
    const auto counted = static_cast<std::size_t>(std::ceil(residuals_.kept_share * static_cast<double>(n)));
    const double reach_m = counted < n ? trimming_distance(T, stride, n, counted) : residuals_.radius_m;
    const MatchSums sums = ordered_sum<MatchSums>(
        n, [&](std::size_t begin, std::size_t end) { return sum(T, reach_m, begin * stride, end * stride, stride); });
    const double missing = static_cast<double>(counted) - static_cast<double>(sums.matched);
    Evaluation e;
    e.matched = sums.matched;
    e.cost = sums.cost + std::max(0.0, missing) * residuals_.kernel.cost_m2(residuals_.radius_m * residuals_.radius_m);
    e.rms_m = sums.matched > 0 ? std::sqrt(sums.squares / static_cast<double>(sums.matched)) : 0.0;
    e.next = sums.matched > 0 ? next(T, sums) : T;
    return e;
  }

  /// Matches of every `stride`-th point at T.
  std::vector<std::pair<geometry::Vec3, Match>> sample(const geometry::Sim3& T, std::size_t stride) {
    std::vector<std::pair<geometry::Vec3, Match>> result;
    for (std::size_t i = 0; i < source_.points.size(); i += stride) {
      const geometry::Vec3 y = T * source_.points[i];
      Match match;
      if (matcher_.find(i, y, match)) result.emplace_back(y, match);
    }
    return result;
  }

 private:
  /// Distance of the `counted`-th nearest of the points, at most the radius.
  double trimming_distance(const geometry::Sim3& T, std::size_t stride, std::size_t n, std::size_t counted) {
    std::vector<double> distances_m(n);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n), [&](const auto& range) {
      Match match;
      for (std::size_t k = range.begin(); k < range.end(); ++k) {
        const bool found = matcher_.find(k * stride, T * source_.points[k * stride], match);
        distances_m[k] = found ? match.distance_m : residuals_.radius_m;
      }
    });
    const auto last = distances_m.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(counted, 1) - 1);
    std::nth_element(distances_m.begin(), last, distances_m.end());
    return *last;
  }

  MatchSums sum(const geometry::Sim3& T, double reach_m, std::size_t begin, std::size_t end, std::size_t stride) {
    const geometry::Mat3 linear = T.scale * T.rotation.toRotationMatrix();
    MatchSums sums;
    Match match;
    for (std::size_t i = begin; i < std::min(end, source_.points.size()); i += stride) {
      const geometry::Vec3 y = linear * source_.points[i] + T.translation;
      if (!matcher_.find(i, y, match) || match.distance_m > reach_m) continue;
      if (residuals_.method == IcpMethod::kGeneralized) {
        add_planes(T.rotation * source_.normals[i], y, match, sums);
      } else {
        add(source_.points[i], y, match, sums);
      }
    }
    return sums;
  }

  void add(const geometry::Vec3& p, const geometry::Vec3& y, const Match& match, MatchSums& sums) const {
    const bool to_point = residuals_.method == IcpMethod::kPointToPoint;
    if (!to_point && match.normal.isZero()) return;
    const double residual = to_point ? match.distance_m : match.normal.dot(y - match.point);
    const double weight = add_residual(residual * residual, sums);
    if (to_point) {
      sums.moments.add(p, match.point, weight);
    } else {
      sums.planes.add(y, match.point, match.normal, source_.length_m, weight);
    }
  }

  /// Equation (2) of Segal et al. with their plane model: each side is certain along its normal only, by the factor
  /// kThickness. Scaled so that two parallel planes give the point-to-plane residual.
  void add_planes(const geometry::Vec3& source_normal, const geometry::Vec3& y, const Match& match,
                  MatchSums& sums) const {
    constexpr double kThickness = 1e-3;
    if (match.normal.isZero()) return;
    const geometry::Mat3 covariance =
        2.0 * geometry::Mat3::Identity() -
        (1.0 - kThickness) * (match.normal * match.normal.transpose() + source_normal * source_normal.transpose());
    const geometry::Mat3 information = 2.0 * kThickness * covariance.inverse();
    const geometry::Vec3 offset = y - match.point;
    sums.planes.add(y, match.point, information, source_.length_m,
                    add_residual(offset.dot(information * offset), sums));
  }

  /// Adds a squared residual; returns its weight.
  double add_residual(double squared_m2, MatchSums& sums) const {
    ++sums.matched;
    sums.squares += squared_m2;
    sums.cost += residuals_.kernel.cost_m2(squared_m2);
    return residuals_.kernel.weight(squared_m2);
  }

  geometry::Sim3 next(const geometry::Sim3& T, const MatchSums& sums) const {
    if (residuals_.method != IcpMethod::kPointToPoint)
      return solve(sums.planes, {scale_.min / T.scale, scale_.max / T.scale}, source_.length_m) * T;
    return sums.moments.weight > 0.0 ? fit_similarity(sums.moments, scale_).T_target_source : T;
  }

  Matcher& matcher_;
  const CenteredSource& source_;
  ScaleRange scale_;
  ResidualModel residuals_;
};

}  // namespace tileflight::alignment
