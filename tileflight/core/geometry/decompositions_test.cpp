#include "tileflight/core/geometry/decompositions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tileflight::geometry::decompositions_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  MatrixXd m(rows, columns);
  for (double& value : m.reshaped()) value = normal(random);
  return m;
}

/// Symmetric, with eigenvalues of both signs.
MatrixXd random_symmetric(Eigen::Index size) {
  const MatrixXd m = random_matrix(size, size);
  return m + m.transpose();
}

TEST(Decompositions, EigenvectorsTimesEigenvaluesGiveTheMatrix) {
  const MatrixXd m = random_symmetric(9);
  const SymmetricEigen eigen = symmetric_eigen(m);
  EXPECT_TRUE((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose()).isApprox(m, 1e-13));
  EXPECT_TRUE((eigen.vectors.transpose() * eigen.vectors).isIdentity(1e-13));
  EXPECT_TRUE(std::is_sorted(eigen.values.begin(), eigen.values.end()));
  EXPECT_TRUE(symmetric_eigenvalues(m).isApprox(eigen.values, 1e-13));
}

TEST(Decompositions, SymmetricSystemsAreSolved) {
  const Mat6 A6 = random_symmetric(6);
  const Mat7 A7 = random_symmetric(7);
  const MatrixXd A = random_symmetric(20);
  const VectorXd x = random_matrix(20, 1);
  EXPECT_TRUE(solve_symmetric(A6, A6 * x.head<6>()).isApprox(x.head<6>(), 1e-11));
  EXPECT_TRUE(solve_symmetric(A7, A7 * x.head<7>()).isApprox(x.head<7>(), 1e-11));
  EXPECT_TRUE(solve_symmetric(A, A * x).isApprox(x, 1e-11));
  EXPECT_TRUE((symmetric_inverse(A) * A).isIdentity(1e-11));
}

TEST(Decompositions, ResidualOfLeastSquaresIsOrthogonalToTheColumns) {
  const MatrixXd A = random_matrix(12, 5);
  const VectorXd b = random_matrix(13, 1).bottomRows(12);  // not the first column of A
  EXPECT_LT((A.transpose() * (A * solve_least_squares(A, b) - b)).norm(), 1e-12);
}

TEST(Decompositions, OfSolutionsTheShortestIsTaken) {
  const MatrixXd columns = random_matrix(7, 2);
  MatrixXd A(7, 3);
  A << columns, columns.col(0);  // x0 and x2 act alike
  const VectorXd x = solve_with_least_norm(A, Vec7(A * Vec3(1.0, 2.0, 3.0)));
  EXPECT_TRUE(x.isApprox(Vec3(2.0, 2.0, 2.0), 1e-12));
}

TEST(Decompositions, RotationBetweenTakesTheShortestWay) {
  const Vec3 from(1.0, -2.0, 0.5), to(0.3, 0.2, -4.0);
  const Eigen::Quaterniond R = rotation_between(from, to);
  EXPECT_TRUE((R * from.normalized()).isApprox(to.normalized(), 1e-13));
  EXPECT_NEAR(so3_log(R).norm(), std::acos(from.normalized().dot(to.normalized())), 1e-13);
}

TEST(Decompositions, OppositeDirectionsAreHalfATurnApart) {
  const Vec3 from(1.0, -2.0, 0.5);
  EXPECT_TRUE((rotation_between(from, -from) * from).isApprox(-from, 1e-7));
}

}  // namespace
}  // namespace tileflight::geometry::decompositions_test
