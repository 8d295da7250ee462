#include "tileflight/odometry/window_optimizer.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/odometry/gauge.h"
#include "tileflight/odometry/normal_equations.h"

namespace tileflight::odometry {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kChunk = 64;  ///< points a task

struct Energy {
  double residuals = 0.0;
  double prior = 0.0;
  double good = 0.0;  ///< part of `residuals` that good ones have
  int good_count = 0;

  double total() const { return residuals + prior; }
};

double prior_energy(const Window& window) {
  const VectorXd delta = stacked_delta(window);
  return delta.dot(window.H_prior * delta) + 2.0 * window.b_prior.dot(delta);
}

/// Evaluates all observations at the current state, with derivatives.
class Linearizer {
 public:
  Linearizer(Window& window, const Lens& lens, const WindowOptions& options)
      : window_(window), lens_(lens), options_(options) {}

  Energy run(const std::vector<Pair>& pairs, const std::vector<PointRef>& points) {
    if (window_.lens.estimated) {
      lens_ = lens_.moved(window_.lens.value());
      lens_linear_ = lens_.moved(window_.lens.linear);
    }
    return summed(points, [&](const PointRef& ref, Energy& energy) { linearize_point(ref, pairs, energy); });
  }

  /// The energy of residuals that were evaluated already, judged by the thresholds as they are now.
  Energy judge(const std::vector<PointRef>& points) const {
    return summed(points, [&](const PointRef& ref, Energy& energy) {
      const Keyframe& host = window_.keyframes[ref.host];
      for (Observation& observation : window_.keyframes[ref.host].points[ref.index].observations) {
        judge_observation(host, observation.state != ResidualState::kOutside, observation, energy);
      }
    });
  }

 private:
  template <class Add>
  Energy summed(const std::vector<PointRef>& points, const Add& add) const {
    const std::size_t chunks = (points.size() + kChunk - 1) / kChunk;
    std::vector<Energy> parts(chunks);
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      const std::size_t end = std::min(points.size(), (c + 1) * kChunk);
      for (std::size_t i = c * kChunk; i < end; ++i) add(points[i], parts[c]);
    });
    Energy total;
    for (const Energy& part : parts) {
      total.residuals += part.residuals;
      total.good += part.good;
      total.good_count += part.good_count;
    }
    total.prior = prior_energy(window_);
    return total;
  }

  void linearize_point(const PointRef& ref, const std::vector<Pair>& pairs, Energy& energy) const {
    Keyframe& host = window_.keyframes[ref.host];
    ActivePoint& point = host.points[ref.index];
    for (Observation& observation : point.observations) {
      const Keyframe& target = window_.keyframes[observation.target];
      const ResidualValue value =
          evaluate_residual(lens_, target.pyramid->levels[0], point.patch, point.rho,
                            pairs[ref.host * window_.size() + observation.target].frame, options_.huber,
                            &observation.linearization, window_.lens.estimated ? &lens_linear_ : nullptr);
      observation.raw_energy = value.energy;
      judge_observation(host, value.state == ResidualState::kGood, observation, energy);
    }
  }

  void judge_observation(const Keyframe& host, bool inside, Observation& observation, Energy& energy) const {
    const float threshold = std::max(host.energy_threshold, window_.keyframes[observation.target].energy_threshold);
    observation.state = ResidualState::kOutside;
    if (inside) observation.state = observation.raw_energy > threshold ? ResidualState::kOutlier : ResidualState::kGood;
    // A residual that leaves the picture counts as before, so that leaving is no gain.
    if (inside) observation.energy = std::min(observation.raw_energy, threshold);
    energy.residuals += observation.energy;
    if (observation.state != ResidualState::kGood) return;
    energy.good += observation.energy;
    ++energy.good_count;
  }

  Window& window_;
  Lens lens_;
  Lens lens_linear_;  ///< only where it is estimated
  const WindowOptions& options_;
};

/// Step of the keyframes' unknowns, scaled to a unit diagonal, without its gauge part.
VectorXd solve(const NormalEquations& system, const Window& window, double lambda) {
  MatrixXd H = system.H + window.H_prior;
  const VectorXd b = system.b + window.b_prior + window.H_prior * stacked_delta(window);
  const VectorXd scale = (H.diagonal().array().max(0.0) + 10.0).sqrt().inverse();
  H = scale.asDiagonal() * H * scale.asDiagonal();
  H.diagonal().array() += lambda;
  const VectorXd x = -(scale.asDiagonal() * H.ldlt().solve(scale.asDiagonal() * b));
  // Orthogonal in the scaled unknowns, where lengths mean the same in every direction.
  const VectorXd inverse_scale = scale.cwiseInverse();
  const MatrixXd N = inverse_scale.asDiagonal() * gauge_directions(window);
  return scale.asDiagonal() * without_gauge(inverse_scale.asDiagonal() * x, N);
}

/// Where the lens moved, so did the rays of all pixels.
void move_rays(Window& window, const Lens& lens, const std::vector<PointRef>& points) {
  if (!window.lens.estimated) return;
  const Lens moved = lens.moved(window.lens.value());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    set_ray(moved, window.keyframes[points[i].host].points[points[i].index].patch);
  });
}

void back_up(Window& window) {
  window.lens.delta_backup = window.lens.delta;
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.delta_backup = keyframe.delta;
    for (ActivePoint& point : keyframe.points) point.rho_backup = point.rho;
  }
}

