#include "tileflight/odometry/activation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "tileflight/odometry/distance_map.h"
#include "tileflight/odometry/normal_equations.h"

namespace tileflight::odometry {
namespace {

using Status = ImmaturePoint::Status;

constexpr float kMaxInterval_px = 8.0F;
constexpr int kMaxFailures = 2;
/// Half the interval of inverse distance over it (or the window's median, where that is larger): a wider one says
/// nothing yet.
constexpr float kMaxIntervalShare = 0.5F;
constexpr float kScaleRoom = 0.5F;  ///< more room for each coarser scale that a point stood out at
constexpr int kCoarsestScale = 2;

/// Whether the search left an interval of inverse distance that says something, on the window's scale. Without a
/// baseline (a camera that only turned) every distance fits: such points wait.
bool is_determined(const ImmaturePoint& point, float typical_rho) {
  return 0.5F * (point.rho_max - point.rho_min) <= kMaxIntervalShare * std::max(point.rho(), typical_rho);
}

bool is_ready(const ImmaturePoint& point, float typical_rho, const TracingOptions& options) {
  if (!point.has_depth() || point.rho() <= 0 || point.failures > 0) return false;
  if (!is_determined(point, typical_rho)) return false;
  const bool traced = point.status == Status::kGood || point.status == Status::kSkipped ||
                      point.status == Status::kBadCondition || point.status == Status::kOutside;
  return traced && point.interval_px < kMaxInterval_px && point.quality > options.min_quality;
}

/// Median inverse distance of the window's points; infinite while there are none.
float typical_rho(const Window& window) {
  std::vector<float> rho;
  for (const Keyframe& keyframe : window.keyframes) {
    for (const ActivePoint& point : keyframe.points) rho.push_back(point.rho);
  }
  if (rho.empty()) return std::numeric_limits<float>::infinity();
  const auto middle = rho.begin() + static_cast<std::ptrdiff_t>(rho.size() / 2);
  std::nth_element(rho.begin(), middle, rho.end());
  return *middle;
}

/// Where a point of `host` falls in the newest keyframe at level 1; nullopt outside.
std::optional<Eigen::Vector2i> level1_pixel(const Lens& lens, const Pair& pair, const Patch& patch, float rho) {
  Eigen::Vector2f pixel;
  const PairTransform& T = pair.frame.current;
  if (!lens.project<float>(T.R * patch.ray + rho * T.t, pixel)) return std::nullopt;
  return Eigen::Vector2i(static_cast<int>(std::floor(0.5F * pixel.x())),
                         static_cast<int>(std::floor(0.5F * pixel.y())));
}

/// Wider spacing when there are more points than wanted, narrower when fewer.
void adapt(ActivationSpacing& spacing, double have, double wanted) {
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

DistanceMap map_of_active_points(const Window& window, const Lens& lens, const std::vector<Pair>& pairs,
                                 double spacing) {
  // Distances beyond the widest spacing that is asked for are all the same.
  const int limit = 1 + static_cast<int>(std::ceil(spacing * (1.0 + kScaleRoom * kCoarsestScale)));
  const int newest = window.size() - 1;
  const PyramidLevel& picture = window.keyframes[newest].pyramid->levels[0];
  DistanceMap map(picture.width / 2, picture.height / 2, limit);
  for (int h = 0; h < newest; ++h) {
    for (const ActivePoint& point : window.keyframes[h].points) {
      const auto pixel = level1_pixel(lens, pairs[h * window.size() + newest], point.patch, point.rho);
      if (pixel) map.add(pixel->x(), pixel->y());
    }
  }
  return map;
}

/// What becomes of an immature point.
enum class Fate : std::uint8_t { kKept, kRemoved, kOutOfView };

/// Indices of a keyframe's immature points that are ready and fall where there is room; ones that are beyond use are
/// marked, chosen ones too.
std::vector<int> candidates(const Window& window, const Lens& lens, const Pair& pair, int host, float typical,
                            const TracingOptions& options, double spacing, DistanceMap& map, std::vector<Fate>& fates) {
  std::vector<int> chosen;
  const std::vector<ImmaturePoint>& points = window.keyframes[host].immature;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const ImmaturePoint& point = points[i];
    if (point.failures >= kMaxFailures) fates[i] = Fate::kRemoved;
    if (!is_ready(point, typical, options)) {
      if (point.status == Status::kOutside && fates[i] == Fate::kKept) fates[i] = Fate::kOutOfView;
      continue;
    }
    const auto pixel = level1_pixel(lens, pair, point.patch, point.rho());
    if (!pixel || !map.contains(pixel->x(), pixel->y())) {
      fates[i] = Fate::kOutOfView;
      continue;
    }
    // Points that stood out at a coarser scale are fewer and stand for more: they get more room.
    if (map.at(pixel->x(), pixel->y()) < spacing * (1.0 + kScaleRoom * point.scale)) continue;
    map.add(pixel->x(), pixel->y());
    fates[i] = Fate::kRemoved;
    chosen.push_back(i);
  }
  return chosen;
}

void sort_by_fate(Keyframe& host, const std::vector<Fate>& fates) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < host.immature.size(); ++i) {
    if (fates[i] == Fate::kOutOfView) host.out_of_view.push_back(host.immature[i]);
    if (fates[i] == Fate::kKept) host.immature[kept++] = host.immature[i];
  }
  host.immature.resize(kept);
}

}  // namespace

