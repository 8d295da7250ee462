#include "tileflight/alignment/surface_fit.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "tileflight/alignment/constraint.h"
#include "tileflight/alignment/fixed_point.h"
#include "tileflight/alignment/matcher.h"
#include "tileflight/alignment/ordered_sum.h"
#include "tileflight/alignment/spatial_order.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

/// Where rho turns over, in sigmas: a residual of three sigmas pulls a quarter as much as its share.
constexpr double kKernel = 3.0;

/// Weight rho'(z) / (2 z) of Geman and McClure's kernel.
double kernel_weight(double z2) {
  const double ratio = z2 / (kKernel * kKernel);
  return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
}

double kernel_cost(double z2) { return z2 / (1.0 + z2 / (kKernel * kKernel)); }

/// The points that take part, about their centre; y = T p about `target_center`.
struct Source {
  std::vector<Vec3> points;
  std::vector<Vec3> rays;  ///< from viewpoint to point, of the distance's length, map frame; empty: not known
  std::vector<double> distance_sigma;
  std::vector<std::size_t> keyframe;
  Vec3 source_center = Vec3::Zero(), target_center = Vec3::Zero();
  PointSpread spread;
  double length_m = 1.0;

  Sim3 centered(const Sim3& T) const {
    return {T.scale, T.rotation, T.translation + T.scale * (T.rotation * source_center) - target_center};
  }
  Sim3 uncentered(const Sim3& T) const {
    return {T.scale, T.rotation, target_center + T.translation - T.scale * (T.rotation * source_center)};
  }
};

bool takes_part(const Vec3& moved, const std::vector<geometry::Box3>& regions) {
  return regions.empty() || std::ranges::any_of(regions, [&](const auto& box) { return box.contains(moved); });
}

