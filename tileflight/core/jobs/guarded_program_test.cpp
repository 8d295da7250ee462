#include "tileflight/core/jobs/guarded_program.h"

#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/build_folder.h"

namespace tileflight::jobs::guarded_program_test {
namespace {

namespace fs = std::filesystem;

void wait_until(const std::function<bool()>& holds) {
  for (int i = 0; i < 6000 && !holds(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(holds());
}

TEST(RunGuarded, ReturnsHowTheProgramEnded) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(run_guarded({"sh", "-c", "pwd > here; echo out; echo err >&2; exit 4"}, folder.path(), folder / "log"), 4);
  EXPECT_TRUE(fs::exists(folder / "here"));
  EXPECT_EQ(fs::file_size(folder / "log"), 8U);
  EXPECT_EQ(run_guarded({"sh", "-c", "kill -9 $$"}, folder.path(), folder / "log"), 128 + SIGKILL);
  EXPECT_EQ(run_guarded({"no-such-program"}, folder.path(), folder / "log"), 127);
}

/// A process that is killed in the middle of run_guarded(), with a lock on `folder`.
class Killed {
 public:
  Killed(const fs::path& folder, const std::string& script, const Patience& patience = {}) {
    process_ = fork();
    if (process_ != 0) return;
    const FolderLock lock(folder);
    run_guarded({"sh", "-c", script}, folder, folder / "log", patience);
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

}  // namespace
}  // namespace tileflight::jobs::guarded_program_test
