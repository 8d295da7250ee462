#include "tileflight/core/geometry/so3_jacobians.h"

#include <gtest/gtest.h>

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
