#include "tileflight/slam/mapping/window_optimizer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/keyframes/residual.h"
#include "tileflight/slam/mapping/gauge.h"
#include "tileflight/slam/mapping/inertial_window.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kPointsAChunk = 64;  ///< points per task

struct Energy {
  double residuals = 0.0;
  double prior = 0.0;
  double good = 0.0;  ///< part of `residuals` from good residuals
  int good_count = 0;

  double total() const { return residuals + prior; }
};

double prior_energy(const keyframes::Window& window) {
  const VectorXd delta = stacked_delta(window);
  return delta.dot(window.H_prior * delta) + 2.0 * window.b_prior.dot(delta);
}

/// Evaluates all observations at the current state, with derivatives.
class Linearizer {
 public:
  Linearizer(keyframes::Window& window, const keyframes::Lens& lens, const keyframes::WindowOptions& options,
             const InertialWindow* inertial)
      : window_(window), lens_(lens), options_(options), inertial_(inertial) {}

  Energy linearize(const std::vector<HostTargetPair>& pairs, const std::vector<PointRef>& points) {
    if (window_.intrinsics.estimated) {
      lens_ = lens_.apply_delta(window_.intrinsics.value());
      lens_linear_ = lens_.apply_delta(window_.intrinsics.linear);
    }
    if (window_.has_stereo()) stereo_pairs_ = make_stereo_pairs(window_);
    return parallel_sum(points, [&](const PointRef* begin, const PointRef* end, Energy& energy) {
      // While a point is evaluated, the grey values of the next one are on their way.
      std::array<std::vector<keyframes::ResidualWarp>, 2> warps;
      warp_point(*begin, pairs, warps[0]);
      for (const PointRef* ref = begin; ref != end; ++ref) {
        if (ref + 1 != end) warp_point(ref[1], pairs, warps[(ref + 1 - begin) % 2]);
        linearize_point(*ref, pairs, warps[(ref - begin) % 2], energy);
      }
    });
  }

  /// Energy of already evaluated residuals, classified by the current thresholds.
  Energy classify(const std::vector<PointRef>& points) const {
    return parallel_sum(points, [&](const PointRef* begin, const PointRef* end, Energy& energy) {
      for (const PointRef* ref = begin; ref != end; ++ref) classify_point(*ref, energy);
    });
  }

