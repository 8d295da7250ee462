#include "tileflight/slam/mapping/activation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "tileflight/slam/mapping/distance_map.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {
namespace {

using Status = keyframes::ImmaturePoint::Status;

// DSO's implementation uses these limits.
constexpr float kMaxInterval_px = 8.0F;
constexpr int kMaxFailures = 2;
/// Largest half interval of the inverse distance, relative to the inverse distance itself or to the window's median,
/// whichever is larger. A wider interval determines no depth yet. Chosen by hand.
constexpr float kMaxIntervalShare = 0.5F;
constexpr float kSpacingPerScale = 0.5F;  ///< extra spacing per coarser scale at which a point was selected
constexpr int kCoarsestScale = 2;

/// Whether the search interval of the inverse distance is narrow enough relative to the window's scale. Without a
/// baseline (pure rotation) every distance fits; such points wait.
bool is_determined(const keyframes::ImmaturePoint& point, float typical_rho) {
  return 0.5F * (point.rho_max - point.rho_min) <= kMaxIntervalShare * std::max(point.rho(), typical_rho);
}

bool is_ready(const keyframes::ImmaturePoint& point, float typical_rho, const keyframes::TracingOptions& options) {
  if (!point.has_depth() || point.rho() <= 0 || point.failed_searches > 0) return false;
  if (!is_determined(point, typical_rho)) return false;
  const bool traced = point.status == Status::kGood || point.status == Status::kSkipped ||
                      point.status == Status::kBadCondition || point.status == Status::kOutside;
  return traced && point.interval_px < kMaxInterval_px && point.quality > options.min_quality;
}

/// Median inverse distance of the active points; infinite while there are none.
float median_rho(const keyframes::Window& window) {
  std::vector<float> rho;
  for (const keyframes::Keyframe& keyframe : window.keyframes) {
    for (const keyframes::ActivePoint& point : keyframe.points) rho.push_back(point.rho);
  }
  if (rho.empty()) return std::numeric_limits<float>::infinity();
  const auto middle = rho.begin() + static_cast<std::ptrdiff_t>(rho.size() / 2);
  std::nth_element(rho.begin(), middle, rho.end());
  return *middle;
}

/// Level-1 pixel of a point of `host` in the newest keyframe; nullopt outside the lens.
std::optional<Eigen::Vector2i> level1_pixel(const keyframes::Lens& lens, const HostTargetPair& pair,
                                            const keyframes::Patch& patch, float rho) {
  Eigen::Vector2f pixel;
  const keyframes::PairTransform& T = pair.frame.current;
  if (!lens.project<float>(T.R * patch.ray + rho * T.t, pixel)) return std::nullopt;
  return Eigen::Vector2i(static_cast<int>(std::floor(0.5F * pixel.x())),
                         static_cast<int>(std::floor(0.5F * pixel.y())));
}

/// Widens the spacing if there are more points than wanted and narrows it if there are fewer, in the steps of DSO's
/// implementation.
void adapt_spacing(ActivationSpacing& spacing, double have, double wanted) {
  const double ratio = have / wanted;
  if (ratio < 0.66) spacing.pixels -= 0.8;
  if (ratio < 0.8)
    spacing.pixels -= 0.5;
  else if (ratio < 0.9)
    spacing.pixels -= 0.2;
  else if (ratio < 1.0)
    spacing.pixels -= 0.1;
  if (ratio > 1.5) spacing.pixels += 0.8;
  if (ratio > 1.3) spacing.pixels += 0.5;
  if (ratio > 1.15) spacing.pixels += 0.2;
  if (ratio > 1.0) spacing.pixels += 0.1;
  spacing.pixels = std::clamp(spacing.pixels, 0.0, 10.0);
}

DistanceMap build_distance_map(const keyframes::Window& window, const keyframes::Lens& lens,
                               const std::vector<HostTargetPair>& pairs, double spacing) {
  // Distances beyond the widest spacing in use need not be told apart.
  const int limit = 1 + static_cast<int>(std::ceil(spacing * (1.0 + kSpacingPerScale * kCoarsestScale)));
  const int newest = window.size() - 1;
  const keyframes::PyramidLevel& picture = window.keyframes[newest].pyramid->levels[0];
  DistanceMap map(picture.width / 2, picture.height / 2, limit);
  for (int h = 0; h < newest; ++h) {
    for (const keyframes::ActivePoint& point : window.keyframes[h].points) {
      const auto pixel = level1_pixel(lens, pairs[h * window.size() + newest], point.patch, point.rho);
      if (pixel) map.add(pixel->x(), pixel->y());
    }
  }
  return map;
}

/// Outcome of the selection for an immature point.
enum class Outcome : std::uint8_t { kKept, kRemoved, kOutOfView };

/// Indices of a keyframe's immature points that are ready and far enough from active points. Sets the outcome of chosen
/// and of useless points in `fates`.
std::vector<int> select_candidates(const keyframes::Window& window, const keyframes::Lens& lens,
                                   const HostTargetPair& pair, int host, float typical,
                                   const keyframes::TracingOptions& options, double spacing, DistanceMap& map,
                                   std::vector<Outcome>& fates) {
  std::vector<int> chosen;
  const std::vector<keyframes::ImmaturePoint>& points = window.keyframes[host].immature;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const keyframes::ImmaturePoint& point = points[i];
    if (point.failed_searches >= kMaxFailures) fates[i] = Outcome::kRemoved;
    if (!is_ready(point, typical, options)) {
      if (point.status == Status::kOutside && fates[i] == Outcome::kKept) fates[i] = Outcome::kOutOfView;
      continue;
    }
    const auto pixel = level1_pixel(lens, pair, point.patch, point.rho());
    if (!pixel || !map.contains(pixel->x(), pixel->y())) {
      fates[i] = Outcome::kOutOfView;
      continue;
    }
    // Points selected at a coarser scale cover a larger area and get a wider spacing.
    if (map.at(pixel->x(), pixel->y()) < spacing * (1.0 + kSpacingPerScale * point.scale)) continue;
    map.add(pixel->x(), pixel->y());
    fates[i] = Outcome::kRemoved;
    chosen.push_back(i);
  }
  return chosen;
}

