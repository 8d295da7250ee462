#include "tileflight/core/base/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <random>
#include <thread>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::base::output_folder_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tests::refusal_of;

std::size_t entries_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

void make_file(const fs::path& file, const std::string& text = "x") {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

/// Writes `folder` as a command would, with these files.
void write(const fs::path& folder, const std::vector<std::string>& files, const std::vector<fs::path>& inputs = {}) {
  const OutputFolder output{.folder = folder, .command = "test", .replace = true, .inputs = inputs};
  write_folder(output, [&](const fs::path& temporary) {
    for (const std::string& file : files) make_file(temporary / file);
  });
}

TEST(WriteFolder, AppearsWholeOrNotAtAll) {
  const tests::TemporaryFolder folder;
  const fs::path target = folder / "a/b/out";
  EXPECT_THAT(
      [&] {
        write_folder(target, false, [&](const fs::path& temporary) {
          write_file(temporary / "f", "x");
          throw std::runtime_error("stopped");
        });
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("stopped")));
  EXPECT_EQ(entries_in(folder / "a/b"), 0U);
  write_folder(target, false, [&](const fs::path& temporary) {
    EXPECT_FALSE(fs::exists(target));
    write_file(temporary / "f", "x");
  });
  EXPECT_EQ(read_text(target / "f"), "x");
  EXPECT_EQ(entries_in(folder / "a/b"), 1U);
}

TEST(WriteFolder, ReplacesOnlyWhenAsked) {
  const tests::TemporaryFolder folder;
  const fs::path target = folder / "out";
  write_folder(target, false, [](const fs::path& temporary) { write_file(temporary / "old", "1"); });
  const auto fill = [](const fs::path& temporary) { write_file(temporary / "new", "2"); };
  EXPECT_THAT([&] { write_folder(target, false, fill); }, ThrowsMessage<InputError>(HasSubstr("exists already")));
  EXPECT_TRUE(fs::exists(target / "old"));
  write_folder(target, true, fill);
  EXPECT_FALSE(fs::exists(target / "old"));
  EXPECT_TRUE(fs::exists(target / "new"));
  EXPECT_EQ(entries_in(folder.path()), 1U);
}

TEST(WriteFolder, ATrailingSlashMeansTheSameFolder) {
  const tests::TemporaryFolder folder;
  write_folder(folder.path().string() + "/out/", false, [](const fs::path& t) { write_file(t / "f", "x"); });
  EXPECT_EQ(read_text(folder / "out/f"), "x");
  EXPECT_EQ(entries_in(folder.path()), 1U);
}

TEST(WriteFolder, NeverReplacesAFile) {
  const tests::TemporaryFolder folder;
  write_file(folder / "out", "precious");
  EXPECT_THAT([&] { write_folder(folder / "out", true, [](const fs::path&) {}); },
              ThrowsMessage<InputError>(HasSubstr("is not a folder")));
  EXPECT_EQ(read_text(folder / "out"), "precious");
}

TEST(WriteFolder, LeavesAMarkerWithWhatItWrote) {
  const tests::TemporaryFolder folder;
  write(folder / "out", {"a", "b/c"});
  const auto marker = read_folder_marker(folder / "out");
  ASSERT_TRUE(marker);
  EXPECT_EQ(marker->command, "test");
  EXPECT_EQ(marker->files, (std::vector<std::string>{"a", "b/c"}));
}

TEST(WriteFolder, NeverReplacesFilesOfOthers) {
  const tests::TemporaryFolder folder;
  for (const char* foreign : {"notes.txt", "b/notes.txt", ".hidden", "b/.tileflight"}) {
    write(folder / "out", {"a", "b/c"});
    make_file(folder / "out" / foreign, "mine");
    EXPECT_THAT(refusal_of([&] { write(folder / "out", {"new"}); }),
                HasSubstr("out: holds " + std::string(foreign) + ", which tileflight did not write"));
    EXPECT_EQ(read_text(folder / "out" / foreign), "mine");
    EXPECT_TRUE(fs::exists(folder / "out/b/c"));
    EXPECT_EQ(entries_in(folder.path()), 1U) << "nothing half written is left beside it";
    fs::remove(folder / "out" / foreign);
  }
  fs::create_symlink("/etc/passwd", folder / "out/link");
  EXPECT_THAT(refusal_of([&] { write(folder / "out", {"new"}); }), HasSubstr("holds link"));
}

TEST(WriteFolder, NeverReplacesAFolderThatItDoesNotKnow) {
  const tests::TemporaryFolder folder;
  make_file(folder / "out/thesis.tex");
  EXPECT_THAT(refusal_of([&] { write(folder / "out", {"new"}); }), HasSubstr("holds thesis.tex"));
  EXPECT_TRUE(fs::exists(folder / "out/thesis.tex"));
  // An empty folder has nothing to lose.
  fs::create_directories(folder / "empty/below");
  write(folder / "empty", {"new"});
  EXPECT_TRUE(fs::exists(folder / "empty/new"));
}

TEST(WriteFolder, NeverReplacesAnInputByWhateverNameItGoes) {
  const tests::TemporaryFolder folder;
  const fs::path out = folder / "a/out";
  write(out, {"data", "sub/data"});
  fs::create_directory_symlink("a", folder / "link");
  fs::create_directory_symlink("out", folder / "a/alias");
  fs::create_hard_link(out / "data", folder / "hard");
  const auto refuses = [&](const fs::path& target, const fs::path& input) {
    const std::string refusal = refusal_of([&] { write(target, {"new"}, {input}); });
    EXPECT_THAT(refusal, HasSubstr("an input of this command")) << target << " " << input;
    EXPECT_TRUE(fs::exists(out / "data")) << target << " " << input;
  };
  refuses(out, out);
  refuses(out.string() + "/", out);
  refuses(out, out / "sub/data");
  refuses(out, folder / "link/out/data");
  refuses(folder / "link/out", out);
  refuses(folder / "a/alias", out / "sub");
  refuses(folder / "a/../link/out/sub/..", out);
  write(folder / "a/other", {"x"});
  write(folder / "a/other", {"y"}, {out, folder / "absent", ""});
  EXPECT_TRUE(fs::exists(folder / "a/other/y"));
  EXPECT_TRUE(fs::exists(out / "data"));
}

TEST(WriteFolder, AParentOrAPartOfAnInputStays) {
  const tests::TemporaryFolder folder;
  write(folder / "data", {"images/000000.jpg", "times.txt"});
  // A parent folder also holds files that the command did not write.
  EXPECT_THAT(refusal_of([&] { write(folder.path(), {"new"}, {folder / "data"}); }),
              HasSubstr("an input of this command"));
  EXPECT_THAT(refusal_of([&] { write(folder / "data/images", {"new"}, {folder / "data"}); }), HasSubstr("is part of "));
  EXPECT_TRUE(fs::exists(folder / "data/images/000000.jpg"));
  // Results that a command wrote into its input folder are not part of the input.
  write(folder / "data/results", {"a"}, {folder / "data"});
  write(folder / "data/results", {"b"}, {folder / "data"});
  EXPECT_TRUE(fs::exists(folder / "data/results/b"));
  // However, a tileset may be part of a tileset of tilesets.
  write(folder / "place", {"tileset.json"});
  write(folder / "place/block", {"tileset.json"});
  EXPECT_THAT(refusal_of([&] { write(folder / "place/block", {"new"}, {folder / "place"}); }),
              HasSubstr("is part of "));
}

TEST(WriteFolder, WithoutForceSaysWhatKeepsItFromBeingReplaced) {
  const tests::TemporaryFolder folder;
  write(folder / "out", {"a"});
  OutputFolder output{.folder = folder / "out", .command = "test", .replace = false};
  EXPECT_THAT(refusal_of([&] { require_writable(output); }), HasSubstr("exists already; --force replaces it"));
  make_file(folder / "out/notes.txt");
  EXPECT_THAT(refusal_of([&] { require_writable(output); }), HasSubstr("exists already and holds notes.txt"));
}

TEST(WriteFolder, ALinkToAFolderStaysALink) {
  const tests::TemporaryFolder folder;
  fs::create_directories(folder / "disk");
  fs::create_directory_symlink("disk", folder / "out");
  write(folder / "out", {"a"});
  write(folder / "out", {"b"});
  EXPECT_TRUE(fs::is_symlink(folder / "out"));
  EXPECT_TRUE(fs::exists(folder / "disk/b"));
  EXPECT_FALSE(fs::exists(folder / "disk/a"));
}

TEST(WriteFolder, FilesOfOthersThatCameMeanwhileAreMovedAside) {
  const tests::TemporaryFolder folder;
  write(folder / "out", {"a"});
  const OutputFolder output{.folder = folder / "out", .command = "test", .replace = true};
  const std::string refusal = refusal_of([&] {
    write_folder(output, [&](const fs::path& temporary) {
      make_file(temporary / "b");
      make_file(folder / "out/notes.txt", "mine");
    });
  });
  EXPECT_THAT(refusal, HasSubstr("was written, but the folder of that name holds notes.txt"));
  EXPECT_THAT(refusal, HasSubstr("that folder was renamed to " + (folder / "out.before").string()));
  EXPECT_TRUE(fs::exists(folder / "out/b"));
  EXPECT_EQ(read_text(folder / "out.before/notes.txt"), "mine");

  const OutputFolder fresh{.folder = folder / "new", .command = "test", .replace = false};
  EXPECT_THAT(refusal_of([&] {
                write_folder(fresh, [&](const fs::path& temporary) {
                  make_file(temporary / "b");
                  make_file(folder / "new/of-another-process");
                });
              }),
              HasSubstr("was created while the command ran"));
  EXPECT_TRUE(fs::exists(folder / "new/b"));
  EXPECT_TRUE(fs::exists(folder / "new.before/of-another-process"));
}

/// The id of a process that has ended.
pid_t ended_process() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

TEST(WriteFolder, PutsBackWhatAProcessKilledBetweenTwoRenamesLeft) {
  const tests::TemporaryFolder folder;
  const std::string of_the_dead = ".out." + std::to_string(ended_process());
  write(folder / (of_the_dead + "-1.old"), {"whole"});
  make_file(folder / (of_the_dead + "-0.tmp") / "whole too");
  const OutputFolder output{.folder = folder / "out", .command = "test", .replace = false};
  EXPECT_THAT(refusal_of([&] { require_writable(output); }), HasSubstr("exists already"));
  EXPECT_TRUE(fs::exists(folder / "out/whole"));
  write(folder / "out", {"new"});
  EXPECT_EQ(entries_in(folder.path()), 1U);

  // Killed after both renames: the new folder is in place, and the leftover old one does no harm.
  write(folder / (of_the_dead + "-2.old"), {"old"});
  write(folder / "out", {"newer"});
  EXPECT_TRUE(fs::exists(folder / "out/newer"));
  EXPECT_EQ(entries_in(folder.path()), 1U);
  // A backup made by a running process is left alone.
  write(folder / (".out." + std::to_string(::getppid()) + "-0.old"), {"old"});
  write(folder / "out", {"newest"});
  EXPECT_EQ(entries_in(folder.path()), 2U);
}

TEST(WriteFolder, IsOldOrNewAtWhateverMomentTheProcessIsKilled) {
  const tests::TemporaryFolder folder;
  const fs::path out = folder / "out";
  const auto write_version = [&](int version) {
    const std::string name = "version-" + std::to_string(version);
    write(out, {name, "images/000000.jpg", "images/000001.jpg"});
  };
  write_version(0);
  for (int round = 0; round < 40; ++round) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (int version = 1;; ++version) write_version(version);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(1500 + 137 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    ASSERT_TRUE(fs::exists(out / "images/000001.jpg")) << round;
    EXPECT_FALSE(find_foreign_file(out)) << *find_foreign_file(out);
    EXPECT_EQ(read_folder_marker(out)->files.size() + 1, list_files_recursive(out).size());
  }
  write_version(-1);
  EXPECT_EQ(entries_in(folder.path()), 1U) << "the last one clears away what the others left";
}

TEST(RemoveOutput, TakesOursAlone) {
  const tests::TemporaryFolder folder;
  write(folder / "out", {"a"});
  make_file(folder / "metrics.json");
  remove_output(folder / "out");
  remove_output(folder / "metrics.json");
  remove_output(folder / "absent");
  EXPECT_EQ(entries_in(folder.path()), 0U);
  write(folder / "out", {"a"});
  make_file(folder / "out/notes.txt");
  EXPECT_THAT(refusal_of([&] { remove_output(folder / "out"); }), HasSubstr("holds notes.txt"));
  EXPECT_TRUE(fs::exists(folder / "out/a"));
}

TEST(PrepareOutputFile, RefusesFilesThatAreRead) {
  const tests::TemporaryFolder folder;
  write(folder / "data", {"map.ply", "times.txt"});
  make_file(folder / "foreign/map.ply");
  make_file(folder / "cloud.ply");
  fs::create_symlink("cloud.ply", folder / "link.ply");
  fs::create_hard_link(folder / "cloud.ply", folder / "hard.ply");
  const std::vector<fs::path> inputs{folder / "cloud.ply", folder / "data", folder / "foreign", folder / "absent", ""};
  for (const char* name : {"cloud.ply", "link.ply", "hard.ply", "foreign/../cloud.ply"})
    EXPECT_THAT(refusal_of([&] { prepare_output_file(folder / name, inputs); }),
                HasSubstr("is also an input of this command"));
  for (const char* name : {"data/map.ply", "data/../data/times.txt", "foreign/map.ply"})
    EXPECT_THAT(refusal_of([&] { prepare_output_file(folder / name, inputs); }), HasSubstr("an input of this command"));
  make_file(folder / "data/transform.json");
  for (const char* name : {"new.json", "data/new.json", "foreign/new.json", "data/transform.json"})
    EXPECT_EQ(refusal_of([&] { prepare_output_file(folder / name, inputs); }), "no error") << name;
}

TEST(PrepareOutputFile, MakesTheFolderBeforeTheWork) {
  const tests::TemporaryFolder folder;
  prepare_output_file(folder / "out/deep/transform.json", {});
  EXPECT_TRUE(fs::is_directory(folder / "out/deep"));
  prepare_output_file("transform.json", {});
  make_file(folder / "file");
  EXPECT_THAT(refusal_of([&] { prepare_output_file(folder / "file/below/transform.json", {}); }),
              HasSubstr("cannot be made"));
}

TEST(Matches, DigitsAndStars) {
  EXPECT_TRUE(matches_pattern("images/000012.jpg", "images/######.jpg"));
  EXPECT_FALSE(matches_pattern("images/00012.jpg", "images/######.jpg"));
  EXPECT_FALSE(matches_pattern("images/00001a.jpg", "images/######.jpg"));
  EXPECT_TRUE(matches_pattern("tiles/0-1.glb", "tiles/*.glb"));
  EXPECT_TRUE(matches_pattern("tiles/.glb", "tiles/*.glb"));
  EXPECT_FALSE(matches_pattern("tiles/a/b.glb", "tiles/*.glb"));
  EXPECT_FALSE(matches_pattern("tiles/0-1.glb.txt", "tiles/*.glb"));
  EXPECT_TRUE(matches_pattern("", ""));
  EXPECT_FALSE(matches_pattern("", "#"));
}

}  // namespace
}  // namespace tileflight::base::output_folder_test

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