 private:
  template <class Add>
  Energy parallel_sum(const std::vector<PointRef>& points, const Add& add) const {
    const std::size_t chunks = (points.size() + kPointsAChunk - 1) / kPointsAChunk;
    std::vector<Energy> parts(chunks);
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      const std::size_t end = std::min(points.size(), (c + 1) * kPointsAChunk);
      add(points.data() + c * kPointsAChunk, points.data() + end, parts[c]);
    });
    Energy total;
    for (const Energy& part : parts) {
      total.residuals += part.residuals;
      total.good += part.good;
      total.good_count += part.good_count;
    }
    total.prior = inertial_ != nullptr ? inertial_->energy(window_) : prior_energy(window_);
    return total;
  }

  void classify_point(const PointRef& ref, Energy& energy) const {
    keyframes::Keyframe& host = window_.keyframes[ref.host];
    for (keyframes::Observation& observation : host.points[ref.index].observations) {
      classify_observation(host, observation.state != keyframes::ResidualState::kOutside, observation, energy);
    }
    for (keyframes::Observation& observation : host.points[ref.index].stereo_observations) {
      classify_stereo(host, observation.state != keyframes::ResidualState::kOutside, observation, energy);
    }
  }

  /// Where the point's pattern falls in each of its targets.
  void warp_point(const PointRef& ref, const std::vector<HostTargetPair>& pairs,
                  std::vector<keyframes::ResidualWarp>& warps) const {
    const keyframes::ActivePoint& point = window_.keyframes[ref.host].points[ref.index];
    warps.resize(point.observations.size());
    for (std::size_t i = 0; i < warps.size(); ++i) {
      const int target = point.observations[i].target;
      keyframes::warp_residual(lens_, window_.keyframes[target].pyramid->levels[0], point.patch, point.rho,
                               pairs[ref.host * window_.size() + target].frame, warps[i]);
    }
  }

  void linearize_point(const PointRef& ref, const std::vector<HostTargetPair>& pairs,
                       const std::vector<keyframes::ResidualWarp>& warps, Energy& energy) const {
    keyframes::Keyframe& host = window_.keyframes[ref.host];
    keyframes::ActivePoint& point = host.points[ref.index];
    for (std::size_t i = 0; i < warps.size(); ++i) {
      keyframes::Observation& observation = point.observations[i];
      const keyframes::Keyframe& target = window_.keyframes[observation.target];
      const keyframes::ResidualValue value = keyframes::evaluate_residual(
          warps[i], lens_, target.pyramid->levels[0], point.patch, point.rho,
          pairs[ref.host * window_.size() + observation.target].frame, options_.huber, &observation.linearization,
          window_.intrinsics.estimated ? &lens_linear_ : nullptr);
      observation.raw_energy = value.energy;
      classify_observation(host, value.state == keyframes::ResidualState::kGood, observation, energy);
    }
    for (keyframes::Observation& observation : point.stereo_observations)
      linearize_stereo(ref.host, point, observation, energy);
  }

  /// A residual in the host's own stereo picture. Its energy and sums have the weight of the coupling.
  void linearize_stereo(int slot, const keyframes::ActivePoint& point, keyframes::Observation& observation,
                        Energy& energy) const {
    const keyframes::Keyframe& host = window_.keyframes[slot];
    const auto camera = static_cast<std::size_t>(observation.target);
    const keyframes::ResidualValue value = keyframes::evaluate_residual(
        window_.stereo_cameras[camera].lens, host.stereo[camera].pyramid->levels[0], point.patch, point.rho,
        stereo_pairs_[static_cast<std::size_t>(slot) * window_.stereo_cameras.size() + camera], options_.huber,
        &observation.linearization);
    observation.raw_energy = value.energy;
    observation.linearization.sums *= options_.stereo_weight;
    classify_stereo(host, value.state == keyframes::ResidualState::kGood, observation, energy);
  }

  void classify_stereo(const keyframes::Keyframe& host, bool inside, keyframes::Observation& observation,
                       Energy& energy) const {
    const float threshold =
        std::max(host.energy_threshold, host.stereo[static_cast<std::size_t>(observation.target)].energy_threshold);
    classify(threshold, inside, options_.stereo_weight, observation, energy);
  }

  void classify_observation(const keyframes::Keyframe& host, bool inside, keyframes::Observation& observation,
                            Energy& energy) const {
    const float threshold = std::max(host.energy_threshold, window_.keyframes[observation.target].energy_threshold);
    classify(threshold, inside, 1.0F, observation, energy);
  }

  static void classify(float threshold, bool inside, float weight, keyframes::Observation& observation,
                       Energy& energy) {
    observation.state = keyframes::ResidualState::kOutside;
    if (inside)
      observation.state =
          observation.raw_energy > threshold ? keyframes::ResidualState::kOutlier : keyframes::ResidualState::kGood;
    // A residual that leaves the image keeps its last energy, so that leaving does not lower the total.
    if (inside) observation.energy = weight * std::min(observation.raw_energy, threshold);
    energy.residuals += observation.energy;
    if (observation.state != keyframes::ResidualState::kGood) return;
    energy.good += observation.energy;
    ++energy.good_count;
  }

  keyframes::Window& window_;
  keyframes::Lens lens_;
  keyframes::Lens lens_linear_;  ///< only used if the intrinsics are estimated
  const keyframes::WindowOptions& options_;
  const InertialWindow* inertial_;
  std::vector<keyframes::HostTargetPrecalc> stereo_pairs_;  ///< as make_stereo_pairs
};

/// Step of the keyframes' and lens unknowns: (H + lambda diag H) x = -b (DSO, eq. 10 and 14, damped), solved with a
/// unit diagonal and projected off the gauge directions.
VectorXd solve_damped(const NormalEquations& system, const keyframes::Window& window, double lambda) {
  MatrixXd H = system.H + window.H_prior;
  const VectorXd b = system.b + window.b_prior + window.H_prior * stacked_delta(window);
  // The offset 10 (chosen by hand) keeps unknowns without information finite.
  const VectorXd scale = (H.diagonal().array().max(0.0) + 10.0).sqrt().inverse();
  H = scale.asDiagonal() * H * scale.asDiagonal();
  H.diagonal().array() += lambda;
  const VectorXd x = -(scale.asDiagonal() * geometry::solve_symmetric(H, scale.asDiagonal() * b));
  // Projected in the scaled unknowns, in which lengths are comparable in every direction.
  const VectorXd inverse_scale = scale.cwiseInverse();
  const MatrixXd N = inverse_scale.asDiagonal() * gauge_nullspace(window);
  return scale.asDiagonal() * remove_gauge_component(inverse_scale.asDiagonal() * x, N);
}

/// Recomputes the rays of all points after a change of the intrinsics.
void update_rays(keyframes::Window& window, const keyframes::Lens& lens, const std::vector<PointRef>& points) {
  if (!window.intrinsics.estimated) return;
  const keyframes::Lens moved = lens.apply_delta(window.intrinsics.value());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    keyframes::update_ray(moved, window.keyframes[points[i].host].points[points[i].index].patch);
  });
}

void save_state(keyframes::Window& window) {
  window.intrinsics.delta_backup = window.intrinsics.delta;
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.delta_backup = keyframe.delta;
    keyframe.stereo_delta_backup = keyframe.stereo_delta;
    for (keyframes::ActivePoint& point : keyframe.points) point.rho_backup = point.rho;
  }
}

