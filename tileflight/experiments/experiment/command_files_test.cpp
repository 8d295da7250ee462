#include "tileflight/experiments/experiment/command_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

#include "tests/temporary_folder.h"

namespace tileflight::experiment::command_files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CommandFiles : public ::testing::Test {
 protected:
  CommandFiles() : path_(::getenv("PATH")) {
    for (const char* folder : {"bin", "here/tools", "elsewhere"}) fs::create_directories(folder_ / folder);
    for (const char* file :
         {"bin/slam", "bin/data.txt", "here/run.sh", "here/tools/with blank.py", "here/slam.yaml", "elsewhere/x"})
      std::ofstream(folder_ / file) << "x";
    fs::permissions(folder_ / "bin/slam", fs::perms::owner_all);
    ::setenv("PATH", ("/nowhere:" + (folder_ / "bin").string()).c_str(), 1);
  }
  ~CommandFiles() override { ::setenv("PATH", path_.c_str(), 1); }

  std::vector<std::string> of(const std::string& command) const {
    std::vector<std::string> names;
    for (const fs::path& file : find_command_files(command, folder_ / "here"))
      names.push_back(file.lexically_relative(folder_.path()).string());
    return names;
  }

  std::string path_;
  tests::TemporaryFolder folder_;
};

TEST_F(CommandFiles, BesideTheExperimentAndInPath) {
  EXPECT_THAT(of("./run.sh {dataset} {out}"), ElementsAre("here/run.sh"));
  EXPECT_THAT(of("slam run.sh"), ElementsAre("bin/slam", "here/run.sh"));
  EXPECT_THAT(of("slam --config=slam.yaml && CONFIG=../elsewhere/x slam"),
              ElementsAre("bin/slam", "here/slam.yaml", "elsewhere/x"));
  EXPECT_THAT(of((folder_ / "elsewhere/x").string() + " > {out}/log"), ElementsAre("elsewhere/x"));
}

TEST_F(CommandFiles, WordsAreThoseOfAShell) {
  EXPECT_THAT(of("\"tools/with blank.py\"|cat"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("tools/with\\ blank.py;"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("'tools'/'with blank.py'"), ElementsAre("here/tools/with blank.py"));
  EXPECT_THAT(of("(cat<slam.yaml)"), ElementsAre("here/slam.yaml"));
}

TEST_F(CommandFiles, FoldersAndWhatIsNotThereAreNone) {
  EXPECT_THAT(of("tools data.txt nothing ./slam '' \\"), IsEmpty()) << "data.txt of PATH is no program";
  EXPECT_THAT(of(""), IsEmpty());
  ::setenv("HOME", (folder_ / "here").c_str(), 1);
  EXPECT_THAT(of("~/run.sh"), ElementsAre("here/run.sh"));
}

}  // namespace
}  // namespace tileflight::experiment::command_files_test
