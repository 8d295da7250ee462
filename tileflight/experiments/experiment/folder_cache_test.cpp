#include "tileflight/experiments/experiment/folder_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::experiment::folder_cache_test {
namespace {

namespace fs = std::filesystem;

/// Makes truths as extract() does, each with its number.
class FolderCacheTest : public ::testing::Test {
 protected:
  FolderCache cache(bool refresh = false, const std::string& source = "here/tileset.json") const {
    return {folder_ / "cache", shared_truths(source), refresh, no_progress_};
  }
  FolderCache::Write extract() {
    return [this](const fs::path& to) {
      const base::OutputFolder output{.folder = to, .command = "extract", .replace = true};
      base::write_folder(output, [&](const fs::path& temporary) {
        fs::create_directories(temporary / "blocks/x0");
        base::write_file(temporary / "blocks/x0/surface.ply", "truth " + std::to_string(++made_));
        base::write_file(temporary / "extract.json", R"({"source": "here/tileset.json"})");
      });
    };
  }
  void get(const FolderCache& from, const std::string& key, const std::string& truth) {
    if (!from.take(key, folder_ / truth)) from.make(key, folder_ / truth, extract());
  }
  std::string content(const std::string& truth) const {
    return base::read_text(folder_ / truth / "blocks/x0/surface.ply");
  }
  ino_t inode(const std::string& file) const {
    struct stat status {};
    EXPECT_EQ(::stat((folder_ / file).c_str(), &status), 0);
    return status.st_ino;
  }

  tests::TemporaryFolder folder_;
  Progress no_progress_;
  std::atomic<int> made_ = 0;
};

TEST_F(FolderCacheTest, EqualTruthsAreMadeOnce) {
  get(cache(), "a", "run1");
  get(cache(), "a", "run2");
  EXPECT_EQ(made_, 1);
  EXPECT_EQ(inode("run1/blocks/x0/surface.ply"), inode("run2/blocks/x0/surface.ply")) << "no disk is taken twice";
  get(cache(), "b", "run3");
  EXPECT_EQ(made_, 2);
  get(cache(), "a", "run3");
  EXPECT_EQ(content("run3"), "truth 1") << "replaced";
  EXPECT_EQ(made_, 2);
  // Tiles of the same content elsewhere.
  get(cache(false, "there/tileset.json"), "a", "run4");
  EXPECT_EQ(made_, 2);
  const auto source = [&](const std::string& run) {
    return nlohmann::json::parse(base::read_text(folder_ / run / "extract.json"))["source"];
  };
  EXPECT_EQ(source("run4"), "there/tileset.json");
  EXPECT_EQ(source("run1"), "here/tileset.json");
}

TEST_F(FolderCacheTest, ABrokenEntryIsMadeAgain) {
  get(cache(), "a", "run1");
  const fs::path file = folder_ / "cache/a/blocks/x0/surface.ply";
  // Each leaves the runs as they are, but for a change in place, which is that of the run's file, too.
  fs::resize_file(file, 3);
  get(cache(), "a", "run2");
  EXPECT_EQ(content("run2"), "truth 2");
  fs::remove(file);
  get(cache(), "a", "run3");
  EXPECT_EQ(content("run3"), "truth 3");
  EXPECT_EQ(content("run2"), "truth 2");
  base::write_file(folder_ / "cache/a.json", "{");
  get(cache(), "a", "run4");
  fs::remove(folder_ / "cache/a.json");  // as a process leaves it that is killed before it is done
  get(cache(), "a", "run5");
  EXPECT_EQ(content("run5"), "truth 5");
  get(cache(true), "a", "run6");
  EXPECT_EQ(content("run6"), "truth 6") << "--force";
  get(cache(), "a", "run7");
  EXPECT_EQ(content("run7"), "truth 6");
  fs::remove_all(folder_ / "cache");
  EXPECT_EQ(content("run7"), "truth 6") << "the cache may be removed";
  get(cache(), "a", "run8");
  EXPECT_EQ(made_, 7);
  base::write_file(folder_ / "cache/a/notes", "mine");
  EXPECT_THAT(tests::refusal_of([this] { get(cache(), "a", "run9"); }),
              testing::HasSubstr("holds notes, which tileflight did not write"))
      << "nothing is lost that others put there";
}

TEST_F(FolderCacheTest, OthersWaitForTheOneThatMakesIt) {
  std::vector<std::jthread> runs;
  for (int i = 0; i < 4; ++i) runs.emplace_back([this, i] { get(cache(), "a", "run" + std::to_string(i)); });
  runs.clear();
  EXPECT_EQ(made_, 1);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(content("run" + std::to_string(i)), "truth 1");
}

TEST_F(FolderCacheTest, ABuiltInPlaceIsSharedAsItIs) {
  const FolderCache places(folder_ / "cache", shared_places(), false, no_progress_);
  const auto write = [this](const fs::path& to) {
    const base::OutputFolder output{.folder = to, .command = "scene", .replace = true};
    base::write_folder(output, [&](const fs::path& temporary) {
      base::write_file(temporary / "tileset.json", "place " + std::to_string(++made_));
    });
  };
  for (const std::string run : {"run1", "run2", "run1"}) {
    if (!places.take("p", folder_ / run)) places.make("p", folder_ / run, write);
    EXPECT_EQ(base::read_text(folder_ / run / "tileset.json"), "place 1");
  }
  EXPECT_EQ(inode("run1/tileset.json"), inode("run2/tileset.json"));
}

TEST_F(FolderCacheTest, WithoutAFolderEachRunHasItsOwn) {
  const FolderCache none({}, shared_truths("here"), false, no_progress_);
  get(none, "", "run1");
  get(none, "", "run2");
  EXPECT_EQ(made_, 2);
}

TEST_F(FolderCacheTest, AFailureLeavesNoEntry) {
  const auto fail = [](const fs::path&) { throw InputError("tiles", "are broken"); };
  EXPECT_EQ(tests::refusal_of([&] { cache().make("a", folder_ / "run1", fail); }), "tiles: are broken");
  EXPECT_FALSE(fs::exists(folder_ / "run1"));
  EXPECT_FALSE(cache().take("a", folder_ / "run1"));
  get(cache(), "a", "run1");
  EXPECT_EQ(content("run1"), "truth 1");
}

}  // namespace
}  // namespace tileflight::experiment::folder_cache_test
