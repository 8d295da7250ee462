#include "tileflight/evaluation/registration/surface_fit.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "tileflight/core/alignment/fixed_point.h"
#include "tileflight/core/alignment/matcher.h"
#include "tileflight/core/alignment/ordered_sum.h"
#include "tileflight/core/alignment/plane_system.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::registration {

using geometry::Vec3;
using geometry::Vec7;

namespace {

/// Sums of g g^T over clusters of matches, g being a cluster's sum of gradients; with the small-sample correction for
/// the number of clusters.
template <class Key>
Mat7 clustered_scatter(const std::vector<Vec7>& gradients, const std::vector<Key>& keys) {
  std::map<Key, Vec7> sums;
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    auto [at, is_new] = sums.try_emplace(keys[i], Vec7::Zero());
    at->second += gradients[i];
  }
  Mat7 middle = Mat7::Zero();
  for (const auto& [key, g] : sums) middle += g * g.transpose();
  const auto clusters = static_cast<double>(sums.size());
  return clusters > 1.0 ? Mat7(middle * clusters / (clusters - 1.0)) : middle;
}

using Cube = std::array<std::int64_t, 3>;

Cube cube_key(const Vec3& y, double edge_m) {
  const Vec3 cell = (y / edge_m).array().floor();
  return {static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
          static_cast<std::int64_t>(cell.z())};
}

}  // namespace

ShapeInformation shape_information(const SurfaceMatches& matches, double length_m) {
  constexpr double kBlocksAcross = 10.0;  // number of cubes along the RMS extent of the map
  const double edge_m = std::max(1.0, 2.0 * length_m / kBlocksAcross);
  ShapeInformation information;
  std::vector<Vec7> gradients;
  std::vector<Cube> cubes;
  std::vector<std::size_t> keyframes;
  std::vector<std::pair<Cube, std::size_t>> both;
  for (std::size_t k = 0; k < matches.residuals.size(); ++k) {
    const SurfaceResidual& r = matches.residuals[k];
    const double z2 = r.residual_m * r.residual_m / (r.sigma_m * r.sigma_m);
    const double weight = kernel_weight(z2) / (r.sigma_m * r.sigma_m);
    const Vec7 jacobian = alignment::plane_jacobian(r.y, r.normal, length_m);
    information.hessian += weight * jacobian * jacobian.transpose();
    gradients.push_back(weight * r.residual_m * jacobian);
    cubes.push_back(cube_key(r.y, edge_m));
    if (matches.keyframes.empty()) continue;
    keyframes.push_back(matches.keyframes[k]);
    both.emplace_back(cubes.back(), keyframes.back());
  }
  information.gradient_scatter = clustered_scatter(gradients, cubes);
  if (!keyframes.empty())
    information.gradient_scatter += clustered_scatter(gradients, keyframes) - clustered_scatter(gradients, both);
  return information;
}

Mat7 sandwich_information(const ShapeInformation& information, double length_m) {
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 H = scale.asDiagonal() * information.hessian * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Mat7> eigen(H);
  constexpr double kOpen = 1e-6;
  Mat7 result = Mat7::Zero();
  const Mat7 middle = eigen.eigenvectors().transpose() *
                      (scale.asDiagonal() * information.gradient_scatter * scale.asDiagonal()) * eigen.eigenvectors();
  // In the directions that the surface constrains: covariance = D^-1 M D^-1 with D the eigenvalues.
  std::vector<int> held;
  for (int k = 0; k < 7; ++k)
    if (eigen.eigenvalues()[k] > kOpen) held.push_back(k);
  const auto n = static_cast<Eigen::Index>(held.size());
  Eigen::MatrixXd covariance(n, n), basis(7, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    basis.col(a) = eigen.eigenvectors().col(held[static_cast<std::size_t>(a)]);
    for (Eigen::Index b = 0; b < n; ++b) {
      const int i = held[static_cast<std::size_t>(a)], j = held[static_cast<std::size_t>(b)];
      covariance(a, b) = middle(i, j) / (eigen.eigenvalues()[i] * eigen.eigenvalues()[j]);
      if (a == b) covariance(a, b) += 1.0 / eigen.eigenvalues()[i];  // the points' own noise
    }
  }
  if (n > 0) {
    const geometry::SymmetricEigen own = geometry::symmetric_eigen(covariance);
    const Eigen::VectorXd inverse = own.values.cwiseMax(1e-12).cwiseInverse();
    result = basis * (own.vectors * inverse.asDiagonal() * own.vectors.transpose()) * basis.transpose();
  }
  Vec7 units;
  units << Vec3::Ones(), Vec3::Constant(length_m), length_m;  // from metres to radians and logarithm
  const Vec7 back = units.cwiseQuotient(scale);
  return back.asDiagonal() * result * back.asDiagonal();
}

