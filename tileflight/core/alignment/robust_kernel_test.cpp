#include "tileflight/core/alignment/robust_kernel.h"

#include <gtest/gtest.h>

namespace tileflight::alignment::robust_kernel_test {
namespace {

TEST(RobustKernel, WeightIsTheSlopeOfTheCost) {
  for (const KernelType kind : {KernelType::kNone, KernelType::kHuber, KernelType::kTukey, KernelType::kGemanMcClure}) {
    const RobustKernel kernel{kind, 0.4};
    for (const double squared : {1e-4, 0.03, 0.15, 0.17, 0.5, 4.0}) {
      constexpr double kStep = 1e-7;
      const double slope = (kernel.cost_m2(squared + kStep) - kernel.cost_m2(squared - kStep)) / (2.0 * kStep);
      EXPECT_NEAR(kernel.weight(squared), slope, 1e-6) << static_cast<int>(kind) << " at " << squared;
    }
    EXPECT_NEAR(kernel.cost_m2(1e-8) / 1e-8, 1.0, 1e-5) << "least squares near zero";
  }
}

}  // namespace
}  // namespace tileflight::alignment::robust_kernel_test
