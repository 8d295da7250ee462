#include "tileflight/core/alignment/icp.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/core/alignment/fixed_point.h"
#include "tileflight/core/alignment/matcher.h"
#include "tileflight/core/alignment/normals.h"
#include "tileflight/core/alignment/ordered_sum.h"
#include "tileflight/core/alignment/plane_system.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::alignment {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::Vec3;

IcpOptions converging_icp_options() {
  IcpOptions options;
  options.stop = IcpStop::kStep;
  options.accelerate = true;
  return options;
}

namespace {

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

void check_points(const char* where, const std::vector<Vec3>& points) {
  if (points.empty()) throw InputError(where, "has no points; there is nothing to align");
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) throw InputError(where, "point " + std::to_string(i) + " is not finite");
  }
}

void check_start(const Sim3& T, const IcpOptions& options) {
  if (!T.matrix().allFinite() || !(T.scale > 0.0)) {
    throw InputError("initial transform", "is not a finite similarity with a scale above zero");
  }
  if (!(options.radius_m > 0.0) || !std::isfinite(options.radius_m)) {
    throw InputError("radius", "must be above zero, in metres");
  }
  if (!(options.max_scale_change >= 1.0)) throw InputError("max_scale_change", "must be at least 1");
  if (!(options.kept_share > 0.0 && options.kept_share <= 1.0))
    throw InputError("kept_share", "must be above 0 and at most 1");
  if (!(options.kernel.scale_m > 0.0) || !std::isfinite(options.kernel.scale_m))
    throw InputError("kernel", "its scale must be above zero, in metres");
}

bool is_in_regions(const Vec3& moved, const std::vector<geometry::Box3>& regions) {
  return regions.empty() ||
         std::any_of(regions.begin(), regions.end(), [&](const geometry::Box3& box) { return box.contains(moved); });
}

/// Indices of the points used, in spatial order.
std::vector<std::uint32_t> select_points(const PointCloud& source, const Sim3& T,
                                         const std::vector<geometry::Box3>& regions) {
  std::vector<std::uint32_t> inside;
  std::vector<Vec3> positions;
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (!is_in_regions(T * source.positions[i], regions)) continue;
    inside.push_back(static_cast<std::uint32_t>(i));
    positions.push_back(source.positions[i]);
  }
  std::vector<std::uint32_t> ordered;
  ordered.reserve(inside.size());
  for (const std::uint32_t k : geometry::morton_order(positions, geometry::kCoarseMortonCells))
    ordered.push_back(inside[k]);
  return ordered;
}

/// Normals for the generalised method; a point without a normal is treated as a point.
std::vector<Vec3> select_normals(const PointCloud& source, const std::vector<std::uint32_t>& chosen) {
  const PointCloud& with = source.normals.empty() ? with_normals(source) : source;
  std::vector<Vec3> normals;
  normals.reserve(chosen.size());
  for (const std::uint32_t i : chosen) {
    const Vec3 normal = with.normals[i].cast<double>();
    normals.push_back(normal.allFinite() && !normal.isZero() ? Vec3(normal.normalized()) : Vec3(Vec3::Zero()));
  }
  return normals;
}

CenteredSource center_source(std::vector<Vec3> points, const Sim3& T) {
  CenteredSource source;
  const auto n = static_cast<double>(points.size());
  for (const Vec3& p : points) source.source_center += p / n;
  for (Vec3& p : points) {
    p -= source.source_center;
    source.spread.second_moment += p * p.transpose() / n;
  }
  source.target_center = T * source.source_center;
  source.start = {T.scale, T.rotation, Vec3::Zero()};
  const double rms_m = T.scale * std::sqrt(source.spread.second_moment.trace());
  source.length_m = rms_m > 0.0 ? rms_m : 1.0;
  source.points = std::move(points);
  return source;
}

bool is_at_scale_bound(double scale, const ScaleRange& range, const IcpOptions& options) {
  constexpr double kClose = 1e-9;
  return options.scale == ScaleMode::kEstimated && options.max_scale_change > 1.0 &&
         (scale <= range.min * (1.0 + kClose) || scale >= range.max * (1.0 - kClose));
}

std::string format_number(double value) { return base::formatted("%.3g", value); }

void add_note(IcpResult& result, const std::string& text) { result.note += (result.note.empty() ? "" : "; ") + text; }

const char* method_name(const IcpOptions& options) {
  switch (options.method) {
    case IcpMethod::kPointToPoint:
      return "icp-point-to-point";
    case IcpMethod::kPointToPlane:
      return "icp-point-to-plane";
    case IcpMethod::kPointToMesh:
      return "icp-point-to-mesh";
    case IcpMethod::kGeneralized:
      return "icp-generalized";
  }
  return "";
}

/// Step rule. With the planes of a cloud the cost may rise, since a point that changes its match changes its plane.
StepRule step_rule(const IcpOptions& options, bool accelerate) {
  if (options.method == IcpMethod::kPointToPlane || options.method == IcpMethod::kGeneralized)
    return {accelerate, 1e-3, 1};
  return {accelerate};
}

