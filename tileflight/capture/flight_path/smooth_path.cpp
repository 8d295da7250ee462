#include "tileflight/capture/flight_path/smooth_path.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <iomanip>
#include <limits>
#include <numeric>
#include <optional>
#include <sstream>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::flight_path {

namespace {

/// Symmetric positive definite linear system A x = b of B by B blocks with R right-hand sides. Blocks more than three
/// off the diagonal are zero, as for cubic B-splines. Only blocks on and above the diagonal are stored.
template <int B, int R>
class BandedSystem {
 public:
  using Block = Eigen::Matrix<double, B, B>;
  using Right = Eigen::Matrix<double, B, R>;

  explicit BandedSystem(std::size_t blocks) : rows_(blocks, filled_row()), right_(blocks, Right::Zero()) {}

  std::size_t size() const { return rows_.size(); }
  /// Adds to the block in row i, column i + k, with k from 0 to 3.
  void add(std::size_t i, std::size_t k, const Block& block) { rows_[i][k] += block; }
  const Block& diagonal(std::size_t i) const { return rows_[i][0]; }
  void add_right(std::size_t i, const Right& right) { right_[i] += right; }

  /// Gaussian elimination by blocks (Golub and Van Loan, Matrix Computations, 4.3.5 and 4.5.1).
  std::vector<Right> solve() && {
    const std::size_t n = size();
    std::vector<Block> inverse(n);
    for (std::size_t i = 0; i < n; ++i) {
      inverse[i] = rows_[i][0].inverse();
      for (std::size_t k = 1; k < 4 && i + k < n; ++k) {
        const Block factor = rows_[i][k].transpose() * inverse[i];
        for (std::size_t l = k; l < 4 && i + l < n; ++l) rows_[i + k][l - k] -= factor * rows_[i][l];
        right_[i + k] -= factor * right_[i];
      }
    }
    for (std::size_t i = n; i-- > 0;) {
      for (std::size_t k = 1; k < 4 && i + k < n; ++k) right_[i] -= rows_[i][k] * right_[i + k];
      right_[i] = (inverse[i] * right_[i]).eval();
    }
    return std::move(right_);
  }

 private:
  using Row = std::array<Block, 4>;

  static Row filled_row() {
    Row row;
    row.fill(Block::Zero());
    return row;
  }

  std::vector<Row> rows_;
  std::vector<Right> right_;
};

using geometry::Mat3;
using geometry::so3_exp;
using geometry::so3_log;
using geometry::Vec3;

/// Control points with less than this share of the mean information are stabilized by their neighbours: those in a data
/// gap and at its edges. For evenly spaced data, the first and last control point of a spline have 0.008.
constexpr double kMinInformationShare = 0.003;
/// Weight of the bending term relative to the mean information: in gaps, and elsewhere.
constexpr double kGapBendingWeight = 1e-2, kBendingWeight = 1e-12;
constexpr std::array<double, 3> kSecondDifference = {1.0, -2.0, 1.0};
constexpr int kMaxIterations = 10;
constexpr double kSmallestStep_rad = 1e-10;

/// Information of the data about each control point, per axis.
template <int B, int R>
std::vector<double> information(const BandedSystem<B, R>& system) {
  std::vector<double> data_information(system.size());
  for (std::size_t i = 0; i < data_information.size(); ++i) data_information[i] = system.diagonal(i).trace() / B;
  return data_information;
}

/// Adds the bending term at each control point but the first and last; `bend(i)` is its current value around control
/// point i + 1.
template <int B, int R, class Bend>
void add_bending_penalty(BandedSystem<B, R>& system, const Bend& bend) {
  using Block = typename BandedSystem<B, R>::Block;
  const std::vector<double> data_information = information(system);
  const double mean = std::accumulate(data_information.begin(), data_information.end(), 0.0) /
                      static_cast<double>(data_information.size());
  for (std::size_t i = 0; i + 2 < system.size(); ++i) {
    const bool is_held =
        std::min({data_information[i], data_information[i + 1], data_information[i + 2]}) < kMinInformationShare * mean;
    const double weight = mean * (is_held ? kGapBendingWeight : kBendingWeight);
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t l = k; l < 3; ++l)
        system.add(i + k, l - k, weight * kSecondDifference[k] * kSecondDifference[l] * Block::Identity());
      system.add_right(i + k, -weight * kSecondDifference[k] * bend(i));
    }
  }
}

