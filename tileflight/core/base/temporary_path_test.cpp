#include "tileflight/core/base/temporary_path.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::base::temporary_path_test {
namespace {

namespace fs = std::filesystem;

/// The id of a process that has ended.
pid_t ended_process() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

std::string name_for(pid_t process, const std::string& target = "out") {
  return "." + target + "." + std::to_string(process) + "-0.tmp";
}

TEST(TemporaryPath, IsNewAndBesideTheTarget) {
  tests::TemporaryFolder folder;
  const fs::path first = make_temporary_path(folder / "out");
  EXPECT_EQ(first.parent_path(), folder.path());
  std::ofstream(first) << "x";
  const fs::path second = make_temporary_path(folder / "out");
  EXPECT_NE(first, second);
  EXPECT_TRUE(fs::exists(first));
}

TEST(TemporaryPath, WhatAKilledRunLeftIsRemovedAndNothingElse) {
  tests::TemporaryFolder folder;
  const pid_t ended = ended_process();
  fs::create_directories(folder / name_for(ended) / "images");
  std::ofstream(folder / name_for(ended) / "images/000000.jpg") << "half";
  const std::string others[] = {name_for(::getppid()),
                                name_for(ended, "other"),
                                ".out.12x-0.tmp",
                                ".out.-0.tmp",
                                ".out." + std::to_string(ended) + "-.tmp",
                                ".out." + std::to_string(ended) + "-0.tmp.keep",
                                "out"};
  for (const std::string& other : others) std::ofstream(folder / other) << "mine";
  make_temporary_path(folder / "out");
  EXPECT_FALSE(fs::exists(folder / name_for(ended)));
  for (const std::string& other : others) EXPECT_TRUE(fs::exists(folder / other)) << other;
}

TEST(TemporaryPath, AKilledWriterOfAFolderIsClearedByTheNext) {
  tests::TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    write_folder(folder / "out", false, [](const fs::path& temporary) {
      std::ofstream(temporary / "half") << "half";
      ::_exit(9);
    });
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::is_empty(folder.path()));
  write_folder(folder / "out", false, [](const fs::path& temporary) { std::ofstream(temporary / "whole") << "whole"; });
  EXPECT_TRUE(fs::exists(folder / "out/whole"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace tileflight::base::temporary_path_test