/// Checks a stop by RMS change: continues, accelerated, until the step length is small.
FixedPointResult check_stop(const EvaluateFunction& evaluate, FixedPointResult stopped, const CenteredSource& source,
                            const IcpOptions& options, IcpResult& result) {
  if (options.stop != IcpStop::kRmsChange || !stopped.stopped_by_rule || options.step_m <= 0.0) return stopped;
  constexpr int kMoreIterations = 300;
  FixedPointResult further =
      iterate_fixed_point(evaluate, stopped.T, step_rule(options, true), {0.0, options.step_m, kMoreIterations},
                          source.spread, source.length_m);
  result.remaining_motion_m = rms_motion_m(stopped.T, further.T, source.spread);
  if (result.remaining_motion_m <= options.false_stop_m) return stopped;
  const std::string moved = std::to_string(further.iterations) + " more, accelerated, moved the points by " +
                            format_number(result.remaining_motion_m) + " m (RMS)";
  add_note(result, "the stopping rule on RMS change ended too early, after " + std::to_string(stopped.iterations) +
                       " iterations; " + moved +
                       (options.continue_after_false_stop ? ", and that result is used" : ""));
  further.iterations += stopped.iterations;
  if (options.continue_after_false_stop) return further;
  stopped.stopped_by_rule = false;
  return stopped;
}

void note_convergence(const FixedPointResult& end, const IcpOptions& options, IcpResult& result) {
  result.converged = end.stopped_by_rule;
  if (end.stopped_by_rule || result.remaining_motion_m > options.false_stop_m) return;
  add_note(result, "not converged after " + std::to_string(end.iterations) +
                       " iterations; the next step would move the points by " + format_number(end.last_step_m) +
                       " m (RMS)");
}

void note_fit(const IcpResult& found, const CenteredSource& source, const ScaleRange& range, const IcpOptions& options,
              IcpResult& result) {
  constexpr std::size_t kFew = 10;
  constexpr double kLowFitness = 0.1;
  if (found.correspondences < kFew) {
    result.converged = false;
    add_note(result, "only " + std::to_string(found.correspondences) + " correspondences");
  } else if (found.fitness < kLowFitness) {
    add_note(result, "only " + format_number(100.0 * found.fitness) + " % of " + std::to_string(source.points.size()) +
                         " points have a correspondence within " + format_number(options.radius_m) + " m");
  }
  if (is_at_scale_bound(found.T_target_source.scale, range, options)) {
    result.converged = false;
    add_note(result, "the scale reached its limit, " + format_number(found.T_target_source.scale) +
                         ", of the allowed range " + format_number(range.min) + " to " + format_number(range.max));
  }
}

void note_constraint(IcpResult& result) {
  if (result.constraint.well_constrained) return;
  add_note(result, "ambiguous, ill-constrained: the matched surface hardly constrains " +
                       (result.constraint.weakest_motion.empty() ? "any motion" : result.constraint.weakest_motion));
}

/// At most about 4000 of the matches, as planes.
template <class Matcher, class NormalOf>
std::vector<MatchedPlane> matched_planes(IcpIteration<Matcher>& registration, const Sim3& T,
                                         const CenteredSource& source, const NormalOf& normal_of) {
  constexpr std::size_t kEnough = 4000;
  std::vector<MatchedPlane> planes;
  for (const auto& [y, match] : registration.sample(T, 1 + source.points.size() / kEnough)) {
    const Vec3 normal = normal_of(match);
    if (!normal.isZero()) planes.push_back({y, normal, normal.dot(y - match.point)});
  }
  return planes;
}

/// Adds the constraint and the uncertainty of the result.
void add_diagnostics(const std::vector<MatchedPlane>& matches, const Sim3& T, const CenteredSource& source,
                     const IcpOptions& options, IcpResult& result) {
  const bool with_scale = options.scale == ScaleMode::kEstimated;
  PointToPlaneSystem planes;
  for (const MatchedPlane& m : matches) planes.add(m.point, m.point, m.normal, source.length_m);
  result.constraint = analyze_constraint(planes, matches.size(), with_scale);
  UncertaintyOptions uncertainty;
  uncertainty.length_m = source.length_m;
  uncertainty.sampled_share =
      std::min(1.0, static_cast<double>(matches.size()) / static_cast<double>(result.correspondences));
  uncertainty.with_scale = with_scale;
  PointSpread moved;
  const geometry::Mat3 linear = T.scale * T.rotation.toRotationMatrix();
  moved.second_moment = linear * source.spread.second_moment * linear.transpose();
  result.uncertainty = estimate_uncertainty(matches, moved, uncertainty);
}

/// Warm start: an accelerated iteration over an even subset of the points, with a coarser stopping rule.
template <class Matcher>
FixedPointResult warm_start(IcpIteration<Matcher>& registration, const CenteredSource& source,
                            const IcpOptions& options) {
  constexpr std::size_t kLeaders = 6000;
  const std::size_t stride = source.points.size() / kLeaders;
  FixedPointResult start;
  start.T = source.start;
  if (!options.accelerate || stride < 2) return start;
  const EvaluateFunction evaluate = [&](const Sim3& T) { return registration.evaluate(T, stride); };
  constexpr double kCoarser = 10.0;
  return iterate_fixed_point(evaluate, source.start, step_rule(options, true),
                             {0.0, kCoarser * options.step_m, options.max_iterations}, source.spread, source.length_m);
}