void apply_outcomes(keyframes::Keyframe& host, const std::vector<Outcome>& fates) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < host.immature.size(); ++i) {
    if (fates[i] == Outcome::kOutOfView) host.out_of_view.push_back(host.immature[i]);
    if (fates[i] == Outcome::kKept) host.immature[kept++] = host.immature[i];
  }
  host.immature.resize(kept);
}

/// Residuals of a point in the stereo pictures of its host, by inverse distance only.
class StereoResiduals {
 public:
  StereoResiduals(const keyframes::Window& window, const keyframes::Keyframe& host, const keyframes::Patch& patch,
                  const keyframes::WindowOptions& options)
      : window_(window), host_(host), patch_(patch), options_(options), is_good_(host.stereo.size(), false) {}

  void add(float rho, keyframes::RhoLinearization& sum) {
    for (std::size_t c = 0; c < host_.stereo.size(); ++c) {
      const keyframes::StereoPicture& picture = host_.stereo[c];
      is_good_[c] = false;
      if (!picture.pyramid) continue;
      const keyframes::RhoLinearization one =
          keyframes::evaluate_rho(window_.stereo_cameras[c].lens, picture.pyramid->levels[0], patch_, rho,
                                  keyframes::stereo_transform(window_, host_, static_cast<int>(c)), options_.huber);
      if (one.state != keyframes::ResidualState::kGood) continue;
      const float threshold = std::max(host_.energy_threshold, picture.energy_threshold);
      sum.energy += options_.stereo_weight * std::min(one.energy, threshold);
      if (one.energy > threshold) continue;
      is_good_[c] = true;
      sum.H += options_.stereo_weight * one.H;
      sum.b += options_.stereo_weight * one.b;
    }
  }

