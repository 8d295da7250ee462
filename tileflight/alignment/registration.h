#pragma once

#include <cmath>

#include "tileflight/alignment/constraint.h"
#include "tileflight/alignment/fixed_point.h"
#include "tileflight/alignment/icp.h"
#include "tileflight/alignment/ordered_sum.h"

namespace tileflight::alignment {

/// What an ICP works on: the points that take part about their centre, and the frames that undo it. Coordinates near
/// zero keep the second moments exact. Notation: p in `source_centered`, y = T p in `target_centered`, T starts at
/// `start` (translation zero).
struct CenteredSource {
  std::vector<geometry::Vec3> points;
  geometry::Vec3 source_center = geometry::Vec3::Zero();
  geometry::Vec3 target_center = geometry::Vec3::Zero();  ///< where the start moves the source's centre
  geometry::Sim3 start;
  PointSpread spread;
  double length_m = 1.0;  ///< root mean square distance of the moved points from their centre

  geometry::Sim3 uncentered(const geometry::Sim3& T) const {
    return {T.scale, T.rotation, target_center + T.translation - T.scale * (T.rotation * source_center)};
  }
};

/// Sums over the matched points of one look at a transform.
struct MatchSums {
  std::size_t matched = 0;
  double squares = 0.0;  ///< of the residuals that the method minimises, square metres
  PointMoments moments;  ///< filled for point-to-point
  PlaneSystem planes;    ///< filled for the others

  MatchSums& operator+=(const MatchSums& other) {
    matched += other.matched;
    squares += other.squares;
    moments += other.moments;
    planes += other.planes;
    return *this;
  }
};

/// The point-to-point or point-to-plane iteration with a matcher.
template <class Matcher>
class Registration {
 public:
  Registration(Matcher& matcher, const CenteredSource& source, const ScaleRange& scale, IcpMethod method,
               double radius_m)
      : matcher_(matcher), source_(source), scale_(scale), method_(method), radius_m_(radius_m) {}

  /// Over every `stride`-th point.
  Evaluation evaluate(const geometry::Sim3& T, std::size_t stride = 1) {
    const std::size_t n = (source_.points.size() + stride - 1) / stride;
    const MatchSums sums = ordered_sum<MatchSums>(
        n, [&](std::size_t begin, std::size_t end) { return sum(T, begin * stride, end * stride, stride); });
    const double unmatched = static_cast<double>(n - sums.matched);
    Evaluation e;
    e.matched = sums.matched;
    e.cost = sums.squares + unmatched * radius_m_ * radius_m_;
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
  MatchSums sum(const geometry::Sim3& T, std::size_t begin, std::size_t end, std::size_t stride) {
    const geometry::Mat3 linear = T.scale * T.rotation.toRotationMatrix();
    MatchSums sums;
    for (std::size_t i = begin; i < std::min(end, source_.points.size()); i += stride) {
      const geometry::Vec3 y = linear * source_.points[i] + T.translation;
      Match match;
      if (matcher_.find(i, y, match)) add(source_.points[i], y, match, sums);
    }
    return sums;
  }

  void add(const geometry::Vec3& p, const geometry::Vec3& y, const Match& match, MatchSums& sums) const {
    if (method_ == IcpMethod::kPointToPoint) {
      sums.moments.add(p, match.point);
      sums.squares += match.distance_m * match.distance_m;
    } else {
      if (match.normal.isZero()) return;
      const double residual = match.normal.dot(y - match.point);
      sums.planes.add(y, match.point, match.normal, source_.length_m);
      sums.squares += residual * residual;
    }
    ++sums.matched;
  }

  geometry::Sim3 next(const geometry::Sim3& T, const MatchSums& sums) const {
    if (method_ == IcpMethod::kPointToPoint) return fit_similarity(sums.moments, scale_).T_target_source;
    return solve(sums.planes, {scale_.least / T.scale, scale_.most / T.scale}, source_.length_m) * T;
  }

  Matcher& matcher_;
  const CenteredSource& source_;
  ScaleRange scale_;
  IcpMethod method_;
  double radius_m_;
};

}  // namespace tileflight::alignment
