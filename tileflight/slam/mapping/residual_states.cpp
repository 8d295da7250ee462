#include "tileflight/slam/mapping/residual_states.h"

#include <algorithm>
#include <cmath>

#include "tileflight/slam/mapping/host_target_pairs.h"

namespace tileflight::mapping {
namespace {

/// Threshold for residuals with these energies; reorders them.
float energy_threshold(std::vector<float>& energies) {
  // Values and formula of the authors' implementation (26, weight 0.5, 70th percentile, factor 1.5); the paper has
  // none. 26^2 over 8 pixels is 9.2^2 squared grey values per pixel.
  constexpr double kQuantile = 0.7;
  constexpr float kFactor = 1.5F;
  constexpr float kConstant = 26.0F;  ///< root of an energy per pattern; weighted 0.5
  const auto nth = energies.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(energies.size() - 1));
  std::nth_element(energies.begin(), nth, energies.end());
  const float root = 0.5F * kConstant + 0.5F * kFactor * std::sqrt(*nth);
  return root * root;
}

float angle_between(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Notes a good residual that was not counted before.
void count_good(const keyframes::PairTransform& pair, keyframes::ActivePoint& point,
                keyframes::Observation& observation) {
  observation.counted = true;
  ++point.good_observations;
  const Eigen::Vector3f unrotated = pair.R.transpose() * (pair.R * point.patch.ray + point.rho * pair.t);
  point.parallax_rad = std::max(point.parallax_rad, angle_between(unrotated, point.patch.ray));
}

/// The part of remove_bad_residuals() for a point's residuals in the stereo pictures of its host.
void remove_bad_stereo(const keyframes::Window& window, int host, keyframes::ActivePoint& point) {
  for (keyframes::Observation& observation : point.stereo_observations) {
    if (observation.state != keyframes::ResidualState::kGood || observation.counted) continue;
    count_good(keyframes::stereo_transform(window, window.keyframes[host], observation.target), point, observation);
  }
  std::erase_if(point.stereo_observations,
                [](const keyframes::Observation& o) { return o.state != keyframes::ResidualState::kGood; });
}

/// The part of update_energy_threshold() for the stereo pictures of a keyframe.
void update_stereo_thresholds(keyframes::Keyframe& keyframe) {
  std::vector<std::vector<float>> energies(keyframe.stereo.size());
  for (const keyframes::ActivePoint& point : keyframe.points) {
    for (const keyframes::Observation& observation : point.stereo_observations) {
      if (observation.state != keyframes::ResidualState::kOutside)
        energies[static_cast<std::size_t>(observation.target)].push_back(observation.raw_energy);
    }
  }
  for (std::size_t c = 0; c < energies.size(); ++c) {
    if (!energies[c].empty()) keyframe.stereo[c].energy_threshold = energy_threshold(energies[c]);
  }
}

}  // namespace

void remove_bad_residuals(keyframes::Window& window) {
  const int newest = window.size() - 1;
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  for (int h = 0; h < window.size(); ++h) {
    for (keyframes::ActivePoint& point : window.keyframes[h].points) {
      for (keyframes::Observation& observation : point.observations) {
        if (observation.target == newest) point.recent_states = {observation.state, point.recent_states[0]};
        if (observation.state != keyframes::ResidualState::kGood || observation.counted) continue;
        count_good(pairs[h * window.size() + observation.target].frame.current, point, observation);
        point.last_frame = std::max(point.last_frame, window.keyframes[observation.target].frame_index);
      }
      std::erase_if(point.observations,
                    [](const keyframes::Observation& o) { return o.state != keyframes::ResidualState::kGood; });
      remove_bad_stereo(window, h, point);
    }
    if (h == newest) continue;
    std::erase_if(window.keyframes[h].points, [](const keyframes::ActivePoint& p) {
      return p.observations.empty() && p.stereo_observations.empty();
    });
  }
}

void update_energy_threshold(keyframes::Window& window, int slot) {
  std::vector<float> energies;
  for (const keyframes::Keyframe& host : window.keyframes) {
    for (const keyframes::ActivePoint& point : host.points) {
      for (const keyframes::Observation& observation : point.observations) {
        if (observation.target == slot && observation.state != keyframes::ResidualState::kOutside) {
          energies.push_back(observation.raw_energy);
        }
      }
    }
  }
  if (!energies.empty()) window.keyframes[slot].energy_threshold = energy_threshold(energies);
  update_stereo_thresholds(window.keyframes[slot]);
}

}  // namespace tileflight::mapping
