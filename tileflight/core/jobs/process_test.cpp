#include "tileflight/core/jobs/process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/refusal.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/build_folder.h"

namespace tileflight::jobs::process_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

void wait_until(const std::function<bool()>& holds) {
  for (int i = 0; i < 6000 && !holds(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(holds());
}

int wait_for_end(Process& process) {
  std::optional<int> status = process.exit_status();
  for (; !status; status = process.exit_status()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  return *status;
}

TEST(Process, TellsHowItEndedAndWhatItPrintedLast) {
  const tests::TemporaryFolder folder;
  Process process({.words = shell("pwd > here; echo first; echo 'the last' >&2; echo; exit 4"),
                   .folder = folder.path(),
                   .log = folder / "log"});
  EXPECT_EQ(wait_for_end(process), 4);
  EXPECT_EQ(describe_exit(4), "exit status 4");
  EXPECT_EQ(last_line(folder / "log"), "the last");
  EXPECT_TRUE(fs::exists(folder / "here"));
  Process killed({.words = shell("kill -9 $$"), .log = folder / "log2"});
  EXPECT_EQ(wait_for_end(killed), 128 + SIGKILL);
  EXPECT_EQ(describe_exit(128 + SIGKILL), "killed by signal 9 (Killed)");
  EXPECT_EQ(last_line(folder / "log2"), "");
  Process missing({.words = {"no-such-program"}});
  EXPECT_EQ(wait_for_end(missing), 127);
}

TEST(Process, RunsOnWhenItIsLeft) {
  const tests::TemporaryFolder folder;
  {
    Process process({.words = shell("sleep 0.3; touch done"), .folder = folder.path()});
    process.leave_running();
  }
  wait_until([&] { return fs::exists(folder / "done"); });
}

/// The destructor also ends a child that ignores the request to terminate.
TEST(Process, LeavesNothingBehind) {
  const tests::TemporaryFolder folder;
  pid_t stubborn = 0;
  {
    const Process process(
        {.words = shell("sh -c 'trap \"\" TERM; echo $$ > pid; mv pid number; while :; do sleep 0.1; done' & wait"),
         .folder = folder.path(),
         .log = folder / "log"});
    while (!(std::ifstream(folder / "number") >> stubborn)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(kill(stubborn, 0), 0);
  }
  EXPECT_NE(kill(stubborn, 0), 0);
}

TEST(RunGuarded, ReturnsHowTheProgramEnded) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(run_guarded({shell("pwd > here; echo out; echo err >&2; exit 4"), folder.path(), folder / "log"}), 4);
  EXPECT_TRUE(fs::exists(folder / "here"));
  EXPECT_EQ(fs::file_size(folder / "log"), 8U);
  EXPECT_EQ(run_guarded({shell("kill -9 $$"), folder.path(), folder / "log"}), 128 + SIGKILL);
  EXPECT_EQ(run_guarded({{"no-such-program"}, folder.path(), folder / "log"}), 127);
}

/// A process that is killed in the middle of run_guarded(), with a lock on `folder`.
class Killed {
 public:
  Killed(const fs::path& folder, const std::string& script, const Patience& patience = {}) {
    process_ = fork();
    if (process_ != 0) return;
    const FolderLock lock(folder);
    run_guarded({shell(script), folder, folder / "log"}, patience);
    _exit(0);
  }
  void kill() const {
    ::kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }

 private:
  pid_t process_ = -1;
};

/// The program, what it has started, and what ignores polite signals.
TEST(RunGuarded, NothingOutlivesAKilledProcess) {
  const tests::TemporaryFolder folder;
  const Killed process(folder.path(),
                       "sleep 600 & echo $! > first; "
                       "sh -c 'trap \"\" INT TERM; echo $$ > second; mv second stubborn; while :; do sleep 0.1; done'",
                       {.until_terminated_s = 1, .until_killed_s = 2});
  wait_until([&] { return fs::exists(folder / "stubborn"); });
  pid_t background = 0, stubborn = 0;
  ASSERT_TRUE(std::ifstream(folder / "first") >> background);
  ASSERT_TRUE(std::ifstream(folder / "stubborn") >> stubborn);
  EXPECT_EQ(::kill(background, 0), 0);
  EXPECT_EQ(::kill(stubborn, 0), 0);
  process.kill();
  wait_until([&] { return ::kill(background, 0) != 0 && ::kill(stubborn, 0) != 0; });
}

/// The next process waits for what a killed one left, instead of working beside it.
TEST(RunGuarded, TheLockOfAKilledProcessIsHeldUntilItsProgramHasEnded) {
  const tests::TemporaryFolder folder;
  const Killed process(folder.path(),
                       "trap 'sleep 1; touch ended; exit' INT; touch begun; while :; do sleep 0.05; done");
  wait_until([&] { return fs::exists(folder / "begun"); });
  try {
    const FolderLock second(folder.path());
    FAIL() << "the first process lives";
  } catch (const InputError&) {
  }
  process.kill();
  const FolderLock lock(folder.path());
  EXPECT_TRUE(fs::exists(folder / "ended"));
}

class RunMeasured : public ::testing::Test {
 protected:
  ProcessReport run(const std::string& command, const ProcessLimits& limits = {}) {
    return run_measured({shell(command), folder_.path(), folder_ / "log", {{"GIVEN", "a value"}}}, limits);
  }
  std::string log() const { return tests::file_text(folder_ / "log"); }

  tests::TemporaryFolder folder_;
};

TEST_F(RunMeasured, RunsInItsFolderWithItsVariablesAndWithoutInput) {
  const ProcessReport report = run("pwd; echo \"$GIVEN\"; cat; echo complaint >&2");
  EXPECT_TRUE(report.succeeded());
  EXPECT_EQ(log(), folder_.path().string() + "\na value\ncomplaint\n");
}

TEST_F(RunMeasured, ExitStatusAndSignalsAreToldAsInAShell) {
  EXPECT_EQ(run("exit 3").exit_status, 3);
  EXPECT_EQ(run("exit 3").outcome(), "exit status 3");
  const ProcessReport killed = run("kill -SEGV $$");
  EXPECT_EQ(killed.exit_status, 128 + SIGSEGV);
  EXPECT_THAT(killed.outcome(), HasSubstr("killed by signal 11"));
}

TEST_F(RunMeasured, ProcessorTimeAndMemoryAreThoseOfAllItsProcesses) {
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

TEST_F(RunMeasured, StopsAtTheTimeLimitWithAllThatItStarted) {
  const ProcessReport report = run("sleep 300 & sh -c 'echo $$ > pid; trap \"\" TERM; sleep 300'", {.seconds = 0.3});
  EXPECT_TRUE(report.out_of_time);
  EXPECT_FALSE(report.succeeded());
  EXPECT_THAT(report.outcome(), HasSubstr("the time limit"));
  const pid_t child = std::stoi(tests::file_text(folder_ / "pid"));
  EXPECT_NE(kill(child, 0), 0) << "a process that ignores being asked is killed";
}

TEST_F(RunMeasured, StopsAtTheMemoryLimit) {
  const ProcessReport report =
      run("python3 -c 'import time; a = bytearray(400_000_000); time.sleep(300)'", {.seconds = 60, .memory_mb = 200});
  EXPECT_TRUE(report.out_of_memory);
  EXPECT_GT(report.peak_memory_mb, 200.0);
  EXPECT_THAT(report.outcome(), HasSubstr("the memory limit"));
}

TEST_F(RunMeasured, StopsWhatPrintsForEver) {
  const ProcessReport report = run("yes 'the same for ever'", {.seconds = 600});
  EXPECT_TRUE(report.out_of_log);
  EXPECT_FALSE(report.succeeded());
  EXPECT_EQ(report.outcome(), "stopped after it had printed 256 MB");
  EXPECT_EQ(std::filesystem::file_size(folder_ / "log"), 1U << 20);
}

TEST_F(RunMeasured, NothingSurvivesACommandThatEnds) {
  ASSERT_TRUE(run("sleep 300 & echo $! > pid").succeeded());
  EXPECT_NE(kill(std::stoi(tests::file_text(folder_ / "pid")), 0), 0);
}

TEST_F(RunMeasured, EndsItsCommandWhenItIsAskedToEnd) {
  std::thread asks([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    kill(getpid(), SIGTERM);
  });
  EXPECT_EQ(tests::refusal_of([this] { run("sleep 300"); }), "sleep 300: was stopped by a signal (Terminated)");
  asks.join();
}

}  // namespace
}  // namespace tileflight::jobs::process_test
