#include "tileflight/core/alignment/icp.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/alignment/icp_iteration.h"
#include "tileflight/core/alignment/matcher.h"
#include "tileflight/core/alignment/normals.h"
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
