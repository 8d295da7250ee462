#include "tileflight/capture/flight_path/smooth_path.h"

#include <cassert>
#include <cmath>
#include <iomanip>
#include <limits>
#include <optional>
#include <sstream>

#include "tileflight/capture/flight_path/fit_spline.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::flight_path {

std::optional<SmoothingOptions> read_smoothing(base::StrictSection& section,
                                               const std::optional<SmoothingOptions>& fallback) {
  const std::optional<std::string> text = section.text("smooth");
  if (!text) return fallback;
  if (*text == "none") return std::nullopt;
  if (*text == "auto") return SmoothingOptions{};
  const std::optional<double> spacing_s = base::parse_finite_number(*text);
  if (!spacing_s || *spacing_s <= 0.0)
    throw section.error("smooth", "must be 'auto', 'none' or the seconds between two knots");
  return SmoothingOptions{.knot_spacing_s = spacing_s};
}

std::string smoothing_text(const std::optional<SmoothingOptions>& smoothing) {
  if (!smoothing) return "none";
  if (!smoothing->knot_spacing_s) return "auto";
  std::ostringstream text;
  text << std::setprecision(17) << *smoothing->knot_spacing_s;
  return text.str();
}

namespace {

using geometry::Vec3;

/// Ratio of the knot spacings of successive candidates.
constexpr double kSpacingStep = 1.4142135623730951;
/// A fit needs fewer control points than poses, otherwise its residual is meaningless.
constexpr double kMaxControlsPerPose = 0.8;

UniformKnots knots_over(std::span<const double> times_s, double spacing_s) {
  const double duration_s = times_s.back() - times_s.front();
  const double segments = std::max(1.0, std::round(duration_s / spacing_s));
  return {times_s.front(), duration_s / segments, static_cast<std::size_t>(segments)};
}

/// Candidate knots, from many control points to few.
std::vector<UniformKnots> candidates(std::span<const double> times_s) {
  const auto poses = static_cast<double>(times_s.size());
  const double duration_s = times_s.back() - times_s.front();
  std::vector<UniformKnots> result;
  for (double segments = std::max(1.0, std::floor(kMaxControlsPerPose * poses) - 3.0); segments >= 1.0;
       segments /= kSpacingStep) {
    const UniformKnots knots = knots_over(times_s, duration_s / segments);
    if (result.empty() || knots.segments < result.back().segments) result.push_back(knots);
  }
  return result;
}

/// `sum`: sum of squared residuals over all three axes.
SplineFit evaluate_fit(const UniformKnots& knots, double sum, std::size_t poses) {
  const auto n = static_cast<double>(poses), p = static_cast<double>(knots.control_count());
  const double freedom = std::max(n - p, 1.0);
  return {knots.spacing_s, knots.control_count(), std::sqrt(sum / (3.0 * n)), std::sqrt(sum / (3.0 * freedom))};
}

/// n RSS / (n - p)^2 (Craven and Wahba 1979); the trace of a least-squares fit's hat matrix is the number p of its
/// parameters.
double cross_validation(const SplineFit& fit, std::size_t poses) {
  const auto n = static_cast<double>(poses), p = static_cast<double>(fit.control_count);
  return fit.sigma * fit.sigma * n / std::max(n - p, 1.0);
}

/// Selects the knots by the options and fits the spline. `make(knots)` fits; `sum_left(spline)` returns the sum of
/// squared residuals.
template <class Spline, class Make, class SumLeft>
std::pair<Spline, SplineFit> fit_spline(std::span<const double> times_s, const std::optional<double>& spacing_s,
                                        const std::optional<double>& sigma, const Make& make, const SumLeft& sum_left) {
  const auto fit = [&](const UniformKnots& knots) {
    Spline spline = make(knots);
    const SplineFit judgement = evaluate_fit(knots, sum_left(spline), times_s.size());
    return std::pair(std::move(spline), judgement);
  };
  if (spacing_s) return fit(knots_over(times_s, *spacing_s));
  std::pair<Spline, SplineFit> best;
  double least = std::numeric_limits<double>::infinity();
  for (const UniformKnots& knots : candidates(times_s)) {
    auto candidate = fit(knots);
    // If the noise is known: the fewest control points whose residual does not exceed it (Morozov's discrepancy
    // principle).
    const double score = sigma ? (candidate.second.sigma <= *sigma ? -knots.spacing_s : candidate.second.sigma)
                               : cross_validation(candidate.second, times_s.size());
    if (score >= least) continue;
    least = score;
    best = std::move(candidate);
  }
  return best;
}

void check(const std::optional<double>& value, const std::string& name) {
  if (value && !(*value > 0.0 && std::isfinite(*value))) throw InputError(name, "must be above 0");
}

void check(std::size_t poses, const SmoothingOptions& options) {
  if (poses < kMinPosesToSmooth) {
    throw InputError("trajectory", "has " + std::to_string(poses) + " poses, and smoothing needs at least " +
                                       std::to_string(kMinPosesToSmooth) +
                                       "; use the poses without smoothing (smooth: none)");
  }
  check(options.knot_spacing_s, "knot_spacing_s");
  check(options.position_sigma_m, "position_sigma_m");
  check(options.rotation_sigma_rad, "rotation_sigma_rad");
}

std::pair<RotationSpline, SplineFit> smooth_rotations(std::span<const double> times_s,
                                                      std::span<const Eigen::Quaterniond> rotations,
                                                      const SmoothingOptions& options) {
  const auto make = [&](const UniformKnots& knots) { return fit_rotations(times_s, rotations, knots); };
  const auto sum_left = [&](const RotationSpline& spline) {
    double sum = 0.0;
    for (std::size_t i = 0; i < times_s.size(); ++i)
      sum += geometry::so3_log(rotations[i].conjugate() * spline.at(times_s[i])).squaredNorm();
    return sum;
  };
  return fit_spline<RotationSpline>(times_s, options.knot_spacing_s, options.rotation_sigma_rad, make, sum_left);
}

}  // namespace

SmoothPositions smooth_positions(std::span<const double> times_s, std::span<const Vec3> positions_m,
                                 const SmoothingOptions& options) {
  assert(times_s.size() == positions_m.size());
  check(times_s.size(), options);
  const auto make = [&](const UniformKnots& knots) { return fit_positions(times_s, positions_m, knots); };
  const auto sum_left = [&](const BSpline<3>& spline) {
    double sum = 0.0;
    for (std::size_t i = 0; i < times_s.size(); ++i) sum += (spline.value(times_s[i]) - positions_m[i]).squaredNorm();
    return sum;
  };
  auto [spline, fit] =
      fit_spline<BSpline<3>>(times_s, options.knot_spacing_s, options.position_sigma_m, make, sum_left);
  return {std::move(spline), fit};
}

SmoothPath smooth_path(const geometry::Trajectory& trajectory, const SmoothingOptions& options) {
  std::vector<double> times_s;
  std::vector<Vec3> positions_m;
  std::vector<Eigen::Quaterniond> rotations;
  for (const geometry::StampedPose& pose : trajectory.poses) {
    times_s.push_back(pose.time_s);
    positions_m.push_back(pose.T_local_camera.translation);
    rotations.push_back(pose.T_local_camera.rotation);
  }
  SmoothPositions positions = smooth_positions(times_s, positions_m, options);
  auto [rotation, rotation_fit] = smooth_rotations(times_s, rotations, options);
  return {path_along_splines(std::move(positions.spline), std::move(rotation)), positions.fit, rotation_fit};
}

}  // namespace tileflight::flight_path
