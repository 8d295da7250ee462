#include "tileflight/place/memory_budget.h"

#include <gmock/gmock.h>

namespace tileflight::place::memory_budget_test {
namespace {

TEST(MemoryBudget, ReadsTheKernelsTable) {
  const std::string table = "MemTotal:       24737380 kB\nMemFree:  1 kB\nMemAvailable:   20123456 kB\nEmpty:\n";
  EXPECT_EQ(meminfo_bytes(table, "MemAvailable"), std::uintmax_t{20123456} * 1024);
  EXPECT_EQ(meminfo_bytes(table, "MemFree"), 1024U);
  EXPECT_EQ(meminfo_bytes(table, "Mem"), std::nullopt);
  EXPECT_EQ(meminfo_bytes(table, "Empty"), std::nullopt);
  EXPECT_EQ(meminfo_bytes("", "MemFree"), std::nullopt);
}

TEST(MemoryBudget, IsWithinTheMachine) {
  EXPECT_GT(available_memory_bytes(), 1U << 20);
  EXPECT_LE(available_memory_bytes(), 2 * default_memory_bytes() + (1U << 20));
}

}  // namespace
}  // namespace tileflight::place::memory_budget_test
