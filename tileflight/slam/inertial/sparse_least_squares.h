#pragma once

// Gauss-Newton's normal equations of residuals that each see a few unknowns.

#include <Eigen/SparseCholesky>
#include <initializer_list>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {

/// Derivative of a residual by the unknowns from `column` on.
struct JacobianBlock {
  Eigen::Index column = 0;
  Eigen::MatrixXd derivative;
};

/// Sums J^T W J and J^T W r.
class SparseLeastSquares {
 public:
  explicit SparseLeastSquares(Eigen::Index unknowns) : gradient_(Eigen::VectorXd::Zero(unknowns)) {}

  /// Adds a residual. `weight`: the inverse of its covariance.
  void add(const Eigen::VectorXd& residual, const Eigen::MatrixXd& weight,
           std::initializer_list<JacobianBlock> derivatives);
  /// Adds a residual that weighs less the larger it is: Cauchy's function c^2 log(1 + r^T W r / c^2), by reweighting
  /// (Holland and Welsch 1977).
  void add_robust(const Eigen::VectorXd& residual, const Eigen::MatrixXd& weight, double c,
                  std::initializer_list<JacobianBlock> derivatives);
  double cost() const { return cost_; }  ///< sum of r^T W r, or of Cauchy's function of it
  Eigen::SparseMatrix<double> information() const;
  const Eigen::VectorXd& gradient() const { return gradient_; }
  /// Returns the step that lowers the cost, with `damping` times the diagonal added (Levenberg 1944, Marquardt 1963).
  /// nullopt if the equations are singular.
  std::optional<Eigen::VectorXd> step(double damping) const;

 private:
  Eigen::SparseMatrix<double> lower_triangle() const;

  std::vector<Eigen::Triplet<double>> entries_;  ///< of the lower triangle, and of whole blocks on the diagonal
  Eigen::VectorXd gradient_;
  double cost_ = 0.0;
};

/// Returns the variance of the linear function with the given coefficients of unknowns whose covariance is the inverse
/// of `information`; infinite if that is singular.
double variance_of(const Eigen::SparseMatrix<double>& information, const Eigen::VectorXd& coefficients);
/// Returns the covariance of several linear functions, the columns of `coefficients`; not finite if `information` is
/// singular.
Eigen::MatrixXd covariance_of(const Eigen::SparseMatrix<double>& information, const Eigen::MatrixXd& coefficients);

}  // namespace tileflight::inertial
