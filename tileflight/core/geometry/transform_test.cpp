#include "tileflight/core/geometry/transform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::transform_test {
namespace {

using std::numbers::pi;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Vec6 random_twist(std::mt19937& random, double angle_rad) {
  std::normal_distribution<double> normal;
  Vec6 twist;
  for (double& value : twist) value = normal(random);
  twist.tail<3>() *= angle_rad / twist.tail<3>().norm();
  return twist;
}

/// The 4x4 matrix of the twist in the Lie algebra.
Mat4 hat(const Vec6& twist) {
  Mat4 m = Mat4::Zero();
  m.topLeftCorner<3, 3>() = skew(twist.tail<3>());
  m.topRightCorner<3, 1>() = twist.head<3>();
  return m;
}

const double kAngles_rad[] = {0.0, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 1e-3, 0.5, 2.0, 3.0, pi - 1e-9};

TEST(Skew, IsTheCrossProduct) {
  const Vec3 v(1, -2, 3), w(0.5, 4, -1);
  EXPECT_TRUE((skew(v) * w).isApprox(v.cross(w)));
}

TEST(So3, ExpEqualsAngleAxisAndLogInvertsIt) {
  std::mt19937 random(1);
  for (const double angle : kAngles_rad) {
    const Vec3 omega = random_twist(random, angle).tail<3>();
    const Eigen::Quaterniond q = so3_exp(omega);
    if (angle > 0.0) {
      const Mat3 expected = Eigen::AngleAxisd(angle, omega.normalized()).toRotationMatrix();
      EXPECT_LT((q.toRotationMatrix() - expected).norm(), 1e-14) << angle;
    }
    EXPECT_LT((so3_log(q) - omega).norm(), 1e-14 + 1e-12 * angle) << angle;
  }
}

TEST(So3, LogOfTheNegatedQuaternionIsTheSameAndAtMostPi) {
  const Eigen::Quaterniond q = so3_exp(Vec3(0.1, 3.0, -0.4));
  const Eigen::Quaterniond negated(-q.w(), -q.x(), -q.y(), -q.z());
  EXPECT_LT((so3_log(q) - so3_log(negated)).norm(), 1e-15);
  EXPECT_LE(so3_log(so3_exp(Vec3(0, 0, 4.0))).norm(), pi);
}

TEST(Se3, ExpIsTheMatrixExponential) {
  std::mt19937 random(2);
  for (const double angle : kAngles_rad) {
    const Vec6 twist = angle > 0.0 ? random_twist(random, angle) : Vec6(Vec6::Unit(0));
    const Mat4 expected = hat(twist).exp();
    EXPECT_LT((SE3::exp(twist).matrix() - expected).norm(), 1e-12) << angle;
  }
}

TEST(Se3, LogInvertsExp) {
  std::mt19937 random(3);
  for (const double angle : kAngles_rad) {
    const Vec6 twist = angle > 0.0 ? random_twist(random, angle) : Vec6(Vec6::Unit(1));
    EXPECT_LT((SE3::exp(twist).log() - twist).norm(), 1e-10) << angle;
  }
}

TEST(Se3, DerivativeOfExpAtZeroIsTheGenerator) {
  const Vec3 p(1, 2, 3);
  const double h = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Vec6 step = h * Vec6::Unit(i);
    const Vec3 numeric = (SE3::exp(step) * p - SE3::exp(-step) * p) / (2 * h);
    const Vec3 expected = (hat(Vec6::Unit(i)) * p.homogeneous()).head<3>();
    EXPECT_LT((numeric - expected).norm(), 1e-8) << i;
  }
}

TEST(Se3, GroupAxioms) {
  std::mt19937 random(4);
  const SE3 a = SE3::exp(random_twist(random, 1.0));
  const SE3 b = SE3::exp(random_twist(random, 2.0));
  const SE3 c = SE3::exp(random_twist(random, 0.3));
  const Vec3 p(1, -1, 2);
  EXPECT_LT(((a * b) * c * p - a * (b * (c * p))).norm(), 1e-14);
  EXPECT_LT((a * a.inverse()).matrix().isIdentity(1e-14) ? 0.0 : 1.0, 0.5);
  EXPECT_LT(((a * b).matrix() - a.matrix() * b.matrix()).norm(), 1e-13);
}