/// Spherical linear interpolation of the given rotations at a time.
Eigen::Quaterniond rotation_at(std::span<const double> times_s, std::span<const Eigen::Quaterniond> rotations,
                               double time_s) {
  const auto above = std::upper_bound(times_s.begin() + 1, times_s.end() - 1, time_s);
  const auto i = static_cast<std::size_t>(above - times_s.begin()) - 1;
  const double share = std::clamp((time_s - times_s[i]) / (times_s[i + 1] - times_s[i]), 0.0, 1.0);
  return rotations[i].slerp(share, rotations[i + 1]);
}

Vec3 step(const RotationSpline& spline, std::size_t i) {
  return so3_log(spline.controls[i].conjugate() * spline.controls[i + 1]);
}

/// Updates the control points by one Gauss–Newton step; returns the largest rotation of a control point.
double gauss_newton_step(RotationSpline& spline, std::span<const double> times_s,
                         std::span<const Eigen::Quaterniond> rotations) {
  BandedSystem<3, 1> system(spline.controls.size());
  for (std::size_t n = 0; n < times_s.size(); ++n) {
    const RotationSpline::Sensitivity at = spline.sensitivity(times_s[n]);
    const Vec3 residual = so3_log(rotations[n].conjugate() * at.rotation);
    const Mat3 inverse = right_jacobian_inverse(residual);
    for (std::size_t k = 0; k < 4; ++k) {
      const Mat3 J_k = inverse * at.control_jacobians[k];
      for (std::size_t l = k; l < 4; ++l)
        system.add(at.segment + k, l - k, J_k.transpose() * inverse * at.control_jacobians[l]);
      system.add_right(at.segment + k, -J_k.transpose() * residual);
    }
  }
  add_bending_penalty(system, [&](std::size_t i) -> Vec3 { return step(spline, i + 1) - step(spline, i); });
  const std::vector<Vec3> turns = std::move(system).solve();
  double largest = 0.0;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    spline.controls[i] = (spline.controls[i] * so3_exp(turns[i])).normalized();
    largest = std::max(largest, turns[i].norm());
  }
  return largest;
}

}  // namespace

BSpline<3> fit_positions(std::span<const double> times_s, std::span<const Vec3> positions_m,
                         const UniformKnots& knots) {
  assert(times_s.size() == positions_m.size());
  BandedSystem<1, 3> system(knots.control_count());
  for (std::size_t n = 0; n < times_s.size(); ++n) {
    const auto [segment, u] = knots.find_span(times_s[n]);
    const Weights4 weights = basis(u);
    for (std::size_t k = 0; k < 4; ++k) {
      for (std::size_t l = k; l < 4; ++l)
        system.add(segment + k, l - k, Eigen::Matrix<double, 1, 1>(weights[k] * weights[l]));
      system.add_right(segment + k, weights[k] * positions_m[n].transpose());
    }
  }
  add_bending_penalty(system, [](std::size_t) { return Eigen::RowVector3d(0.0, 0.0, 0.0); });
  BSpline<3> spline{knots, {}};
  for (const Eigen::RowVector3d& control : std::move(system).solve()) spline.controls.emplace_back(control.transpose());
  return spline;
}

RotationSpline fit_rotations(std::span<const double> times_s, std::span<const Eigen::Quaterniond> rotations,
                             const UniformKnots& knots) {
  assert(times_s.size() == rotations.size() && times_s.size() >= 2);
  RotationSpline spline{knots, {}};
  for (std::size_t i = 0; i < knots.control_count(); ++i)
    spline.controls.push_back(rotation_at(times_s, rotations, knots.control_time_s(i)));
  for (int i = 0; i < kMaxIterations; ++i) {
    if (gauss_newton_step(spline, times_s, rotations) < kSmallestStep_rad) break;
  }
  return spline;
}

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
