#include "tileflight/core/geometry/decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace tileflight::geometry {

using Eigen::MatrixXd;
using Eigen::VectorXd;

SymmetricEigen symmetric_eigen(const MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(matrix);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

VectorXd symmetric_eigenvalues(const MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

Vec6 solve_symmetric(const Mat6& A, const Vec6& b) { return A.ldlt().solve(b); }
Vec7 solve_symmetric(const Mat7& A, const Vec7& b) { return A.ldlt().solve(b); }
VectorXd solve_symmetric(const MatrixXd& A, const VectorXd& b) { return A.ldlt().solve(b); }

MatrixXd symmetric_inverse(const MatrixXd& A) { return A.ldlt().solve(MatrixXd::Identity(A.rows(), A.cols())); }

VectorXd solve_least_squares(const MatrixXd& A, const VectorXd& b) {
  return Eigen::ColPivHouseholderQR<MatrixXd>(A).solve(b);
}

VectorXd solve_with_least_norm(const MatrixXd& A, const Vec7& b) {
  return Eigen::CompleteOrthogonalDecomposition<MatrixXd>(A).solve(b);
}

Eigen::Quaterniond rotation_between(const Vec3& from, const Vec3& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace tileflight::geometry
