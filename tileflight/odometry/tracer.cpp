#include "tileflight/odometry/tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tileflight::odometry {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;
using Status = ImmaturePoint::Status;

constexpr int kMaxSteps = 128;

/// The great circle of a point in the target.
class EpipolarCurve {
 public:
  EpipolarCurve(const Vector3f& start, const Vector3f& t) : start_(start), baseline_(t.norm()) {
    const Vector3f across = t - start * start.dot(t);
    const float sine_times_t = across.norm();
    if (baseline_ <= 0.0F || sine_times_t < 1e-6F * baseline_) return;
    side_ = across / sine_times_t;
    psi_ = std::atan2(sine_times_t, start.dot(t));
    usable_ = true;
  }
  bool usable() const { return usable_; }
  float psi() const { return psi_; }
  Vector3f direction(float phi) const { return std::cos(phi) * start_ + std::sin(phi) * side_; }
  Vector3f tangent(float phi) const { return std::cos(phi) * side_ - std::sin(phi) * start_; }
  float phi(float rho) const {
    const float s = rho * baseline_;
    return std::atan2(s * std::sin(psi_), 1.0F + s * std::cos(psi_));
  }
  float rho(float phi) const { return std::sin(phi) / (baseline_ * std::sin(psi_ - phi)); }

 private:
  Vector3f start_;
  Vector3f side_ = Vector3f::Zero();
  float baseline_;
  float psi_ = 0.0F;
  bool usable_ = false;
};

/// One point's search: the curve, the target, and the warp of the pattern.
struct Search {
  const Lens& lens;
  const PyramidLevel& target;
  const PairTransform& pair;
  const ImmaturePoint& point;
  float huber;
  EpipolarCurve curve;
  Eigen::Matrix2f pattern_warp;

  /// Position of the pattern's pixels about a centre.
  TILEFLIGHT_LANE_INLINE void place(const Vector2f& center, Lanes& u, Lanes& v) const {
    u = center.x() + pattern_warp(0, 0) * kPatternX + pattern_warp(0, 1) * kPatternY;
    v = center.y() + pattern_warp(1, 0) * kPatternX + pattern_warp(1, 1) * kPatternY;
  }
  /// The host's grey values as the target shows them.
  TILEFLIGHT_LANE_INLINE void expected(Lanes& grey) const {
    load_lanes(point.patch.intensity.data(), grey);
    grey = pair.gain * grey + pair.offset;
  }
  /// Sum of weighted Huber energies of the pattern at a pixel.
  float energy(const Vector2f& center) const {
    Lanes u, v, grey, host, w;
    place(center, u, v);
    for (int k = 0; k < kPatternSize; ++k) grey[k] = target.sample_intensity(u[k], v[k]);
    expected(host);
    const Lanes r = grey - host;
    huber_weights(r, huber, w);
    return lane_sum(w * r * r * (2.0F - w));
  }
  bool inside(const Vector2f& center) const {
    const float reach_x = kPatternReach_px * pattern_warp.row(0).cwiseAbs().maxCoeff() + 1.0F;
    const float reach_y = kPatternReach_px * pattern_warp.row(1).cwiseAbs().maxCoeff() + 1.0F;
    return center.x() >= reach_x && center.y() >= reach_y && center.x() < target.width - 1 - reach_x &&
           center.y() < target.height - 1 - reach_y;
  }
};

/// Interval of the angle that is searched.
struct Interval {
  float phi_min = 0.0F;
  float phi_max = 0.0F;
  float length_px = 0.0F;
};

/// Pixels a radian along the curve at phi; 0 outside the lens.
float pixels_per_radian(const Search& search, float phi, Vector2f& pixel, Vector2f& direction) {
  Eigen::Matrix<float, 2, 3> J;
  if (!search.lens.project<float>(search.curve.direction(phi), pixel, J)) return 0.0F;
  const Vector2f d = J * search.curve.tangent(phi);
  const float speed = d.norm();
  direction = speed > 0 ? Vector2f(d / speed) : Vector2f::UnitX();
  return speed;
}

