#include <gtest/gtest.h>

#include <Eigen/Core>

namespace tileflight::base {
namespace {

TEST(MatrixProducts, HaveTheSameBlocksOnEachProcessor) {
  EXPECT_EQ(Eigen::l1CacheSize(), 32 * 1024);
  EXPECT_EQ(Eigen::l2CacheSize(), 256 * 1024);
  EXPECT_EQ(Eigen::l3CacheSize(), 2 * 1024 * 1024);
}

}  // namespace
}  // namespace tileflight::base
