#include "tileflight/capture/flight_path/fit_spline.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cassert>
#include <numeric>
#include <vector>

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

}  // namespace tileflight::flight_path
