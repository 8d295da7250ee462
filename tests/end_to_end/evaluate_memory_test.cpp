// `evaluate` of dense maps: what each point costs in memory.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "tests/run_program.h"
#include "tests/tiny_place.h"
#include "tileflight/core/geometry/ply.h"

namespace tileflight::evaluate_memory_test {
namespace {

namespace fs = std::filesystem;
using tests::TinyPlace;

#ifdef __SANITIZE_ADDRESS__
constexpr bool kSanitized = true;
#elif defined(__has_feature)
constexpr bool kSanitized = __has_feature(address_sanitizer);
#else
constexpr bool kSanitized = false;
#endif

/// Points around the surface, in blocks, so that this process, whose memory the child's count begins with, stays small.
void write_map(const fs::path& file, std::size_t points) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-TinyPlace::kHalf, TinyPlace::kHalf);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::size_t left = points;
  geometry::write_ply_in_blocks(file, points, [&] {
    geometry::PointCloud block;
    for (; left > 0 && block.size() < 50000; --left) {
      const double x = place(random), y = place(random);
      block.positions.emplace_back(x, y, TinyPlace::height(x, y) + noise(random));
      block.colors.push_back({1, 2, 3});
      for (const char* name : {"first_frame", "last_frame", "observations"}) block.scalars[name].push_back(1.0F);
    }
    return block;
  });
}

/// Largest resident memory of the program, bytes.
double peak_bytes(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TILEFLIGHT_BINARY);
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    execv(words.front(), words.data());
    _exit(127);
  }
  int status = 0;
  rusage used{};
  wait4(child, &status, 0, &used);
  EXPECT_EQ(status, 0);
  return 1024.0 * static_cast<double>(used.ru_maxrss);
}

/// Its distances take 24 bytes of each point while they are scored. Positions, attributes and index, which would take
/// 130, are held in parts, whose size varies by some 60 MB.
TEST(EvaluateMemory, IsLessThanSixtyBytesAPoint) {
  if (kSanitized) GTEST_SKIP() << "the sanitizer keeps memory of its own";
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  const std::string truth = (folder / "truth").string(), transform = (folder / "transform.json").string();
  ASSERT_EQ(tests::run_tileflight({"extract", (folder / "place").string(), "--out", truth, "--voxel", "0.5"}).exit_code,
            0);
  std::ofstream(transform) << R"({"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 1, "rmse": 0,
                                  "fitness": 1, "iterations": 1, "converged": true, "method": "given"})";
  const auto peak_of = [&](std::size_t points) {
    const std::string map = (folder / "map.ply").string();
    write_map(map, points);
    return peak_bytes({"evaluate", map, "--truth", truth, "--transform", transform, "--out",
                       (folder / "metrics.json").string(), "--quiet", "--threads", "1"});
  };
  constexpr std::size_t kFew = 800'000, kMany = 2'400'000;
  const double few = peak_of(kFew), many = peak_of(kMany);
  EXPECT_LT((many - few) / static_cast<double>(kMany - kFew), 60.0);
}

}  // namespace
}  // namespace tileflight::evaluate_memory_test
