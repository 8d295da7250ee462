#include "tileflight/experiments/experiment/file_hash_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::experiment::file_hash_cache_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

void make_file(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

/// Sets a file's modification time one day back.
void make_old(const fs::path& file) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(24));
}

TEST(FileHashCache, OfAFileIsThatOfItsContent) {
  const tests::TemporaryFolder folder;
  make_file(folder / "a", "one");
  const FileHashCache hashes;
  EXPECT_EQ(hashes.hash(folder / "a"), base::sha256_hex("one"));
  make_file(folder / "a", "two");  // at once, of the same size
  EXPECT_EQ(hashes.hash(folder / "a"), base::sha256_hex("two"));
  EXPECT_THAT(tests::refusal_of([&] { hashes.hash(folder / "absent"); }), HasSubstr("no such file or folder"));
}

TEST(FileHashCache, ATouchChangesNothing) {
  const tests::TemporaryFolder folder;
  make_file(folder / "tiles/a.glb", "one");
  make_file(folder / "tiles/b/c.glb", "two");
  const FileHashCache hashes(folder / "memory");
  const std::string before = hashes.hash(folder / "tiles");
  for (const char* name : {"tiles/a.glb", "tiles/b/c.glb"}) make_old(folder / name);
  EXPECT_EQ(hashes.hash(folder / "tiles"), before);
  fs::copy(folder / "tiles", folder / "copy", fs::copy_options::recursive);
  EXPECT_EQ(hashes.hash(folder / "copy"), before) << "where it lies does not matter";
}

TEST(FileHashCache, AFolderIsItsFilesNamesAndContents) {
  const tests::TemporaryFolder folder;
  const FileHashCache hashes;
  const auto of = [&] { return hashes.hash(folder / "tiles"); };
  make_file(folder / "tiles/a", "one");
  make_file(folder / "tiles/b", "two");
  const std::string before = of();
  fs::rename(folder / "tiles/b", folder / "tiles/c");
  const std::string renamed = of();
  EXPECT_NE(renamed, before);
  make_file(folder / "tiles/c", "owt");
  EXPECT_NE(of(), renamed);
  fs::rename(folder / "tiles/c", folder / "tiles/b");
  make_file(folder / "tiles/b", "two");
  EXPECT_EQ(of(), before);
  make_file(folder / "tiles/d", "");
  EXPECT_NE(of(), before);
}

TEST(FileHashCache, LinksAreFollowedAndResultsLeftOut) {
  const tests::TemporaryFolder folder;
  const FileHashCache hashes;
  make_file(folder / "place/tileset.json", "{}");
  make_file(folder / "disk/a.glb", "one");
  fs::create_directory_symlink("../disk", folder / "place/tiles");
  fs::create_directory_symlink("..", folder / "disk/loop");
  const auto of = [&] { return hashes.hash(folder / "place", {folder / "place/out"}); };
  const std::string before = of();
  make_file(folder / "place/out/results.json", "left out by name");
  make_file(folder / "place/.git/index", "hidden");
  base::write_folder(base::OutputFolder{.folder = folder / "place/dataset", .command = "render"},
                     [](const fs::path& t) { make_file(t / "times.txt", "1"); });
  EXPECT_EQ(of(), before);
  base::write_folder(base::OutputFolder{.folder = folder / "place/block", .command = "tile"},
                     [](const fs::path& t) { make_file(t / "tileset.json", "{}"); });
  EXPECT_NE(of(), before) << "a tileset may be a part of it";
  fs::remove_all(folder / "place/block");
  make_file(folder / "disk/a.glb", "two");
  EXPECT_NE(of(), before);
}

/// A file whose change time is old enough for its hash to be cached.
void wait_until_settled() { std::this_thread::sleep_for(std::chrono::milliseconds(2100)); }

TEST(FileHashCache, WhatIsRememberedIsNotReadAgain) {
  const tests::TemporaryFolder folder;
  make_file(folder / "a", "one");
  const fs::path memory = folder / "memory";
  wait_until_settled();
  const FileHashCache first(memory);
  const std::string hash = first.hash(folder / "a");
  first.save();
  // The cached hash is used: a different hash is stored there to show it.
  std::string text = base::read_text(memory);
  ASSERT_THAT(text, HasSubstr(hash));
  const std::string mark(64, 'f');
  base::write_file(memory, text.replace(text.find(hash), 64, mark));
  EXPECT_EQ(FileHashCache(memory).hash(folder / "a"), mark);

  // A change that keeps size and modification time is still detected.
  const auto time = fs::last_write_time(folder / "a");
  make_file(folder / "a", "two");
  fs::last_write_time(folder / "a", time);
  EXPECT_EQ(FileHashCache(memory).hash(folder / "a"), base::sha256_hex("two"));
}

TEST(FileHashCache, WhatChangedJustNowIsNotRemembered) {
  const tests::TemporaryFolder folder;
  const fs::path memory = folder / "memory";
  for (int i = 0; i < 50; ++i) {  // many changes within the resolution of the file system's times
    make_file(folder / "a", std::to_string(100 + i));
    const FileHashCache hashes(memory);
    EXPECT_EQ(hashes.hash(folder / "a"), base::sha256_hex(std::to_string(100 + i)));
    hashes.save();
  }
}

TEST(FileHashCache, AMemoryOfRubbishIsNone) {
  const tests::TemporaryFolder folder;
  make_file(folder / "a", "one");
  for (const char* text : {"", "\n\n", "rubbish", "1 2 3 4 5 6\n", "\xff\xfe\x00", "aa bb cc dd ee ff\n"}) {
    make_file(folder / "memory", text);
    const FileHashCache hashes(folder / "memory");
    EXPECT_EQ(hashes.hash(folder / "a"), base::sha256_hex("one"));
    hashes.save();
  }
  const FileHashCache nowhere(folder / "no/such/folder/memory");
  EXPECT_EQ(nowhere.hash(folder / "a"), base::sha256_hex("one"));
  nowhere.save();
}

TEST(FileHashCache, OfWhatYamlSays) {
  const tests::TemporaryFolder folder;
  make_file(folder / "a.yaml", "camera: c.yaml\nfps: 10\n");
  make_file(folder / "b.yaml", "# the same\n{fps: 10.0, \"camera\": 'c.yaml'}\n");
  make_file(folder / "c.yaml", "camera: c.yaml\nfps: 11\n");
  EXPECT_EQ(FileHashCache::hash_yaml_content(folder / "a.yaml"), FileHashCache::hash_yaml_content(folder / "b.yaml"));
  EXPECT_NE(FileHashCache::hash_yaml_content(folder / "a.yaml"), FileHashCache::hash_yaml_content(folder / "c.yaml"));
}

}  // namespace
}  // namespace tileflight::experiment::file_hash_cache_test
