#include "tileflight/slam/external_systems/measured_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <thread>

#include "tests/refusal.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"

namespace tileflight::external_systems::measured_process_test {
namespace {

using ::testing::HasSubstr;

class MeasuredProcess : public ::testing::Test {
 protected:
  ProcessReport run(const std::string& command, const ProcessLimits& limits = {}) {
    return run_measured(command, folder_.path(), {{"GIVEN", "a value"}}, folder_ / "log", limits);
  }
  std::string log() const { return tests::file_text(folder_ / "log"); }

  tests::TemporaryFolder folder_;
};

TEST_F(MeasuredProcess, RunsInItsFolderWithItsVariablesAndWithoutInput) {
  const ProcessReport report = run("pwd; echo \"$GIVEN\"; cat; echo complaint >&2");
  EXPECT_TRUE(report.succeeded());
  EXPECT_EQ(log(), folder_.path().string() + "\na value\ncomplaint\n");
}

TEST_F(MeasuredProcess, ExitStatusAndSignalsAreToldAsInAShell) {
  EXPECT_EQ(run("exit 3").exit_status, 3);
  EXPECT_EQ(run("exit 3").outcome(), "exit status 3");
  const ProcessReport killed = run("kill -SEGV $$");
  EXPECT_EQ(killed.exit_status, 128 + SIGSEGV);
  EXPECT_THAT(killed.outcome(), HasSubstr("killed by signal 11"));
}

TEST_F(MeasuredProcess, ProcessorTimeAndMemoryAreThoseOfAllItsProcesses) {
  const char* kWork =
      "python3 -c 'import time; a = bytearray(60_000_000); t = time.process_time()\n"
      "while time.process_time() - t < 0.3: pass' ";
  const ProcessReport two = run(std::string(kWork) + "& " + kWork + "; wait");
  ASSERT_TRUE(two.succeeded()) << log();
  EXPECT_GE(two.cpu_seconds, 0.6);
  EXPECT_GE(two.peak_memory_mb, 60.0);
  EXPECT_GE(two.seconds, 0.3);
  // An orphan counts, too: nobody of the command waits for it.
  const ProcessReport orphan =
      run(std::string("((") + kWork + "; touch done) &); while [ ! -e done ]; do sleep 0.05; done");
  EXPECT_GE(orphan.cpu_seconds, 0.3);
}

TEST_F(MeasuredProcess, StopsAtTheTimeLimitWithAllThatItStarted) {
  const ProcessReport report = run("sleep 300 & sh -c 'echo $$ > pid; trap \"\" TERM; sleep 300'", {.seconds = 0.3});
  EXPECT_TRUE(report.out_of_time);
  EXPECT_FALSE(report.succeeded());
  EXPECT_THAT(report.outcome(), HasSubstr("the time limit"));
  const pid_t child = std::stoi(tests::file_text(folder_ / "pid"));
  EXPECT_NE(kill(child, 0), 0) << "a process that ignores being asked is killed";
}

TEST_F(MeasuredProcess, StopsAtTheMemoryLimit) {
  const ProcessReport report =
      run("python3 -c 'import time; a = bytearray(400_000_000); time.sleep(300)'", {.seconds = 60, .memory_mb = 200});
  EXPECT_TRUE(report.out_of_memory);
  EXPECT_GT(report.peak_memory_mb, 200.0);
  EXPECT_THAT(report.outcome(), HasSubstr("the memory limit"));
}

TEST_F(MeasuredProcess, StopsWhatPrintsForEver) {
  const ProcessReport report = run("yes 'the same for ever'", {.seconds = 600});
  EXPECT_TRUE(report.out_of_log);
  EXPECT_FALSE(report.succeeded());
  EXPECT_EQ(report.outcome(), "stopped after it had printed 256 MB");
  EXPECT_EQ(std::filesystem::file_size(folder_ / "log"), 1U << 20);
}

TEST_F(MeasuredProcess, NothingSurvivesACommandThatEnds) {
  ASSERT_TRUE(run("sleep 300 & echo $! > pid").succeeded());
  EXPECT_NE(kill(std::stoi(tests::file_text(folder_ / "pid")), 0), 0);
}

TEST_F(MeasuredProcess, EndsItsCommandWhenItIsAskedToEnd) {
  std::thread asks([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    kill(getpid(), SIGTERM);
  });
  EXPECT_EQ(tests::refusal_of([this] { run("sleep 300"); }), "sleep 300: was stopped by a signal (Terminated)");
  asks.join();
}

}  // namespace
}  // namespace tileflight::external_systems::measured_process_test
