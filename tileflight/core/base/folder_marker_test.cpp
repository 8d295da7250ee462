#include "tileflight/core/base/folder_marker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::base::folder_marker_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

void make_file(const fs::path& file) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << "x";
}

TEST(FolderMarker, NamesTheCommandAndEveryFile) {
  const tests::TemporaryFolder folder;
  for (const char* name : {"b.txt", "a.txt", "images/000000.jpg", "images/000001.jpg", "images/000003.jpg"})
    make_file(folder / name);
  fs::create_directory(folder / "empty");
  fs::create_directory_symlink("images", folder / "link");
  write_folder_marker(folder.path(), "render");
  const auto marker = read_folder_marker(folder.path());
  ASSERT_TRUE(marker);
  EXPECT_EQ(marker->command, "render");
  EXPECT_THAT(marker->files,
              ElementsAre("a.txt", "b.txt", "images/000000.jpg", "images/000001.jpg", "images/000003.jpg", "link"));
}

TEST(FolderMarker, IsTheSameWheneverTheFilesAre) {
  const tests::TemporaryFolder folder;
  make_file(folder / "a.txt");
  write_folder_marker(folder.path(), "tile");
  const std::string first = read_text(folder / kFolderMarker);
  write_folder_marker(folder.path(), "tile");
  EXPECT_EQ(read_text(folder / kFolderMarker), first) << "it does not name itself";
}

TEST(FolderMarker, StaysSmallForManyFrames) {
  const tests::TemporaryFolder folder;
  fs::create_directory(folder / "images");
  for (int i = 0; i < 1200; ++i) {
    std::string digits = std::to_string(i);
    std::ofstream(folder / ("images/" + std::string(6 - digits.size(), '0') + digits + ".jpg")) << "x";
  }
  write_folder_marker(folder.path(), "render");
  EXPECT_LT(fs::file_size(folder / kFolderMarker), 300U);
  EXPECT_EQ(read_folder_marker(folder.path())->files, [&] {
    std::vector<std::string> files = list_files_recursive(folder.path());
    std::erase(files, kFolderMarker);
    return files;
  }());
}

TEST(FolderMarker, ReadsBackWhateverFilesAreCalled) {
  // Compares with the plain list of the folder, for names with digits, signs, control characters and invalid UTF-8.
  std::mt19937 random(7);
  const std::string letters = "0199#%.\t\n -_a\xC3\xFF";
  for (int round = 0; round < 60; ++round) {
    const tests::TemporaryFolder folder;
    for (int i = 0; i < 12; ++i) {
      std::string name;
      for (unsigned n = 1 + random() % 5; n > 0; --n) name += letters[random() % letters.size()];
      if (name == "." || name == "..") continue;
      make_file(folder / (random() % 3 == 0 ? "d/" + name : name));
    }
    const std::vector<std::string> files = list_files_recursive(folder.path());
    write_folder_marker(folder.path(), "odometry");
    EXPECT_EQ(read_folder_marker(folder.path())->files, files);
  }
}

TEST(FolderMarker, WhatIsNoneIsNone) {
  const tests::TemporaryFolder folder;
  EXPECT_FALSE(read_folder_marker(folder.path()));
  EXPECT_FALSE(read_folder_marker(folder / "absent"));
  for (const char* text : {"", "\n", "notes on tileflight\n", "tileflight x\na0\ta999999999\n"}) {
    write_file(folder / kFolderMarker, text);
    EXPECT_FALSE(read_folder_marker(folder.path())) << text;
  }
}

}  // namespace
}  // namespace tileflight::base::folder_marker_test