Source source_of(const ObservedPoints& points, const Sim3& T, const std::vector<geometry::Box3>& regions) {
  std::vector<Vec3> inside;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 moved = T * points.positions[i];
    if (!moved.allFinite()) throw InputError("map", "point " + std::to_string(i) + " is not finite");
    if (!takes_part(moved, regions)) continue;
    inside.push_back(points.positions[i]);
    chosen.push_back(i);
  }
  Source source;
  const auto n = static_cast<double>(inside.size());
  for (const Vec3& p : inside) source.source_center += p / n;
  for (const std::uint32_t k : spatial_order(inside)) {
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

/// What noise and rules a step has.
struct Step {
  double radius_m = 1.0;
  double tolerance_m = 0.0;  ///< added to each sigma: a coarse step's residuals are the start's error, not noise
  double noise = 1.0;
};

/// A match and what it counts.
struct Residual {
  Vec3 y, normal;
  double residual_m = 0.0, sigma_m = 1.0;
};

struct Sums {
  std::size_t matched = 0;
  double squares = 0.0;  ///< of the distances, square metres
  double cost = 0.0;
  PlaneSystem planes;

  Sums& operator+=(const Sums& other) {
    matched += other.matched;
    squares += other.squares;
    cost += other.cost;
    planes += other.planes;
    return *this;
  }
};

class Fitter {
 public:
  Fitter(const Source& source, const geometry::TriangleIndex& index, const geometry::TriangleMesh& mesh,
         const SurfaceFitOptions& options, const ScaleRange& scale)
      : source_(source), index_(index), mesh_(mesh), options_(options), scale_(scale) {}

  void begin(const Step& step) {
    step_ = step;
    matcher_.emplace(index_, mesh_, source_.target_center, source_.points.size(), step.radius_m);
  }
  void set_discount(double discount) { discount_ = discount; }
  const Step& step() const { return step_; }

  Evaluation evaluate(const Sim3& T) {
    const Sums sums = ordered_sum<Sums>(source_.points.size(), [&](std::size_t begin, std::size_t end) {
      Sums part;
      Residual r;
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
    Evaluation e;
    e.matched = sums.matched;
    e.rms_m = sums.matched > 0 ? std::sqrt(sums.squares / static_cast<double>(sums.matched)) : 0.0;
    e.cost = sums.cost + kKernel * kKernel * static_cast<double>(source_.points.size() - sums.matched);
    e.next = sums.matched > 0 ? next(T, sums.planes, e.cost) : T;
    return e;
  }

  /// All matches at T.
  std::vector<Residual> residuals(const Sim3& T, std::vector<std::size_t>* which = nullptr) {
    std::vector<Residual> all(source_.points.size());
    std::vector<std::uint8_t> found(source_.points.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) { found[i] = residual(T, i, all[i]) ? 1 : 0; });
    std::vector<Residual> kept;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (found[i] == 0) continue;
      kept.push_back(all[i]);
      if (which != nullptr) which->push_back(i);
    }
    return kept;
  }

 private:
  bool residual(const Sim3& T, std::size_t i, Residual& r) {
    Match match;
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

  Sim3 next(const Sim3& T, PlaneSystem planes, double& cost) const {
    planes.hessian *= 1.0 / discount_;
    planes.gradient *= 1.0 / discount_;
    cost /= discount_;
    if (options_.known) add_known(T, planes, cost);
    const ScaleRange factors{scale_.least / T.scale, scale_.most / T.scale};
    return solve(planes, factors, source_.length_m) * T;
  }

  /// The deviation from what is known, as a motion about the target's centre, counts by its information.
  void add_known(const Sim3& T, PlaneSystem& planes, double& cost) const {
    const SimilarityEstimate known = options_.known->about(source_.target_center);
    const Vec7 deviation = motion_between(known.T_target_source, source_.uncentered(T), source_.target_center);
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
  ScaleRange scale_;
  Step step_;
  double discount_ = 1.0;
  std::optional<MeshMatcher> matcher_;
};

double median(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

/// The factor on the points' own sigmas with which half of the residuals lie within 0.6745 sigmas, as those of a normal
/// distribution do.
double noise_of(const std::vector<Residual>& residuals, double noise_now, double floor_m) {
  if (residuals.empty()) return noise_now;
  constexpr double kHalf = 0.6745, kLeast = 1e-3, kMost = 1e3;
  const auto middle = [&](double factor) {
    std::vector<double> ratios;
    for (const Residual& r : residuals) {
      const double own2 = std::max(0.0, r.sigma_m * r.sigma_m - floor_m * floor_m) / (noise_now * noise_now);
      ratios.push_back(std::abs(r.residual_m) / std::sqrt(factor * factor * own2 + floor_m * floor_m));
    }
    return median(std::move(ratios));
  };
  double least = kLeast, most = kMost;
  constexpr int kHalvings = 30;
  for (int k = 0; k < kHalvings; ++k) {
    const double between = std::sqrt(least * most);
    (middle(between) > kHalf ? least : most) = between;
  }
  return std::sqrt(least * most);
}

/// Sums of g g^T over clusters of matches, g being a cluster's sum of gradients; with the correction for few clusters.
template <class Key>
Mat7 between_clusters(const std::vector<Vec7>& gradients, const std::vector<Key>& keys) {
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

Cube cube_of(const Vec3& y, double edge_m) {
  const Vec3 cell = (y / edge_m).array().floor();
  return {static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
          static_cast<std::int64_t>(cell.z())};
}

/// Hessian of the shapes alone in metres (rotation and stretch times the length), and the sum of squared gradients with
/// what neighbours and points of one keyframe have in common.
struct Information {
  Mat7 hessian = Mat7::Zero(), middle = Mat7::Zero();
};

Information information_of(const std::vector<Residual>& residuals, const std::vector<std::size_t>& which,
                           const Source& source) {
  constexpr double kBlocksAcross = 10.0;  // cubes along the root mean square extent of the map
  const double edge_m = std::max(1.0, 2.0 * source.length_m / kBlocksAcross);
  Information information;
  std::vector<Vec7> gradients;
  std::vector<Cube> cubes;
  std::vector<std::size_t> keyframes;
  std::vector<std::pair<Cube, std::size_t>> both;
  for (std::size_t k = 0; k < residuals.size(); ++k) {
    const Residual& r = residuals[k];
    const double z2 = r.residual_m * r.residual_m / (r.sigma_m * r.sigma_m);
    const double weight = kernel_weight(z2) / (r.sigma_m * r.sigma_m);
    const Vec7 jacobian = plane_jacobian(r.y, r.normal, source.length_m);
    information.hessian += weight * jacobian * jacobian.transpose();
    gradients.push_back(weight * r.residual_m * jacobian);
    cubes.push_back(cube_of(r.y, edge_m));
    if (source.keyframe.empty()) continue;
    keyframes.push_back(source.keyframe[which[k]]);
    both.emplace_back(cubes.back(), keyframes.back());
  }
  information.middle = between_clusters(gradients, cubes);
  if (!keyframes.empty())
    information.middle += between_clusters(gradients, keyframes) - between_clusters(gradients, both);
  return information;
}

/// H^-1 middle H^-1, the other way round: H (middle)^-1 H, with no more than the points' own information H.
SimilarityEstimate estimate_of(const Information& information, const Sim3& T, const Source& source) {
  SimilarityEstimate estimate{T, source.target_center, Mat7::Zero()};
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 H = scale.asDiagonal() * information.hessian * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Mat7> eigen(H);
  constexpr double kOpen = 1e-6;
  Mat7 result = Mat7::Zero();
  const Mat7 middle = eigen.eigenvectors().transpose() *
                      (scale.asDiagonal() * information.middle * scale.asDiagonal()) * eigen.eigenvectors();
  // In the directions that the surface holds: covariance = D^-1 M D^-1 with D the eigenvalues.
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
      if (a == b) covariance(a, b) += 1.0 / eigen.eigenvalues()[i];  // the points' own noise, once
    }
  }
  if (n > 0) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> own(covariance);
    const Eigen::VectorXd inverse = own.eigenvalues().cwiseMax(1e-12).cwiseInverse();
    result = basis * (own.eigenvectors() * inverse.asDiagonal() * own.eigenvectors().transpose()) * basis.transpose();
  }
  Vec7 units;
  units << Vec3::Ones(), Vec3::Constant(source.length_m), source.length_m;  // from metres to radians and logarithm
  const Vec7 back = units.cwiseQuotient(scale);
  estimate.information = back.asDiagonal() * result * back.asDiagonal();
  return estimate;
}

/// By how much the points' own information overstates: mean over the held directions of middle over Hessian.
double discount_of(const Information& information) {
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 ratio = scale.asDiagonal() * information.middle * scale.asDiagonal();
  return std::max(1.0, ratio.trace() / 7.0);
}

ScaleRange range_of(const Sim3& start, const SurfaceFitOptions& options) {
  if (options.scale == ScaleMode::kFixed) return {start.scale, start.scale};
  const double center = options.scale_center > 0.0 ? options.scale_center : start.scale;
  return {center / options.max_scale_change, center * options.max_scale_change};
}

}  // namespace

SurfaceFit fit_to_surface(const ObservedPoints& points, const geometry::TriangleIndex& index,
                          const geometry::TriangleMesh& mesh, const Sim3& start, const SurfaceFitOptions& options) {
  if (points.positions.empty()) throw InputError("map", "has no points; there is nothing to align");
  if (mesh.triangles.empty()) throw InputError("target mesh", "has no triangles; there is nothing to align to");
  const Source source = source_of(points, start, options.regions);
  SurfaceFit fit;
  fit.T_target_source = start;
  fit.points = source.points.size();
  if (source.points.empty()) return fit;

  Fitter fitter(source, index, mesh, options, range_of(start, options));
  const Evaluate evaluate = [&](const Sim3& T) { return fitter.evaluate(T); };
  Sim3 T = source.centered(start);
  FixedPointResult end;
  const auto run = [&](const Step& step) {
    fitter.begin(step);
    end = iterate(evaluate, T, {true, 1e-3, 3}, {0.0, options.step_m, options.max_iterations}, source.spread,
                  source.length_m);
    T = end.T;
    fit.iterations += end.iterations;
  };
  constexpr double kTolerance = 0.25;  // of the radius
  double noise = source.rays.empty() ? options.surface_sigma_m : 1.0;
  for (const double radius_m : options.radii_m) run({radius_m, kTolerance * radius_m, noise});
  // With the noise that the residuals show, and the weight that they deserve together.
  const double last_m = options.radii_m.back();
  constexpr int kRounds = 3;
  std::vector<std::size_t> which;
  std::vector<Residual> residuals;
  Information information;
  for (int round = 0; round < kRounds; ++round) {
    fitter.begin({last_m, 0.0, noise});
    noise = noise_of(fitter.residuals(T), noise, options.surface_sigma_m);
    fitter.begin({last_m, 0.0, noise});
    which.clear();
    residuals = fitter.residuals(T, &which);
    information = information_of(residuals, which, source);
    fitter.set_discount(discount_of(information));
    run({last_m, 0.0, noise});
  }
  which.clear();
  residuals = fitter.residuals(T, &which);
  information = information_of(residuals, which, source);

  fit.T_target_source = source.uncentered(T);
  fit.matched = end.evaluation.matched;
  fit.rmse_m = end.evaluation.rms_m;
  fit.fitness = static_cast<double>(fit.matched) / static_cast<double>(fit.points);
  fit.noise = noise;
  fit.converged = end.stopped_by_rule;
  fit.last_step_m = end.last_step_m;
  std::size_t agreeing = 0;
  PlaneSystem planes;
  for (const Residual& r : residuals) {
    if (std::abs(r.residual_m) <= kKernel * r.sigma_m) ++agreeing;
    planes.add(r.y, r.y, r.normal, source.length_m);
  }
  fit.agreeing = static_cast<double>(agreeing) / static_cast<double>(fit.points);
  fit.constraint = constraint_of(planes, residuals.size(), options.scale == ScaleMode::kEstimated);
  fit.shapes = estimate_of(information, fit.T_target_source, source);
  fit.estimate = fit.shapes;
  if (options.known) fit.estimate.information += options.known->about(source.target_center).information;
  return fit;
}

}  // namespace tileflight::alignment
