#include "tileflight/core/jobs/started_command.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <thread>

#include "tests/temporary_folder.h"

namespace tileflight::jobs::started_command_test {
namespace {

std::string wait_for_end(StartedCommand& command) {
  auto end = command.end();
  for (; !end; end = command.end()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  return *end;
}

TEST(StartedCommand, TellsHowItEndedAndWhatItPrintedLast) {
  const tests::TemporaryFolder folder;
  StartedCommand command("pwd > here; echo first; echo 'the last' >&2; echo; exit 4", folder.path(), folder / "log");
  EXPECT_EQ(wait_for_end(command), "exit status 4");
  EXPECT_EQ(command.last_line(), "the last");
  EXPECT_TRUE(std::filesystem::exists(folder / "here"));
  StartedCommand killed("kill -9 $$", folder.path(), folder / "log2");
  EXPECT_EQ(wait_for_end(killed), "killed by signal 9");
  EXPECT_EQ(killed.last_line(), "");
}

/// What a command has started goes with it, even what does not want to.
TEST(StartedCommand, LeavesNothingBehind) {
  const tests::TemporaryFolder folder;
  pid_t stubborn = 0;
  {
    const StartedCommand command(
        "sh -c 'trap \"\" TERM; echo $$ > pid; mv pid number; while :; do sleep 0.1; done' & wait", folder.path(),
        folder / "log");
    while (!(std::ifstream(folder / "number") >> stubborn)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(kill(stubborn, 0), 0);
  }
  EXPECT_NE(kill(stubborn, 0), 0);
}

}  // namespace
}  // namespace tileflight::jobs::started_command_test