void apply_step(keyframes::Window& window, const VectorXd& x) {
  if (window.intrinsics.estimated) window.intrinsics.delta = window.intrinsics.delta_backup + x.tail<4>();
  for (int i = 0; i < window.size(); ++i) {
    keyframes::Keyframe& keyframe = window.keyframes[i];
    keyframe.delta = keyframe.delta_backup + x.segment<8>(8 * i);
    if (window.has_stereo())
      keyframe.stereo_delta = keyframe.stereo_delta_backup + x.segment<8>(window.stereo_unknown(i));
    for (keyframes::ActivePoint& point : keyframe.points) point.rho = point.rho_backup + point.step;
  }
}

void restore_state(keyframes::Window& window) {
  window.intrinsics.delta = window.intrinsics.delta_backup;
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.delta = keyframe.delta_backup;
    keyframe.stereo_delta = keyframe.stereo_delta_backup;
    for (keyframes::ActivePoint& point : keyframe.points) point.rho = point.rho_backup;
  }
}

bool is_converged(const VectorXd& x, const keyframes::Window& window, double focal_px) {
  // Chosen by hand.
  constexpr double kSmallest_px = 0.005;
  double largest = window.intrinsics.estimated ? x.tail<4>().cwiseAbs().maxCoeff() : 0.0;
  for (int i = 0; i < window.size(); ++i) largest = std::max(largest, x.segment<6>(8 * i).cwiseAbs().maxCoeff());
  return largest * focal_px < kSmallest_px;
}

}  // namespace

WindowResult optimize_window(keyframes::Window& window, const keyframes::Lens& lens,
                             const keyframes::WindowOptions& options, int iterations, InertialWindow* inertial) {
  constexpr double kSettledShare = 1e-4;  // share of the energy; iteration ends after a step that changes less. Chosen
                                          // by hand
  const std::vector<PointRef> points = all_points(window);
  Linearizer linearizer(window, lens, options, inertial);
  std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  Energy energy = linearizer.linearize(pairs, points);
  update_energy_threshold(window, window.size() - 1);
  energy = linearizer.classify(points);
  // Damping schedule, chosen by hand: x 0.25 after a better step, x 100 after a worse one. DSO uses none (section 2.3).
  double lambda = 1e-4;
  WindowResult result;
  for (; result.iterations < iterations; ++result.iterations) {
    const NormalEquations system = build_normal_equations(window, pairs, points, lambda);
    const VectorXd step =
        inertial != nullptr ? inertial->solve(system, window, lambda) : solve_damped(system, window, lambda);
    if (!step.allFinite()) break;
    const VectorXd x = step.head(window.unknowns());
    back_substitute(window, pairs, points, x, lambda);
    save_state(window);
    apply_step(window, x);
    if (inertial != nullptr) {
      inertial->save_state();
      inertial->apply_step(step.tail(step.size() - x.size()));
    }
    update_rays(window, lens, points);
    pairs = make_host_target_pairs(window);
    const Energy after = linearizer.linearize(pairs, points);
    const bool settled = std::abs(energy.total() - after.total()) < kSettledShare * energy.residuals;
    if (after.total() <= energy.total()) {
      energy = after;
      lambda *= 0.25;
    } else {
      restore_state(window);
      if (inertial != nullptr) inertial->restore_state();
      update_rays(window, lens, points);
      pairs = make_host_target_pairs(window);
      energy = linearizer.linearize(pairs, points);
      lambda = std::max(lambda, 1e-5) * 100.0;
      if (lambda > 10.0) break;
    }
    if (settled || is_converged(x, window, lens.focal_px())) break;
  }
  result.good_residuals = energy.good_count;
  result.rmse = energy.good_count > 0 ? std::sqrt(energy.good / (keyframes::kPatternSize * energy.good_count)) : 0.0;
  return result;
}

void relinearize(keyframes::Window& window, int slot) {
  keyframes::Keyframe& keyframe = window.keyframes[slot];
  window.b_prior += window.H_prior.middleCols<8>(8 * slot) * keyframe.delta;
  keyframe.T_camera_map_linear = keyframe.T_camera_map();
  keyframe.brightness_linear = keyframe.brightness();
  keyframe.delta.setZero();
  if (!window.has_stereo()) return;
  window.b_prior += window.H_prior.middleCols<8>(window.stereo_unknown(slot)) * keyframe.stereo_delta;
  for (std::size_t c = 0; c < keyframe.stereo.size(); ++c)
    keyframe.stereo[c].brightness_linear = keyframe.stereo_brightness(static_cast<int>(c));
  keyframe.stereo_delta.setZero();
}

void relinearize_intrinsics(keyframes::Window& window) {
  if (!window.intrinsics.estimated) return;
  window.b_prior += window.H_prior.rightCols<4>() * window.intrinsics.delta;
  window.intrinsics.linear = window.intrinsics.value();
  window.intrinsics.delta.setZero();
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (keyframes::ActivePoint& point : keyframe.points) point.patch.ray_linear = point.patch.ray;
    for (keyframes::ImmaturePoint& point : keyframe.immature) point.patch.ray_linear = point.patch.ray;
  }
}

}  // namespace tileflight::mapping
