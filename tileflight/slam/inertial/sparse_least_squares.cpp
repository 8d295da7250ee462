#include "tileflight/slam/inertial/sparse_least_squares.h"

#include <cmath>

namespace tileflight::inertial {

void SparseLeastSquares::add(const Eigen::VectorXd& residual, const Eigen::MatrixXd& weight,
                             std::initializer_list<JacobianBlock> derivatives) {
  cost_ += residual.dot(weight * residual);
  for (const JacobianBlock& a : derivatives) {
    const Eigen::MatrixXd weighted = a.derivative.transpose().lazyProduct(weight);  // small: no blocking
    gradient_.segment(a.column, a.derivative.cols()) += weighted * residual;
    for (const JacobianBlock& b : derivatives) {
      if (b.column > a.column) continue;  // the lower triangle is enough
      const Eigen::MatrixXd block = weighted.lazyProduct(b.derivative);
      for (Eigen::Index i = 0; i < block.rows(); ++i)
        for (Eigen::Index j = 0; j < block.cols(); ++j)
          if (block(i, j) != 0.0)
            entries_.emplace_back(static_cast<int>(a.column + i), static_cast<int>(b.column + j), block(i, j));
    }
  }
}

void SparseLeastSquares::add_robust(const Eigen::VectorXd& residual, const Eigen::MatrixXd& weight, double c,
                                    std::initializer_list<JacobianBlock> derivatives) {
  const double square = residual.dot(weight * residual), factor = 1.0 / (1.0 + square / (c * c));
  add(residual, factor * weight, derivatives);
  cost_ += c * c * std::log1p(square / (c * c)) - factor * square;
}

Eigen::SparseMatrix<double> SparseLeastSquares::lower_triangle() const {
  Eigen::SparseMatrix<double> H(gradient_.size(), gradient_.size());
  H.setFromTriplets(entries_.begin(), entries_.end());
  return H;
}

Eigen::SparseMatrix<double> SparseLeastSquares::information() const {
  return lower_triangle().selfadjointView<Eigen::Lower>();
}

std::optional<Eigen::VectorXd> SparseLeastSquares::step(double damping) const {
  Eigen::SparseMatrix<double> H = lower_triangle();
  for (Eigen::Index i = 0; i < H.rows(); ++i) H.coeffRef(i, i) *= 1.0 + damping;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(H);  // reads that triangle
  if (factors.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd x = factors.solve(-gradient_);
  if (!x.allFinite()) return std::nullopt;
  return x;
}

double variance_of(const Eigen::SparseMatrix<double>& information, const Eigen::VectorXd& coefficients) {
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(information);
  if (factors.info() != Eigen::Success || !(factors.vectorD().array() > 0.0).all()) return HUGE_VAL;
  const double variance = coefficients.dot(factors.solve(coefficients));
  return std::isfinite(variance) && variance > 0.0 ? variance : HUGE_VAL;
}

Eigen::MatrixXd covariance_of(const Eigen::SparseMatrix<double>& information, const Eigen::MatrixXd& coefficients) {
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(information);
  if (factors.info() != Eigen::Success || !(factors.vectorD().array() > 0.0).all())
    return Eigen::MatrixXd::Constant(coefficients.cols(), coefficients.cols(), HUGE_VAL);
  return coefficients.transpose() * factors.solve(coefficients);
}

}  // namespace tileflight::inertial