/// The part of the curve that the known bounds (or, without, the longest allowed search) leave; length 0 where
/// unusable.
Interval search_interval(const Search& search, float longest_px) {
  Interval interval;
  interval.phi_min = search.curve.phi(search.point.rho_min);
  Vector2f from, to, direction;
  const float speed = pixels_per_radian(search, interval.phi_min, from, direction);
  if (speed <= 0) return interval;
  // Never as far as the epipole itself: the inverse distance is infinite there.
  const float end = search.curve.psi() * 0.98F;
  interval.phi_max = search.point.has_depth() ? std::min(search.curve.phi(search.point.rho_max), end)
                                              : std::min(interval.phi_min + longest_px / speed, end);
  if (interval.phi_max <= interval.phi_min) return interval;
  if (!search.lens.project<float>(search.curve.direction(interval.phi_max), to)) return interval;
  interval.length_px = (to - from).norm();
  if (interval.length_px > longest_px) {
    // Keeps the near end of a long interval out rather than the far one: most points are far from the camera.
    interval.phi_max = interval.phi_min + (interval.phi_max - interval.phi_min) * longest_px / interval.length_px;
    interval.length_px = longest_px;
  }
  return interval;
}

struct Match {
  float phi = 0.0F;
  float energy = 0.0F;
  float quality = 0.0F;
  bool found = false;
};

/// Discrete search in steps of about a pixel.
Match best_step(const Search& search, const Interval& interval) {
  constexpr float kSecondBestDistance_px = 2.0F;
  const int steps = std::min(kMaxSteps, 2 + static_cast<int>(interval.length_px));
  const float step = (interval.phi_max - interval.phi_min) / static_cast<float>(steps - 1);
  std::array<float, kMaxSteps> energies;
  int best = -1;
  // The direction turns by the same angle at each step, and what is across it as well.
  const float cosine = std::cos(step), sine = std::sin(step);
  Vector3f direction = search.curve.direction(interval.phi_min), across = search.curve.tangent(interval.phi_min);
  for (int i = 0; i < steps; ++i) {
    Vector2f pixel;
    const bool usable = search.lens.project<float>(direction, pixel) && search.inside(pixel);
    const Vector3f next = cosine * direction + sine * across;
    across = cosine * across - sine * direction;
    direction = next;
    energies[i] = usable ? search.energy(pixel) : std::numeric_limits<float>::infinity();
    if (usable && (best < 0 || energies[i] < energies[best])) best = i;
  }
  if (best < 0) return {};
  float second = std::numeric_limits<float>::infinity();
  const float per_step_px = interval.length_px / static_cast<float>(steps - 1);
  for (int i = 0; i < steps; ++i) {
    if (std::abs(i - best) * per_step_px >= kSecondBestDistance_px) second = std::min(second, energies[i]);
  }
  const float quality = std::isfinite(second) ? second / std::max(energies[best], 1e-3F) : 0.0F;
  return {interval.phi_min + static_cast<float>(best) * step, energies[best], quality, true};
}

/// Gauss-Newton along the curve, at most a pixel a step; keeps the best.
void refine(const Search& search, Match& match) {
  constexpr int kIterations = 4;
  float phi = match.phi;
  for (int i = 0; i < kIterations; ++i) {
    Vector2f pixel, direction;
    const float speed = pixels_per_radian(search, phi, pixel, direction);
    if (speed <= 0 || !search.inside(pixel)) return;
    Lanes u, v, grey, J, host, w;
    search.place(pixel, u, v);
    for (int k = 0; k < kPatternSize; ++k) {
      const Texel texel = search.target.sample(u[k], v[k]);
      grey[k] = texel[kIntensity];
      J[k] = texel[kGradX] * direction.x() + texel[kGradY] * direction.y();
    }
    search.expected(host);
    const Lanes r = grey - host;
    huber_weights(r, search.huber, w);
    const float energy = lane_sum(w * r * r * (2.0F - w));
    const float H = 1e-6F + lane_sum(w * J * J), b = lane_sum(w * J * r);
    if (energy <= match.energy) {
      match.energy = energy;
      match.phi = phi;
    }
    const float step_px = std::clamp(-b / H, -1.0F, 1.0F);
    phi += step_px / speed;
    if (std::abs(step_px) < 0.02F) break;
  }
}

/// Whether the interval of a point is so short in the target, and well inside it, that a search would say nothing new.
bool is_known_already(const Lens& lens, const PyramidLevel& target, const Vector3f& start, const Vector3f& t,
                      double slack_px, ImmaturePoint& point) {
  constexpr float kMargin_px = 8.0F;
  if (!point.has_depth()) return false;
  Vector2f nearest, farthest;
  const bool seen = lens.project<float>(start + point.rho_max * t, nearest) &&
                    lens.project<float>(start + point.rho_min * t, farthest) &&
                    target.inside(nearest.x(), nearest.y(), kMargin_px) &&
                    target.inside(farthest.x(), farthest.y(), kMargin_px);
  const float length_px = seen ? (nearest - farthest).norm() : 0.0F;
  if (!seen || length_px >= slack_px) return false;
  point.interval_px = length_px;
  return true;
}

