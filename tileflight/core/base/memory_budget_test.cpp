#include "tileflight/core/base/memory_budget.h"

#include <gmock/gmock.h>

#include <fstream>
#include <limits>

#include "tests/temporary_folder.h"

namespace tileflight::base::memory_budget_test {
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

TEST(MemoryBudget, TheTightestControlGroupAroundAProcessCounts) {
  constexpr std::uintmax_t kUnlimited = std::numeric_limits<std::uintmax_t>::max();
  const tests::TemporaryFolder folder;
  const auto write = [&](const std::filesystem::path& file, const char* text) {
    std::filesystem::create_directories((folder.path() / file).parent_path());
    std::ofstream(folder.path() / file) << text;
  };
  write("slice/memory.max", "4000000\n");
  write("slice/memory.current", "3900000\n");
  write("slice/job/memory.max", "1000000\n");
  write("slice/job/memory.current", "300000\n");
  write("slice/free/memory.max", "max\n");
  const auto of = [&](const char* line) { return control_group_memory(folder.path(), line); };
  EXPECT_EQ(of("0::/slice/job").limit, 1000000U);
  EXPECT_EQ(of("0::/slice/job").left, 100000U);  // what the slice still has
  EXPECT_EQ(of("0::/slice/free").limit, 4000000U);
  EXPECT_EQ(of("0::/").limit, kUnlimited);
  EXPECT_EQ(of("7:memory:/slice/job").limit, kUnlimited);  // version 1
  EXPECT_EQ(of("").left, kUnlimited);
}

}  // namespace
}  // namespace tileflight::base::memory_budget_test
