#include "tileflight/experiments/experiment/run_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::experiment::run_folder_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using tests::refusal_of;

void make_file(const fs::path& file) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << "x";
}

TEST(RunFolder, IsMadeAndTakenAgain) {
  const tests::TemporaryFolder folder;
  { const RunFolder first(folder / "a/out"); }
  { const RunFolder again(folder / "a/out"); }
  EXPECT_TRUE(fs::is_directory(folder / "a/out/stages"));
  EXPECT_TRUE(fs::is_empty(folder / "a/out/.lock")) << "nobody has it";
}

TEST(RunFolder, IsNoOtherFolder) {
  const tests::TemporaryFolder folder;
  make_file(folder / "file");
  EXPECT_THAT(refusal_of([&] { RunFolder(folder / "file"); }), HasSubstr("is a file"));
  make_file(folder / "mine/notes.txt");
  EXPECT_THAT(refusal_of([&] { RunFolder(folder / "mine"); }),
              HasSubstr("contains files that are not from an earlier run"));
  EXPECT_FALSE(fs::exists(folder / "mine/.lock"));
  make_file(folder / "opera/stages/plan.png");
  EXPECT_THAT(refusal_of([&] { RunFolder(folder / "opera"); }),
              HasSubstr("contains files that are not from an earlier run"));
  base::write_folder(base::OutputFolder{.folder = folder / "dataset", .command = "render"},
                     [](const fs::path& t) { make_file(t / "stages/a.json"); });
  EXPECT_THAT(refusal_of([&] { RunFolder(folder / "dataset"); }),
              HasSubstr("contains files that are not from an earlier run"));
  // A run of a version without markers, and one whose process was killed immediately.
  make_file(folder / "earlier/stages/truth.json");
  EXPECT_EQ(refusal_of([&] { RunFolder(folder / "earlier"); }), "no error");
  make_file(folder / "killed/.lock");
  EXPECT_EQ(refusal_of([&] { RunFolder(folder / "killed"); }), "no error");
}

TEST(RunFolder, IsOneProcessesAloneUntilThatEnds) {
  const tests::TemporaryFolder folder;
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const RunFolder own(folder / "out");
    [[maybe_unused]] const auto written = ::write(ready[1], "x", 1);
    ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  const std::string refusal = refusal_of([&] { RunFolder(folder / "out"); });
  EXPECT_THAT(refusal, HasSubstr("out: process " + std::to_string(child) + " ("));
  EXPECT_THAT(refusal, HasSubstr("is using it; wait until it has ended"));
  EXPECT_THAT(refusal, Not(HasSubstr("--force")));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(refusal_of([&] { RunFolder(folder / "out"); }), "no error") << "whatever the lock's file says";
  ::close(ready[0]);
  ::close(ready[1]);
}

TEST(RemoveResults, LeavesWhatRunsDidNotWrite) {
  const tests::TemporaryFolder folder;
  const fs::path part = folder / "2";
  const auto write_stage = [](const fs::path& to) {
    base::write_folder(base::OutputFolder{.folder = to, .command = "odometry"},
                       [](const fs::path& t) { make_file(t / "map.ply"); });
  };
  const auto write_all = [&] {
    { const RunFolder variant(part); }
    write_stage(part / "simulated/odometry");
    write_stage(part / "simulated/runs/2/odometry");
    for (const char* file :
         {"stages/truth.json", "simulated/metrics.json", "simulated/errors.ply", "report.html", "figures/maps.svg",
          "tables/key-figures.csv", "simulated/.dataset.frames/frames/000000.json"})
      make_file(part / file);
  };
  write_all();
  remove_results(part);
  EXPECT_FALSE(fs::exists(part));
  write_all();
  make_file(part / "simulated/notes.txt");
  make_file(part / "simulated/runs/2/odometry/notes.txt");
  remove_results(part);
  EXPECT_TRUE(fs::exists(part / "simulated/notes.txt"));
  EXPECT_TRUE(fs::exists(part / "simulated/runs/2/odometry/map.ply")) << "a folder with others' files stays whole";
  EXPECT_FALSE(fs::exists(part / "simulated/odometry"));
  EXPECT_FALSE(fs::exists(part / "simulated/metrics.json"));
}

}  // namespace
}  // namespace tileflight::experiment::run_folder_test