/// ICP with a given matcher.
template <class Matcher, class NormalOf>
IcpResult run_icp(Matcher& matcher, const CenteredSource& source, const Sim3& initial, const IcpOptions& options,
                  const NormalOf& normal_of) {
  IcpResult result;
  result.method = method_name(options);
  result.points = source.points.size();
  const ScaleRange range = scale_range(options.scale, initial.scale, options.scale_center, options.max_scale_change);
  IcpIteration<Matcher> registration(matcher, source, range,
                                     {options.method, options.radius_m, options.kernel, options.kept_share});
  const EvaluateFunction evaluate = [&](const Sim3& T) { return registration.evaluate(T); };
  const bool by_step = options.stop == IcpStop::kStep;
  const StopRule stop{by_step ? 0.0 : options.rms_change_m, by_step ? options.step_m : 0.0, options.max_iterations};

  const FixedPointResult start = warm_start(registration, source, options);
  FixedPointResult end = iterate_fixed_point(evaluate, start.T, step_rule(options, options.accelerate), stop,
                                             source.spread, source.length_m);
  end.iterations += start.iterations;
  result.T_target_source = initial;
  result.iterations = end.iterations;
  if (end.evaluation.matched == 0) {
    add_note(result,
             "no correspondence within " + format_number(options.radius_m) + " m; start closer or widen the radius");
    return result;
  }
  end = check_stop(evaluate, end, source, options, result);
  result.iterations = end.iterations;
  result.T_target_source = uncentered(end.T, source.source_center, source.target_center);
  result.rmse_m = end.evaluation.rms_m;
  result.correspondences = end.evaluation.matched;
  result.fitness = static_cast<double>(end.evaluation.matched) / static_cast<double>(source.points.size());
  add_diagnostics(matched_planes(registration, end.T, source, normal_of), end.T, source, options, result);
  note_convergence(end, options, result);
  note_fit(IcpResult(result), source, range, options, result);
  note_constraint(result);
  return result;
}

CenteredSource make_source(const PointCloud& source, const Sim3& initial, const IcpOptions& options) {
  check_points("source cloud", source.positions);
  check_start(initial, options);
  const std::vector<std::uint32_t> chosen = select_points(source, initial, options.regions);
  std::vector<Vec3> points;
  points.reserve(chosen.size());
  for (const std::uint32_t i : chosen) points.push_back(source.positions[i]);
  CenteredSource result = center_source(std::move(points), initial);
  if (options.method == IcpMethod::kGeneralized) result.normals = select_normals(source, chosen);
  return result;
}

IcpResult no_points_result(const Sim3& initial, const IcpOptions& options) {
  IcpResult result;
  result.T_target_source = initial;
  result.method = method_name(options);
  result.note = "no source point lies in the regions";
  return result;
}

}  // namespace

IcpResult icp(const PointCloud& source, const PointCloud& target, const Sim3& initial, const IcpOptions& options) {
  if (options.method == IcpMethod::kPointToMesh) {
    throw InputError("method", "point-to-mesh needs a mesh as its target, but the target is a cloud");
  }
  const CenteredSource points = make_source(source, initial, options);
  check_points("target cloud", target.positions);
  if (points.points.empty()) return no_points_result(initial, options);

  const bool planes = options.method == IcpMethod::kPointToPlane || options.method == IcpMethod::kGeneralized;
  const bool needs_normals = planes && target.normals.empty();
  CloudMatcher matcher(needs_normals ? with_normals(target) : target, points.target_center, points.points.size(),
                       options.radius_m);
  const geometry::NearestIndex index(target.positions);
  constexpr std::size_t kNeighbors = 32;
  return run_icp(matcher, points, initial, options, [&](const Match& match) {
    return match.normal.isZero()
               ? estimate_normal(target.positions, index, match.point + points.target_center, kNeighbors)
               : match.normal;
  });
}

IcpResult icp(const PointCloud& source, const geometry::TriangleIndex& target,
              const geometry::TriangleMesh& target_mesh, const Sim3& initial, const IcpOptions& options) {
  const CenteredSource points = make_source(source, initial, options);
  if (target_mesh.triangles.empty()) throw InputError("target mesh", "has no triangles; there is nothing to align to");
  if (points.points.empty()) return no_points_result(initial, options);

  MeshMatcher matcher(target, target_mesh, points.target_center, points.points.size(), options.radius_m);
  IcpOptions mesh_options = options;
  if (options.method != IcpMethod::kGeneralized) mesh_options.method = IcpMethod::kPointToMesh;
  return run_icp(matcher, points, initial, mesh_options,
                 [&](const Match& match) { return matcher.triangle_normal(match.triangle); });
}

}  // namespace tileflight::alignment
