#pragma once

#include <Eigen/Core>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

// Eigen's decompositions take a compiler seconds each, in every file that uses one: those that several files use are
// compiled here, once.

using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat7 = Eigen::Matrix<double, 7, 7>;

/// Eigenvalues in increasing order; column k of `vectors` is the eigenvector of unit length of value k.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Decomposes a symmetric matrix; only its lower triangle is read.
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& matrix);

/// Solves A x = b for a symmetric A, which need not be positive definite (LDL^T with pivoting).
Vec6 solve_symmetric(const Mat6& A, const Vec6& b);
Vec7 solve_symmetric(const Mat7& A, const Vec7& b);
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// Inverts a symmetric matrix by its LDL^T decomposition.
Eigen::MatrixXd symmetric_inverse(const Eigen::MatrixXd& A);

/// Returns the least-squares solution of A x = b for an A of full column rank (QR with pivoting).
Eigen::VectorXd solve_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// Returns the shortest of the least-squares solutions of A x = b; A has seven rows and any rank.
Eigen::VectorXd solve_with_least_norm(const Eigen::MatrixXd& A, const Vec7& b);

/// Returns the smallest rotation of the direction `from` to the direction `to`; neither need be of unit length.
Eigen::Quaterniond rotation_between(const Vec3& from, const Vec3& to);

}  // namespace tileflight::geometry