/// Standard error of the match along the curve, pixels: grows where gradients run across it ("geometric disparity
/// error").
float match_error_px(const Search& search, const Vector2f& direction) {
  const Eigen::Matrix2f& A = search.pattern_warp;
  const float det = A.determinant();
  if (std::abs(det) < 1e-6F) return std::numeric_limits<float>::infinity();
  const Vector2f host = (A.inverse() * direction).normalized();
  const Vector2f across(-host.y(), host.x());
  const float along_energy = host.dot(search.point.patch.structure * host);
  const float across_energy = across.dot(search.point.patch.structure * across);
  return 0.2F + 0.2F * (along_energy + across_energy) / std::max(along_energy, 1e-6F);
}

}  // namespace

void trace_point(const Lens& lens, const PyramidLevel& target, const PairTransform& pair, const TracingOptions& options,
                 float huber, ImmaturePoint& point) {
  constexpr int kMaxFailures = 2;
  if (point.failures >= kMaxFailures) return;
  const Vector3f start = pair.R * point.patch.ray;
  if (is_known_already(lens, target, start, pair.t, options.slack_px, point)) {
    point.status = Status::kSkipped;
    return;
  }
  Search search{lens, target, pair, point, huber, EpipolarCurve(start, pair.t), Eigen::Matrix2f::Identity()};
  const auto finish = [&](Status status) {
    point.status = status;
    if (status == Status::kOutlier) ++point.failures;
  };
  if (!search.curve.usable()) return finish(Status::kSkipped);

  WarpedPatch warped;
  const float middle = point.has_depth() ? point.rho() : point.rho_min;
  if (!warp_patch(lens, point.patch, pair.R, pair.t, middle, warped) || !pattern_inside(target, warped)) {
    return finish(Status::kOutside);
  }
  search.pattern_warp = warped.pixel_by_host_pixel;
  const float scale = std::abs(search.pattern_warp.determinant());
  if (!(scale > 0.1F && scale < 10.0F)) return finish(Status::kOutside);

  const auto longest_px = static_cast<float>(options.max_search_share * (target.width + target.height));
  const Interval interval = search_interval(search, longest_px);
  if (interval.length_px <= 0) return finish(Status::kOutside);
  point.interval_px = interval.length_px;
  if (point.has_depth() && interval.length_px < options.slack_px) return finish(Status::kSkipped);

  Vector2f pixel, direction;
  const float speed = pixels_per_radian(search, 0.5F * (interval.phi_min + interval.phi_max), pixel, direction);
  const float error_px = match_error_px(search, direction);
  if (speed <= 0 || (point.has_depth() && 2.0F * error_px > interval.length_px)) return finish(Status::kBadCondition);

  Match match = best_step(search, interval);
  if (!match.found) return finish(Status::kOutside);
  if (match.quality > 0 && (interval.length_px > 10.0F || match.quality < point.quality)) point.quality = match.quality;
  refine(search, match);
  if (match.energy > kPatternSize * options.outlier_energy_per_pixel) {
    return finish(Status::kOutlier);
  }
  const float margin = error_px / speed;
  const float end = search.curve.psi() * 0.99F;
  point.rho_min = std::max(0.0F, search.curve.rho(std::min(match.phi - margin, end)));
  point.rho_max = search.curve.rho(std::min(match.phi + margin, end));
  if (!(point.rho_max > 0.0F) || point.rho_min > point.rho_max || !std::isfinite(point.rho_max)) {
    point.failures = kMaxFailures;
    return finish(Status::kOutlier);
  }
  point.interval_px = 2.0F * error_px;
  finish(Status::kGood);
}

void trace_points(const Lens& lens, const PyramidLevel& target, const PairTransform& pair,
                  const TracingOptions& options, float huber, std::vector<ImmaturePoint>& points) {
  constexpr std::size_t kChunk = 64;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kChunk), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i)
      trace_point(lens, target, pair, options, huber, points[i]);
  });
}

}  // namespace tileflight::odometry