double information_discount(const ShapeInformation& information) {
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 ratio = scale.asDiagonal() * information.gradient_scatter * scale.asDiagonal();
  return std::max(1.0, ratio.trace() / 7.0);
}

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

/// The points used, relative to their centre; y = T p relative to `target_center`.
struct Source {
  std::vector<Vec3> points;
  std::vector<Vec3> rays;  ///< from viewpoint to point, with the distance as length, map frame; empty: unknown
  std::vector<double> distance_sigma;
  std::vector<std::size_t> keyframe;
  Vec3 source_center = Vec3::Zero(), target_center = Vec3::Zero();
  alignment::PointSpread spread;
  double length_m = 1.0;

  Sim3 centered(const Sim3& T) const {
    return {T.scale, T.rotation, T.translation + T.scale * (T.rotation * source_center) - target_center};
  }
};

bool is_in_regions(const Vec3& moved, const std::vector<geometry::Box3>& regions) {
  return regions.empty() || std::ranges::any_of(regions, [&](const auto& box) { return box.contains(moved); });
}

Source make_source(const ObservedPoints& points, const Sim3& T, const std::vector<geometry::Box3>& regions) {
  std::vector<Vec3> inside;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 moved = T * points.positions[i];
    if (!moved.allFinite()) throw InputError("map", "point " + std::to_string(i) + " is not finite");
    if (!is_in_regions(moved, regions)) continue;
    inside.push_back(points.positions[i]);
    chosen.push_back(i);
  }
  Source source;
  const auto n = static_cast<double>(inside.size());
  for (const Vec3& p : inside) source.source_center += p / n;
  for (const std::uint32_t k : geometry::morton_order(inside, geometry::kCoarseMortonCells)) {
    const std::size_t i = chosen[k];
    source.points.push_back(points.positions[i] - source.source_center);
    source.spread.second_moment += source.points.back() * source.points.back().transpose() / n;
    if (points.has_viewpoints()) source.rays.push_back(points.positions[i] - points.viewpoints[i]);
    if (!points.distance_sigma.empty()) source.distance_sigma.push_back(points.distance_sigma[i]);
    if (!points.keyframe.empty()) source.keyframe.push_back(points.keyframe[i]);
  }
  source.target_center = T * source.source_center;
  const double rms_m = T.scale * std::sqrt(source.spread.second_moment.trace());
  source.length_m = rms_m > 0.0 ? rms_m : 1.0;
  return source;
}

/// Parameters of one step.
struct Step {
  double radius_m = 1.0;
  double tolerance_m = 0.0;  ///< added to each sigma, since the residuals of a coarse step are due to the start's
                             ///< error, not to noise
  double noise = 1.0;
};

struct Sums {
  std::size_t matched = 0;
  double squares = 0.0;  ///< sum of squared distances, square metres
  double cost = 0.0;
  alignment::PointToPlaneSystem planes;

  Sums& operator+=(const Sums& other) {
    matched += other.matched;
    squares += other.squares;
    cost += other.cost;
    planes += other.planes;
    return *this;
  }
};

class SurfaceFitter {
 public:
  SurfaceFitter(const Source& source, const geometry::TriangleIndex& index, const geometry::TriangleMesh& mesh,
                const SurfaceFitOptions& options, const alignment::ScaleRange& scale)
      : source_(source), index_(index), mesh_(mesh), options_(options), scale_(scale) {}

  void start_level(const Step& step) {
    step_ = step;
    matcher_.emplace(index_, mesh_, source_.target_center, source_.points.size(), step.radius_m);
  }
  void set_discount(double discount) { information_discount_ = discount; }
  const Step& step() const { return step_; }

  alignment::Evaluation evaluate(const Sim3& T) {
    const Sums sums = alignment::ordered_sum<Sums>(source_.points.size(), [&](std::size_t begin, std::size_t end) {
      Sums part;
      SurfaceResidual r;
      for (std::size_t i = begin; i < end; ++i) {
        if (!residual(T, i, r)) continue;
        const double z2 = r.residual_m * r.residual_m / (r.sigma_m * r.sigma_m);
        const double weight = kernel_weight(z2) / (r.sigma_m * r.sigma_m);
        part.matched += 1;
        part.squares += r.residual_m * r.residual_m;
        part.cost += kernel_cost(z2);
        part.planes.add(r.y, r.y - r.residual_m * r.normal, r.normal, source_.length_m, weight);
      }
      return part;
    });
    alignment::Evaluation e;
    e.matched = sums.matched;
    e.rms_m = sums.matched > 0 ? std::sqrt(sums.squares / static_cast<double>(sums.matched)) : 0.0;
    e.cost = sums.cost + kSurfaceKernel * kSurfaceKernel * static_cast<double>(source_.points.size() - sums.matched);
    e.next = sums.matched > 0 ? next(T, sums.planes, e.cost) : T;
    return e;
  }

