#include "tileflight/slam/mapping/tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/slam/keyframes/pattern_samples.h"

namespace tileflight::mapping {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;
using Status = keyframes::ImmaturePoint::Status;

constexpr int kMaxSteps = 1024;

/// Great circle of a point in the target.
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

/// Search for one point: the curve, the target, and the warp of the pattern.
struct EpipolarSearch {
  const keyframes::Lens& lens;
  const keyframes::PyramidLevel& target;
  const keyframes::PairTransform& pair;
  const keyframes::ImmaturePoint& point;
  float huber;
  EpipolarCurve curve;
  Eigen::Matrix2f pattern_warp;

  /// Pixels of the pattern around a centre.
  TILEFLIGHT_LANE_INLINE void pattern_pixels(const Vector2f& center, base::Float8& u, base::Float8& v) const {
    u = center.x() + pattern_warp(0, 0) * keyframes::kPatternX + pattern_warp(0, 1) * keyframes::kPatternY;
    v = center.y() + pattern_warp(1, 0) * keyframes::kPatternX + pattern_warp(1, 1) * keyframes::kPatternY;
  }
  /// The host's grey values transformed to the target's brightness.
  TILEFLIGHT_LANE_INLINE void expected_intensities(base::Float8& grey) const {
    base::load_float8(point.patch.intensity.data(), grey);
    grey = pair.gain * grey + pair.offset;
  }
  /// Sum of weighted Huber energies of the pattern at a pixel.
  TILEFLIGHT_LANE_INLINE float energy(const Vector2f& center) const {
    base::Float8 u, v, grey, host, w;
    pattern_pixels(center, u, v);
    keyframes::sample_eight_intensities(target, u, v, grey);
    expected_intensities(host);
    const base::Float8 r = grey - host;
    base::huber_weights(r, huber, w);
    return base::horizontal_sum(w * r * r * (2.0F - w));
  }
  bool inside(const Vector2f& center) const {
    const float reach_x = keyframes::kPatternRadius_px * pattern_warp.row(0).cwiseAbs().maxCoeff() + 1.0F;
    const float reach_y = keyframes::kPatternRadius_px * pattern_warp.row(1).cwiseAbs().maxCoeff() + 1.0F;
    return center.x() >= reach_x && center.y() >= reach_y && center.x() < target.width - 1 - reach_x &&
           center.y() < target.height - 1 - reach_y;
  }
};

/// Interval of the angle phi to search.
struct Interval {
  float phi_min = 0.0F;
  float phi_max = 0.0F;
  float length_px = 0.0F;
};

/// Pixels per radian along the curve at phi; 0 outside the lens.
float pixels_per_radian(const EpipolarSearch& search, float phi, Vector2f& pixel, Vector2f& direction) {
  Eigen::Matrix<float, 2, 3> J;
  if (!search.lens.project<float>(search.curve.direction(phi), pixel, J)) return 0.0F;
  const Vector2f d = J * search.curve.tangent(phi);
  const float speed = d.norm();
  direction = speed > 0 ? Vector2f(d / speed) : Vector2f::UnitX();
  return speed;
}

/// Part of the curve within the known bounds, or within the longest allowed search if there are none; length 0 if
/// unusable.
Interval search_interval(const EpipolarSearch& search, float longest_px) {
  Interval interval;
  interval.phi_min = search.curve.phi(search.point.rho_min);
  Vector2f from, to, direction;
  const float speed = pixels_per_radian(search, interval.phi_min, from, direction);
  if (speed <= 0) return interval;
  // Stop before the epipole, where the inverse distance is infinite.
  const float end = search.curve.psi() * 0.98F;
  interval.phi_max = search.point.has_depth() ? std::min(search.curve.phi(search.point.rho_max), end)
                                              : std::min(interval.phi_min + longest_px / speed, end);
  if (interval.phi_max <= interval.phi_min) return interval;
  if (!search.lens.project<float>(search.curve.direction(interval.phi_max), to)) return interval;
  interval.length_px = (to - from).norm();
  if (interval.length_px > longest_px) {
    // Cuts a long interval at its near end, because most points are far from the camera.
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

/// Discrete search in steps of about a pixel (DSO, section 3.2). The second-best match is taken at least 2 px from the
/// best; in DSO's implementation more than 2 of its steps of 1 px.
TILEFLIGHT_WIDE_VECTORS
Match search_discrete(const EpipolarSearch& search, const Interval& interval, int max_steps) {
  constexpr float kSecondBestDistance_px = 2.0F;
  const int steps = std::min({kMaxSteps, max_steps, 2 + static_cast<int>(interval.length_px)});
  const float step = (interval.phi_max - interval.phi_min) / static_cast<float>(steps - 1);
  std::array<float, kMaxSteps> energies;
  int best = -1;
  // Direction and tangent rotate by the same angle at each step.
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

/// Gauss-Newton along the curve, at most one pixel per step; keeps the best.
TILEFLIGHT_WIDE_VECTORS
void refine(const EpipolarSearch& search, Match& match) {
  constexpr int kIterations = 4;
  float phi = match.phi;
  for (int i = 0; i < kIterations; ++i) {
    Vector2f pixel, direction;
    const float speed = pixels_per_radian(search, phi, pixel, direction);
    if (speed <= 0 || !search.inside(pixel)) return;
    base::Float8 u, v, host, w;
    keyframes::PatternSamples8 there;
    search.pattern_pixels(pixel, u, v);
    keyframes::sample_eight(search.target, u, v, there);
    const base::Float8 J = there.gx * direction.x() + there.gy * direction.y();
    search.expected_intensities(host);
    const base::Float8 r = there.grey - host;
    base::huber_weights(r, search.huber, w);
    const float energy = base::horizontal_sum(w * r * r * (2.0F - w));
    const float H = 1e-6F + base::horizontal_sum(w * J * J), b = base::horizontal_sum(w * J * r);
    if (energy <= match.energy) {
      match.energy = energy;
      match.phi = phi;
    }
    const float step_px = std::clamp(-b / H, -1.0F, 1.0F);
    phi += step_px / speed;
    if (std::abs(step_px) < 0.02F) break;
  }
}

/// Whether a point's interval is so short in the target, and well inside it, that a search would not improve it.
bool is_already_precise(const keyframes::Lens& lens, const keyframes::PyramidLevel& target, const Vector3f& start,
                        const Vector3f& t, double slack_px, keyframes::ImmaturePoint& point) {
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
/// error"). Both 0.2 are those of DSO's implementation, which also limits the error to 10 px.
float match_error_px(const EpipolarSearch& search, const Vector2f& direction) {
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

void trace_point(const keyframes::Lens& lens, const keyframes::PyramidLevel& target,
                 const keyframes::PairTransform& pair, const keyframes::TracingOptions& options, float huber,
                 keyframes::ImmaturePoint& point) {
  constexpr int kMaxFailures = 2;
  if (point.failed_searches >= kMaxFailures) return;
  const Vector3f start = pair.R * point.patch.ray;
  if (is_already_precise(lens, target, start, pair.t, options.slack_px, point)) {
    point.status = Status::kSkipped;
    return;
  }
  EpipolarSearch search{lens, target, pair, point, huber, EpipolarCurve(start, pair.t), Eigen::Matrix2f::Identity()};
  const auto finish = [&](Status status) {
    point.status = status;
    if (status == Status::kOutlier) ++point.failed_searches;
  };
  if (!search.curve.usable()) return finish(Status::kSkipped);

  keyframes::WarpedPatch warped;
  const float middle = point.has_depth() ? point.rho() : point.rho_min;
  if (!keyframes::warp_patch(lens, point.patch, pair.R, pair.t, middle, warped) ||
      !keyframes::pattern_inside(target, warped)) {
    return finish(Status::kOutside);
  }
  search.pattern_warp = warped.d_pixel_d_host_pixel;
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

  Match match = search_discrete(search, interval, options.max_steps);
  if (!match.found) return finish(Status::kOutside);
  if (match.quality > 0 && (interval.length_px > 10.0F || match.quality < point.quality)) point.quality = match.quality;
  refine(search, match);
  if (match.energy > keyframes::kPatternSize * options.outlier_energy_per_pixel) {
    return finish(Status::kOutlier);
  }
  const float margin = error_px / speed;
  const float end = search.curve.psi() * 0.99F;
  point.rho_min = std::max(0.0F, search.curve.rho(std::min(match.phi - margin, end)));
  point.rho_max = search.curve.rho(std::min(match.phi + margin, end));
  if (!(point.rho_max > 0.0F) || point.rho_min > point.rho_max || !std::isfinite(point.rho_max)) {
    point.failed_searches = kMaxFailures;
    return finish(Status::kOutlier);
  }
  point.interval_px = 2.0F * error_px;
  finish(Status::kGood);
}

void trace_points(const keyframes::Lens& lens, const keyframes::PyramidLevel& target,
                  const keyframes::PairTransform& pair, const keyframes::TracingOptions& options, float huber,
                  std::vector<keyframes::ImmaturePoint>& points) {
  constexpr std::size_t kChunk = 64;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kChunk), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i)
      trace_point(lens, target, pair, options, huber, points[i]);
  });
}

}  // namespace tileflight::mapping
