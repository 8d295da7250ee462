// Eigen cuts the sums of long matrix products into blocks that fit the processor's caches, so that the last bits depend
// on the processor. Here each processor has the same caches; their sizes are those that Eigen assumes where it cannot
// ask.

#include <Eigen/Core>

extern "C" const int tileflight_matrix_product_blocks = [] {
  Eigen::setCpuCacheSizes(32 * 1024, 256 * 1024, 2 * 1024 * 1024);
  return 0;
}();