  /// All matches at T.
  SurfaceMatches matches(const Sim3& T) {
    std::vector<SurfaceResidual> all(source_.points.size());
    std::vector<std::uint8_t> found(source_.points.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) { found[i] = residual(T, i, all[i]) ? 1 : 0; });
    SurfaceMatches matches;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (found[i] == 0) continue;
      matches.residuals.push_back(all[i]);
      if (!source_.keyframe.empty()) matches.keyframes.push_back(source_.keyframe[i]);
    }
    return matches;
  }

 private:
  bool residual(const Sim3& T, std::size_t i, SurfaceResidual& r) {
    alignment::Match match;
    r.y = T * source_.points[i];
    if (!matcher_->find(i, r.y, match) || match.distance_m > step_.radius_m) return false;
    r.normal = match.normal;
    r.residual_m = match.normal.dot(r.y - match.point);
    r.sigma_m = sigma_m(T, i, match.normal);
    return true;
  }

  double sigma_m(const Sim3& T, std::size_t i, const Vec3& normal) const {
    const double floor2 = options_.surface_sigma_m * options_.surface_sigma_m + step_.tolerance_m * step_.tolerance_m;
    if (source_.rays.empty()) return std::sqrt(step_.noise * step_.noise + floor2);
    constexpr double kUnknownDistance = 0.01;
    const double s = source_.distance_sigma.empty() ? kUnknownDistance : source_.distance_sigma[i];
    const double across = options_.angle_sigma_rad;
    const Vec3 ray_m = T.scale * (T.rotation * source_.rays[i]);
    const double along2 = normal.dot(ray_m) * normal.dot(ray_m);
    const double own2 = s * s * along2 + across * across * (ray_m.squaredNorm() - along2);
    return std::sqrt(step_.noise * step_.noise * own2 + floor2);
  }

  Sim3 next(const Sim3& T, alignment::PointToPlaneSystem planes, double& cost) const {
    planes.hessian *= 1.0 / information_discount_;
    planes.gradient *= 1.0 / information_discount_;
    cost /= information_discount_;
    if (options_.prior) add_known(T, planes, cost);
    const alignment::ScaleRange factors{scale_.min / T.scale, scale_.max / T.scale};
    return alignment::solve(planes, factors, source_.length_m) * T;
  }

  /// Adds the prior: the deviation from it, as a motion about the target's centre, weighted by its information.
  void add_known(const Sim3& T, alignment::PointToPlaneSystem& planes, double& cost) const {
    const SimilarityEstimate known = options_.prior->recentered(source_.target_center);
    const Vec7 deviation =
        motion_between(known.T_target_source, alignment::uncentered(T, source_.source_center, source_.target_center),
                       source_.target_center);
    Vec7 units;
    units << Vec3::Ones(), Vec3::Constant(1.0 / source_.length_m), 1.0 / source_.length_m;
    planes.hessian += units.asDiagonal() * known.information * units.asDiagonal();
    planes.gradient += units.asDiagonal() * (known.information * deviation);
    cost += deviation.dot(known.information * deviation);
  }

  const Source& source_;
  const geometry::TriangleIndex& index_;
  const geometry::TriangleMesh& mesh_;
  const SurfaceFitOptions& options_;
  alignment::ScaleRange scale_;
  Step step_;
  double information_discount_ = 1.0;
  std::optional<alignment::MeshMatcher> matcher_;
};

/// The factor on the points' own sigmas with which half of the residuals lie within 0.6745 sigmas, as those of a normal
/// distribution do.
double estimate_noise(const std::vector<SurfaceResidual>& residuals, double noise_now, double floor_m) {
  if (residuals.empty()) return noise_now;
  constexpr double kHalf = 0.6745, kLeast = 1e-3, kMost = 1e3;
  const auto middle = [&](double factor) {
    std::vector<double> ratios;
    for (const SurfaceResidual& r : residuals) {
      const double own2 = std::max(0.0, r.sigma_m * r.sigma_m - floor_m * floor_m) / (noise_now * noise_now);
      ratios.push_back(std::abs(r.residual_m) / std::sqrt(factor * factor * own2 + floor_m * floor_m));
    }
    return base::upper_median(std::move(ratios));
  };
  double least = kLeast, most = kMost;
  constexpr int kHalvings = 30;
  for (int k = 0; k < kHalvings; ++k) {
    const double between = std::sqrt(least * most);
    (middle(between) > kHalf ? least : most) = between;
  }
  return std::sqrt(least * most);
}

