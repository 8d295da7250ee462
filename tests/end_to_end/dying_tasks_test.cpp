// `extract` and `render` in tasks of a workflow, of which one is killed, or a node of the cluster is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "tests/find_process.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/slurm_cluster.h"
#include "tests/tiny_place.h"

namespace tileflight::dying_tasks_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

/// A command whose work is done in tasks, each of which takes seconds.
struct Work {
  std::vector<std::string> words;
  std::string part_option;  ///< of a task that makes a part
  std::string done;         ///< where what is made lies until all is: in the folder "." + output + done
  std::string time_file{};  ///< file of the output that says how long it took
};

class DyingTasks : public testing::Test {
 protected:
  DyingTasks() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", "camera: camera.yaml\n" + TinyPlace::path_with_sensors(32));
  }
  Work extract() const {
    return {{"extract", (folder_ / "place").string(), "--voxel", "0.1", "--block", "10"},
            "--part",
            ".blocks/done",
            "extract.json"};
  }
  Work render() const {
    return {{"render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(), "--outputs",
             "depth,segmentation", "--samples", "16", "--memory", "1"},
            "--frames",
            ".frames/frames"};
  }
  static std::vector<std::string> join(std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::string> call(const Work& work, const std::string& out, const std::vector<std::string>& more) const {
    return join(join(work.words, {"--json", "--out", (folder_ / out).string()}), more);
  }
  /// Parts that are there already.
  std::size_t parts_in(const Work& work, const std::string& out) const {
    std::error_code none;
    std::size_t count = 0;
    for (fs::directory_iterator entry(folder_ / ("." + out + work.done), none), end; !none && entry != end;
         entry.increment(none))
      count += entry->path().extension() == ".json" ? 1 : 0;
    return count;
  }
  /// Runs the work, and calls `strike` once some of it is done, again and again until it returns true.
  template <class Strike>
  ProgramResult run_struck(const Work& work, const std::string& out, const std::vector<std::string>& more,
                           const std::string& environment, const Strike& strike) const {
    std::atomic<bool> is_over = false, is_struck = false;
    std::thread striker([&] {
      while (!is_over && !is_struck) {
        is_struck = parts_in(work, out) > 0 && strike();
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      }
    });
    ProgramResult result = run_tileflight(call(work, out, more), environment);
    is_over = true;
    striker.join();
    EXPECT_TRUE(is_struck) << "there was nothing to strike: " << result.err;
    return result;
  }
  void expect_as_alone(const Work& work, const std::string& out) const {
    const ProgramResult alone = run_tileflight(call(work, "alone-" + out, {}));
    ASSERT_EQ(alone.exit_code, 0) << alone.err;
    tests::expect_same_files(folder_ / ("alone-" + out), folder_ / out, work.time_file);
    for (const char* kind : {"blocks", "frames", "tasks"})
      EXPECT_FALSE(fs::exists(folder_ / ("." + out + "." + kind))) << kind;
  }
  void expect_same_bytes_after_a_killed_task(const Work& work) const {
    const ProgramResult struck = run_struck(work, "out", {"--jobs", "2"}, "", [&] {
      const auto task = tests::find_process([&](const std::string& command, const std::string&) {
        return command.starts_with(TILEFLIGHT_BINARY) &&
               command.find(std::string(1, '\0') + work.part_option + '\0') != std::string::npos &&
               command.find((folder_ / "out").string() + '\0') != std::string::npos;
      });
      return task && ::kill(*task, SIGKILL) == 0;
    });
    EXPECT_EQ(struck.exit_code, 1);
    EXPECT_THAT(struck.err, HasSubstr("tileflight: task "));
    EXPECT_THAT(struck.err, HasSubstr("the same command goes on where it stopped"));
    EXPECT_EQ(tests::line_count(struck.err), 1) << struck.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
    EXPECT_GT(parts_in(work, "out"), 0U);
    const ProgramResult again = run_tileflight(call(work, "out", {"--jobs", "2"}));
    ASSERT_EQ(again.exit_code, 0) << again.err;
    expect_as_alone(work, "out");
  }

  tests::TemporaryFolder folder_;
};

TEST_F(DyingTasks, AKilledTaskOfExtractIsNamedAndTheSameCommandGoesOn) {
  expect_same_bytes_after_a_killed_task(extract());
}

TEST_F(DyingTasks, AKilledTaskOfRenderIsNamedAndTheSameCommandGoesOn) {
  expect_same_bytes_after_a_killed_task(render());
}

TEST_F(DyingTasks, SlurmGoesOnWhenANodeDies) {
  if (std::system("command -v snakemake > /dev/null") != 0) GTEST_SKIP() << "snakemake is not installed";
  if (!tests::SlurmCluster::is_possible()) GTEST_SKIP() << "Slurm is not installed, or this is not root";
  const tests::SlurmCluster cluster;
  for (const Work& work : {extract(), render()}) {
    const std::string out = work.words.front() + "ed";
    std::string dead_node;
    const ProgramResult result = run_struck(work, out, {"--slurm", "--jobs", "2"}, cluster.environment(), [&] {
      dead_node = cluster.kill_busy_node(tests::SlurmCluster::Notice::kMonitor);
      if (!dead_node.empty()) cluster.hurry_requeued_job();
      return !dead_node.empty();
    });
    ASSERT_EQ(result.exit_code, 0) << result.err
                                   << tests::file_text(folder_ / ("." + out + ".tasks/logs/snakemake.txt"));
    ASSERT_THAT(dead_node, testing::AnyOf("n1", "n2"));
    expect_as_alone(work, out);
    cluster.start_again(dead_node);
  }
}

}  // namespace
}  // namespace tileflight::dying_tasks_test