  /// Returns the good observations at the last inverse distance.
  std::vector<keyframes::Observation> good_observations() const {
    std::vector<keyframes::Observation> good;
    for (std::size_t c = 0; c < is_good_.size(); ++c) {
      if (!is_good_[c]) continue;
      good.emplace_back();
      good.back().target = static_cast<int>(c);
    }
    return good;
  }

 private:
  const keyframes::Window& window_;
  const keyframes::Keyframe& host_;
  const keyframes::Patch& patch_;
  const keyframes::WindowOptions& options_;
  std::vector<bool> is_good_;
};

/// Residuals of a point of keyframe `host` in the other keyframes of the window and in its host's stereo pictures, by
/// inverse distance only.
class PointResiduals {
 public:
  PointResiduals(const keyframes::Window& window, const keyframes::Lens& lens, int host,
                 const std::vector<keyframes::PairTransform>& pairs, const keyframes::Patch& patch,
                 const keyframes::WindowOptions& options)
      : window_(window),
        lens_(lens),
        host_(host),
        pairs_(pairs),
        patch_(patch),
        huber_(options.huber),
        states_(static_cast<std::size_t>(window.size()), keyframes::ResidualState::kOutside),
        stereo_(window, window.keyframes[host], patch, options) {}

  keyframes::RhoLinearization evaluate(float rho) {
    keyframes::RhoLinearization sum;
    for (int t = 0; t < window_.size(); ++t) {
      if (t != host_) states_[t] = add(t, rho, sum);
    }
    stereo_.add(rho, sum);
    return sum;
  }

  /// Keyframes in which the last inverse distance has no outlier.
  std::vector<keyframes::Observation> good_observations() const {
    std::vector<keyframes::Observation> good;
    for (int t = 0; t < window_.size(); ++t) {
      if (t == host_ || states_[t] != keyframes::ResidualState::kGood) continue;
      good.emplace_back();
      good.back().target = t;
    }
    return good;
  }
  std::vector<keyframes::Observation> good_stereo_observations() const { return stereo_.good_observations(); }

 private:
  /// Adds the residual in keyframe `target`. An outlier counts with the energy at the threshold and has no gradient.
  keyframes::ResidualState add(int target, float rho, keyframes::RhoLinearization& sum) const {
    const keyframes::Keyframe& keyframe = window_.keyframes[target];
    const keyframes::RhoLinearization one =
        keyframes::evaluate_rho(lens_, keyframe.pyramid->levels[0], patch_, rho, pairs_[target], huber_);
    if (one.state != keyframes::ResidualState::kGood) return one.state;
    const float threshold = std::max(window_.keyframes[host_].energy_threshold, keyframe.energy_threshold);
    sum.energy += std::min(one.energy, threshold);
    if (one.energy > threshold) return keyframes::ResidualState::kOutlier;
    sum.H += one.H;
    sum.b += one.b;
    return one.state;
  }

  const keyframes::Window& window_;
  const keyframes::Lens& lens_;
  int host_;
  const std::vector<keyframes::PairTransform>& pairs_;
  const keyframes::Patch& patch_;
  float huber_;
  std::vector<keyframes::ResidualState> states_;
  StereoResiduals stereo_;
};

/// An inverse distance and the linearization there.
struct RhoMinimum {
  float rho;
  keyframes::RhoLinearization linearization;
};