/// Where the fit ended, on the centred source.
struct FittedPose {
  alignment::FixedPointResult end;
  double noise = 1.0;  ///< SurfaceFit::noise_factor
  int iterations = 0;
};

/// Fits from coarse to fine with the stated noise, then alternates between fitting at the finest radius and estimating
/// the noise and the correlation of the residuals. Leaves `fitter` at the finest step.
FittedPose fit_pose(SurfaceFitter& fitter, const Source& source, const Sim3& start, const SurfaceFitOptions& options) {
  const alignment::EvaluateFunction evaluate = [&](const Sim3& T) { return fitter.evaluate(T); };
  FittedPose fitted;
  fitted.end.T = start;
  const auto run = [&](const Step& step) {
    fitter.start_level(step);
    fitted.end =
        alignment::iterate_fixed_point(evaluate, fitted.end.T, {true, 1e-3, 3},
                                       {0.0, options.step_m, options.max_iterations}, source.spread, source.length_m);
    fitted.iterations += fitted.end.iterations;
  };
  constexpr double kTolerance = 0.25;  // as a share of the radius; chosen by hand
  double& noise = fitted.noise;
  noise = source.rays.empty() ? options.surface_sigma_m : 1.0;
  for (const double radius_m : options.radii_m) run({radius_m, kTolerance * radius_m, noise});
  const double last_m = options.radii_m.back();
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    fitter.start_level({last_m, 0.0, noise});
    noise = estimate_noise(fitter.matches(fitted.end.T).residuals, noise, options.surface_sigma_m);
    fitter.start_level({last_m, 0.0, noise});
    fitter.set_discount(information_discount(shape_information(fitter.matches(fitted.end.T), source.length_m)));
    run({last_m, 0.0, noise});
  }
  return fitted;
}

/// Sets which share of the points agrees with the surface, and how well the surface constrains the transform.
void describe_agreement(const std::vector<SurfaceResidual>& residuals, const Source& source, alignment::ScaleMode scale,
                        SurfaceFit& fit) {
  std::size_t agreeing = 0;
  alignment::PointToPlaneSystem planes;
  for (const SurfaceResidual& r : residuals) {
    if (std::abs(r.residual_m) <= kSurfaceKernel * r.sigma_m) ++agreeing;
    planes.add(r.y, r.y, r.normal, source.length_m);
  }
  fit.inlier_share = static_cast<double>(agreeing) / static_cast<double>(fit.points);
  fit.constraint = alignment::analyze_constraint(planes, residuals.size(), scale == alignment::ScaleMode::kEstimated);
}

}  // namespace

SurfaceFit fit_to_surface(const ObservedPoints& points, const geometry::TriangleIndex& index,
                          const geometry::TriangleMesh& mesh, const Sim3& start, const SurfaceFitOptions& options) {
  if (points.positions.empty()) throw InputError("map", "has no points; there is nothing to align");
  if (mesh.triangles.empty()) throw InputError("target mesh", "has no triangles; there is nothing to align to");
  const Source source = make_source(points, start, options.regions);
  SurfaceFit fit;
  fit.T_target_source = start;
  fit.points = source.points.size();
  if (source.points.empty()) return fit;

  SurfaceFitter fitter(
      source, index, mesh, options,
      alignment::scale_range(options.scale, start.scale, options.scale_center, options.max_scale_change));
  const FittedPose fitted = fit_pose(fitter, source, source.centered(start), options);
  const alignment::FixedPointResult& end = fitted.end;
  fit.iterations = fitted.iterations;
  fit.noise_factor = fitted.noise;
  fit.T_target_source = alignment::uncentered(end.T, source.source_center, source.target_center);
  fit.matched = end.evaluation.matched;
  fit.rmse_m = end.evaluation.rms_m;
  fit.fitness = static_cast<double>(fit.matched) / static_cast<double>(fit.points);
  fit.converged = end.stopped_by_rule;
  fit.last_step_m = end.last_step_m;
  const SurfaceMatches matches = fitter.matches(end.T);
  describe_agreement(matches.residuals, source, options.scale, fit);
  fit.shape_estimate = {fit.T_target_source, source.target_center,
                        sandwich_information(shape_information(matches, source.length_m), source.length_m)};
  fit.estimate = fit.shape_estimate;
  if (options.prior) fit.estimate.information += options.prior->recentered(source.target_center).information;
  return fit;
}

}  // namespace tileflight::registration