void apply_step(Window& window, const VectorXd& x) {
  if (window.lens.estimated) window.lens.delta = window.lens.delta_backup + x.tail<4>();
  for (int i = 0; i < window.size(); ++i) {
    Keyframe& keyframe = window.keyframes[i];
    keyframe.delta = keyframe.delta_backup + x.segment<8>(8 * i);
    for (ActivePoint& point : keyframe.points) point.rho = point.rho_backup + point.step;
  }
}

void restore(Window& window) {
  window.lens.delta = window.lens.delta_backup;
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.delta = keyframe.delta_backup;
    for (ActivePoint& point : keyframe.points) point.rho = point.rho_backup;
  }
}

bool is_small(const VectorXd& x, const Window& window, double focal_px) {
  constexpr double kSmallest_px = 0.005;
  double largest = window.lens.estimated ? x.tail<4>().cwiseAbs().maxCoeff() : 0.0;
  for (int i = 0; i < window.size(); ++i) largest = std::max(largest, x.segment<6>(8 * i).cwiseAbs().maxCoeff());
  return largest * focal_px < kSmallest_px;
}

float angle_between(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

WindowResult optimize_window(Window& window, const Lens& lens, const WindowOptions& options, int iterations) {
  constexpr double kSettledShare = 1e-4;  // of the energy: a step that changes less is the last
  const std::vector<PointRef> points = all_points(window);
  Linearizer linearizer(window, lens, options);
  std::vector<Pair> pairs = make_pairs(window);
  Energy energy = linearizer.run(pairs, points);
  update_energy_threshold(window, window.size() - 1);
  energy = linearizer.judge(points);
  double lambda = 1e-4;
  WindowResult result;
  for (; result.iterations < iterations; ++result.iterations) {
    const NormalEquations system = build_normal_equations(window, pairs, points, lambda);
    const VectorXd x = solve(system, window, lambda);
    if (!x.allFinite()) break;
    back_substitute(window, pairs, points, x, lambda);
    back_up(window);
    apply_step(window, x);
    move_rays(window, lens, points);
    pairs = make_pairs(window);
    const Energy after = linearizer.run(pairs, points);
    const bool settled = std::abs(energy.total() - after.total()) < kSettledShare * energy.residuals;
    if (after.total() <= energy.total()) {
      energy = after;
      lambda *= 0.25;
    } else {
      restore(window);
      move_rays(window, lens, points);
      pairs = make_pairs(window);
      energy = linearizer.run(pairs, points);
      lambda = std::max(lambda, 1e-5) * 100.0;
      if (lambda > 10.0) break;
    }
    if (settled || is_small(x, window, lens.focal_px())) break;
  }
  result.good_residuals = energy.good_count;
  result.rmse = energy.good_count > 0 ? std::sqrt(energy.good / (kPatternSize * energy.good_count)) : 0.0;
  return result;
}

void relinearize(Window& window, int slot) {
  Keyframe& keyframe = window.keyframes[slot];
  window.b_prior += window.H_prior.middleCols<8>(8 * slot) * keyframe.delta;
  keyframe.T_camera_map_linear = keyframe.T_camera_map();
  keyframe.light_linear = keyframe.light();
  keyframe.delta.setZero();
}

void relinearize_lens(Window& window) {
  if (!window.lens.estimated) return;
  window.b_prior += window.H_prior.rightCols<4>() * window.lens.delta;
  window.lens.linear = window.lens.value();
  window.lens.delta.setZero();
  for (Keyframe& keyframe : window.keyframes) {
    for (ActivePoint& point : keyframe.points) point.patch.ray_linear = point.patch.ray;
    for (ImmaturePoint& point : keyframe.immature) point.patch.ray_linear = point.patch.ray;
  }
}

void remove_bad_residuals(Window& window) {
  const int newest = window.size() - 1;
  const std::vector<Pair> pairs = make_pairs(window);
  for (int h = 0; h < window.size(); ++h) {
    for (ActivePoint& point : window.keyframes[h].points) {
      for (Observation& observation : point.observations) {
        if (observation.target == newest) point.recent = {observation.state, point.recent[0]};
        if (observation.state != ResidualState::kGood || observation.counted) continue;
        observation.counted = true;
        ++point.good_observations;
        point.last_frame = std::max(point.last_frame, window.keyframes[observation.target].frame_index);
        const PairTransform& pair = pairs[h * window.size() + observation.target].frame.current;
        const Eigen::Vector3f unrotated = pair.R.transpose() * (pair.R * point.patch.ray + point.rho * pair.t);
        point.parallax_rad = std::max(point.parallax_rad, angle_between(unrotated, point.patch.ray));
      }
      std::erase_if(point.observations, [](const Observation& o) { return o.state != ResidualState::kGood; });
    }
    if (h == newest) continue;
    std::erase_if(window.keyframes[h].points, [](const ActivePoint& p) { return p.observations.empty(); });
  }
}

void update_energy_threshold(Window& window, int slot) {
  constexpr double kQuantile = 0.7;
  constexpr float kFactor = 1.5F;
  constexpr float kConstant = 26.0F;  ///< the square root of an energy that is always fair; half of the weight
  std::vector<float> energies;
  for (const Keyframe& host : window.keyframes) {
    for (const ActivePoint& point : host.points) {
      for (const Observation& observation : point.observations) {
        if (observation.target == slot && observation.state != ResidualState::kOutside) {
          energies.push_back(observation.raw_energy);
        }
      }
    }
  }
  if (energies.empty()) return;
  const auto nth = energies.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(energies.size() - 1));
  std::nth_element(energies.begin(), nth, energies.end());
  const float root = 0.5F * kConstant + 0.5F * kFactor * std::sqrt(*nth);
  window.keyframes[slot].energy_threshold = root * root;
}

}  // namespace tileflight::odometry