/// Levenberg-Marquardt over the inverse distance. Number of iterations and damping schedule, chosen by hand.
RhoMinimum minimize_over_rho(PointResiduals& residuals, float rho) {
  constexpr int kIterations = 4;
  float lambda = 0.1F;
  keyframes::RhoLinearization best = residuals.evaluate(rho);
  for (int i = 0; i < kIterations && best.H > 0; ++i) {
    const float candidate = rho - best.b / (best.H * (1.0F + lambda));
    const keyframes::RhoLinearization next = residuals.evaluate(candidate);
    if (next.energy < best.energy && next.H > 0) {
      const float change = std::abs(candidate - rho);
      rho = candidate;
      best = next;
      lambda *= 0.5F;
      if (change < 1e-4F * std::abs(rho)) break;
    } else {
      lambda *= 5.0F;
    }
  }
  return {rho, residuals.evaluate(rho)};
}

}  // namespace

std::vector<keyframes::PairTransform> pair_transforms_from(const keyframes::Window& window, int host) {
  const geometry::SE3 T_map_host = window.keyframes[host].T_camera_map().inverse();
  std::vector<keyframes::PairTransform> pairs(window.size());
  for (int t = 0; t < window.size(); ++t) {
    if (t == host) continue;
    pairs[t] = keyframes::pair_transform(window.keyframes[t].T_camera_map() * T_map_host,
                                         window.keyframes[host].brightness(), window.keyframes[t].brightness());
  }
  return pairs;
}

std::optional<keyframes::ActivePoint> try_activation(const keyframes::Window& window, const keyframes::Lens& lens,
                                                     int host, const std::vector<keyframes::PairTransform>& pairs,
                                                     const keyframes::ImmaturePoint& point,
                                                     const keyframes::WindowOptions& options, int min_good) {
  PointResiduals residuals(window, lens, host, pairs, point.patch, options);
  const auto [rho, at_rho] = minimize_over_rho(residuals, point.rho());
  if (!(rho > 0) || !(at_rho.H > 0)) return std::nullopt;
  keyframes::ActivePoint active;
  active.patch = point.patch;
  active.rho = rho;
  active.information = at_rho.H;
  active.color = point.color;
  active.first_frame = active.last_frame = window.keyframes[host].frame_index;
  active.observations = residuals.good_observations();
  active.stereo_observations = residuals.good_stereo_observations();
  if (static_cast<int>(active.observations.size() + active.stereo_observations.size()) < min_good) return std::nullopt;
  return active;
}

std::optional<keyframes::ActivePoint> try_activation(const keyframes::Window& window, const keyframes::Lens& lens,
                                                     int host, const keyframes::ImmaturePoint& point,
                                                     const keyframes::WindowOptions& options, int min_good) {
  return try_activation(window, lens, host, pair_transforms_from(window, host), point, options, min_good);
}

int activate_points(keyframes::Window& window, const keyframes::Lens& lens, const keyframes::OdometryOptions& options,
                    ActivationSpacing& spacing) {
  const int newest = window.size() - 1;
  std::size_t have = 0;
  for (const keyframes::Keyframe& keyframe : window.keyframes) have += keyframe.points.size();
  adapt_spacing(spacing, static_cast<double>(have), options.window.active_points);
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  const float typical = median_rho(window);
  DistanceMap map = build_distance_map(window, lens, pairs, spacing.pixels);
  int activated = 0;
  for (int h = 0; h < newest; ++h) {
    keyframes::Keyframe& host = window.keyframes[h];
    std::vector<Outcome> fates(host.immature.size(), Outcome::kKept);
    const std::vector<int> chosen = select_candidates(window, lens, pairs[h * window.size() + newest], h, typical,
                                                      options.tracing, spacing.pixels, map, fates);
    std::vector<std::optional<keyframes::ActivePoint>> results(chosen.size());
    const std::vector<keyframes::PairTransform> from_host = pair_transforms_from(window, h);
    tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
      results[i] = try_activation(window, lens, h, from_host, host.immature[chosen[i]], options.window, 1);
    });
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      if (!results[i]) continue;
      host.points.push_back(std::move(*results[i]));
      ++host.activated_points;
      ++activated;
    }
    apply_outcomes(host, fates);
  }
  return activated;
}

}  // namespace tileflight::mapping