TEST(Sim3, ComposesInvertsAndReadsItsMatrix) {
  std::mt19937 random(5);
  const SE3 r = SE3::exp(random_twist(random, 1.3));
  const Sim3 a(2.5, r.rotation, r.translation);
  const Sim3 b(0.2, so3_exp(Vec3(1, 1, 0)), Vec3(4, 5, 6));
  EXPECT_LT(((a * b).matrix() - a.matrix() * b.matrix()).norm(), 1e-12);
  EXPECT_TRUE((a * a.inverse()).matrix().isIdentity(1e-13));
  const Sim3 read = Sim3::from_matrix(a.matrix());
  EXPECT_NEAR(read.scale, 2.5, 1e-14);
  EXPECT_LT((read.matrix() - a.matrix()).norm(), 1e-13);
}

TEST(Sim3, MovesAPoseAsItMovesItsPoints) {
  const Sim3 S(3.0, so3_exp(Vec3(0, 0.5, 1)), Vec3(1, 2, 3));
  const SE3 pose(so3_exp(Vec3(0.2, 0, 0)), Vec3(-1, 0, 4));
  EXPECT_TRUE(((S * pose).translation).isApprox(S * pose.translation));
  EXPECT_TRUE((S * pose).rotation.isApprox(S.rotation * pose.rotation));
}

TEST(Sim3, RefusesWhatIsNoSimilarity) {
  Mat4 sheared = Mat4::Identity();
  sheared(0, 1) = 0.1;
  Mat4 mirrored = Mat4::Identity();
  mirrored(2, 2) = -1.0;
  Mat4 projective = Mat4::Identity();
  projective(3, 0) = 0.1;
  Mat4 not_finite = Mat4::Identity();
  not_finite(1, 1) = std::nan("");
  Mat4 flat = Mat4::Identity();
  flat(2, 2) = 0.0;
  const auto expect_refused = [](const Mat4& m, const char* message) {
    EXPECT_THAT([&] { Sim3::from_matrix(m); }, ThrowsMessage<InputError>(HasSubstr(message))) << m;
  };
  expect_refused(sheared, "its axes are sheared or scaled unequally");
  expect_refused(mirrored, "it mirrors or flattens");
  expect_refused(projective, "the last row is not 0 0 0 1");
  expect_refused(Mat4::Zero(), "the last row is not 0 0 0 1");
  expect_refused(not_finite, "contains a number that is not finite");
  expect_refused(flat, "it mirrors or flattens");
}

}  // namespace
}  // namespace tileflight::geometry::transform_test

namespace tileflight::geometry::so3_jacobians_test {
namespace {

TEST(So3Jacobians, TheRightOneIsThatOfFiniteDifferences) {
  constexpr double h = 1e-6;
  for (const Vec3& omega : {Vec3(0.3, -0.7, 1.1), Vec3(1e-6, 2e-6, 0.0), Vec3(0.0, 0.0, 0.0), Vec3(1.9, -2.0, 1.2)}) {
    const Mat3 J = so3_right_jacobian(omega);
    for (int i = 0; i < 3; ++i) {
      const Vec3 column = so3_log(so3_exp(omega - h * Vec3::Unit(i)).conjugate() * so3_exp(omega + h * Vec3::Unit(i)));
      EXPECT_LT((J.col(i) - column / (2 * h)).norm(), 1e-8) << omega.transpose();
    }
    EXPECT_LT((J * so3_right_jacobian_inverse(omega) - Mat3::Identity()).norm(), 1e-12) << omega.transpose();
  }
}

}  // namespace
}  // namespace tileflight::geometry::so3_jacobians_test