std::vector<PairTransform> pairs_from(const Window& window, int host) {
  const SE3 T_map_host = window.keyframes[host].T_camera_map().inverse();
  std::vector<PairTransform> pairs(window.size());
  for (int t = 0; t < window.size(); ++t) {
    if (t == host) continue;
    pairs[t] = pair_transform(window.keyframes[t].T_camera_map() * T_map_host, window.keyframes[host].light(),
                              window.keyframes[t].light());
  }
  return pairs;
}

std::optional<ActivePoint> try_activation(const Window& window, const Lens& lens, int host,
                                          const std::vector<PairTransform>& pairs, const ImmaturePoint& point,
                                          const WindowOptions& options, int min_good) {
  constexpr int kIterations = 4;
  const int n = window.size();
  std::vector<ResidualState> states(n, ResidualState::kOutside);
  std::vector<float> energies(n, 0.0F);
  const auto evaluate = [&](float rho) {
    RhoLinearization sum;
    for (int t = 0; t < n; ++t) {
      if (t == host) continue;
      const RhoLinearization one =
          evaluate_rho(lens, window.keyframes[t].pyramid->levels[0], point.patch, rho, pairs[t], options.huber);
      const float threshold = std::max(window.keyframes[host].energy_threshold, window.keyframes[t].energy_threshold);
      states[t] = one.state;
      energies[t] = std::min(one.energy, threshold);
      if (one.state != ResidualState::kGood) continue;
      sum.energy += energies[t];
      if (one.energy > threshold) {
        states[t] = ResidualState::kOutlier;
        continue;
      }
      sum.H += one.H;
      sum.b += one.b;
    }
    return sum;
  };
  float rho = point.rho(), lambda = 0.1F;
  RhoLinearization best = evaluate(rho);
  for (int i = 0; i < kIterations && best.H > 0; ++i) {
    const float candidate = rho - best.b / (best.H * (1.0F + lambda));
    const RhoLinearization next = evaluate(candidate);
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
  best = evaluate(rho);
  if (!(rho > 0) || !(best.H > 0)) return std::nullopt;
  ActivePoint active;
  active.patch = point.patch;
  active.rho = rho;
  active.information = best.H;
  active.color = point.color;
  active.first_frame = active.last_frame = window.keyframes[host].frame_index;
  for (int t = 0; t < n; ++t) {
    if (t == host || states[t] != ResidualState::kGood) continue;
    Observation observation;
    observation.target = t;
    active.observations.push_back(observation);
  }
  if (static_cast<int>(active.observations.size()) < min_good) return std::nullopt;
  return active;
}

std::optional<ActivePoint> try_activation(const Window& window, const Lens& lens, int host, const ImmaturePoint& point,
                                          const WindowOptions& options, int min_good) {
  return try_activation(window, lens, host, pairs_from(window, host), point, options, min_good);
}

int activate_points(Window& window, const Lens& lens, const OdometryOptions& options, ActivationSpacing& spacing) {
  const int newest = window.size() - 1;
  std::size_t have = 0;
  for (const Keyframe& keyframe : window.keyframes) have += keyframe.points.size();
  adapt(spacing, static_cast<double>(have), options.window.active_points);
  const std::vector<Pair> pairs = make_pairs(window);
  const float typical = typical_rho(window);
  DistanceMap map = map_of_active_points(window, lens, pairs, spacing.pixels);
  int activated = 0;
  for (int h = 0; h < newest; ++h) {
    Keyframe& host = window.keyframes[h];
    std::vector<Fate> fates(host.immature.size(), Fate::kKept);
    const std::vector<int> chosen = candidates(window, lens, pairs[h * window.size() + newest], h, typical,
                                               options.tracing, spacing.pixels, map, fates);
    std::vector<std::optional<ActivePoint>> results(chosen.size());
    const std::vector<PairTransform> from_host = pairs_from(window, h);
    tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
      results[i] = try_activation(window, lens, h, from_host, host.immature[chosen[i]], options.window, 1);
    });
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      if (!results[i]) continue;
      host.points.push_back(std::move(*results[i]));
      ++host.hosted;
      ++activated;
    }
    sort_by_fate(host, fates);
  }
  return activated;
}

}  // namespace tileflight::odometry
