#include "tileflight/tiles/fetch/tile_source.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::tile_source_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_text;
using ::testing::HasSubstr;

class FolderSourceTest : public ::testing::Test {
 protected:
  FolderSourceTest() {
    std::filesystem::create_directories(folder_ / "place" / "sub");
    write("secret", "secret");
    write("place/tileset.json", "root");
    write("place/sub/a b%.glb", "tile");
  }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }

  tests::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

TEST_F(FolderSourceTest, ReadsFilesByEscapedNames) {
  FolderSource source(folder_ / "place" / "tileset.json");
  EXPECT_EQ(source.root_uri(), "tileset.json");
  EXPECT_EQ(base::test_support::to_text(source.read("tileset.json?v=1")), "root");
  EXPECT_EQ(base::test_support::to_text(source.read("sub/a%20b%25.glb")), "tile");
  EXPECT_EQ(source.size("sub/a%20b%25.glb"), 4U);
  EXPECT_EQ(source.size("missing"), std::nullopt);
}

TEST_F(FolderSourceTest, NoPathLeavesTheFolder) {
  FolderSource source(folder_ / "place" / "tileset.json");
  for (const char* uri : {"../secret", "sub/../../secret", "%2e%2e/secret", "..%2fsecret", "/etc/passwd"}) {
    EXPECT_THAT(base::test_support::error_of([&] { source.read(uri); }),
                HasSubstr("a file outside the tileset's folder"))
        << uri;
    EXPECT_EQ(source.size(uri), std::nullopt) << uri;
  }
  for (const char* uri : {"file:///etc/passwd", "http://host/a.glb", "c:/a.glb"}) {
    EXPECT_THAT(base::test_support::error_of([&] { source.read(uri); }), HasSubstr("may refer only to files in it"))
        << uri;
  }
  EXPECT_THAT(base::test_support::error_of([&] { source.read("//host/a.glb"); }), HasSubstr("not to another host"));
}

TEST_F(FolderSourceTest, MayBeAllowedToLeave) {
  FolderSource source(folder_ / "place" / "tileset.json", {.allow_outside_folder = true});
  EXPECT_EQ(base::test_support::to_text(source.read("../secret")), "secret");
  EXPECT_EQ(base::test_support::to_text(source.read("file://" + (folder_ / "secret").string())), "secret");
}

TEST_F(FolderSourceTest, NamesWhatIsMissingOrNoFileOrTooLarge) {
  FolderSource source(folder_ / "place" / "tileset.json", {.max_file_bytes = 3});
  EXPECT_THAT(base::test_support::error_of([&] { source.read("sub/none.glb"); }),
              HasSubstr("sub/none.glb: is missing"));
  EXPECT_THAT(base::test_support::error_of([&] { source.read("sub"); }), HasSubstr("not a regular file"));
  EXPECT_THAT(base::test_support::error_of([&] { source.read("tileset.json"); }), HasSubstr("tileset.json"));
  mkfifo((folder_ / "place" / "pipe").c_str(), 0600);
  EXPECT_THAT(base::test_support::error_of([&] { source.read("pipe"); }), HasSubstr("not a regular file"));
}

TEST_F(FolderSourceTest, OpensFolderOrFile) {
  EXPECT_EQ(open_source((folder_ / "place").string())->root_uri(), "tileset.json");
  EXPECT_EQ(open_source((folder_ / "place" / "tileset.json").string())->root_uri(), "tileset.json");
  EXPECT_THAT(base::test_support::error_of([&] { open_source(folder_.string()); }), HasSubstr("no tileset.json"));
  EXPECT_THAT(base::test_support::error_of([&] { open_source((folder_ / "none").string()); }),
              HasSubstr("no such file"));
  EXPECT_THAT(base::test_support::error_of([&] { open_source("https://host/place.3dtiles"); }),
              HasSubstr("is not read over HTTP: download it first"));
}

TEST(ReadUri, DataUrisCarryTheirBytes) {
  test_support::MemorySource source;
  EXPECT_EQ(base::test_support::to_text(read_uri(source, "data:,abc")), "abc");
}

TEST(CountingSource, CountsTheBytesOfEachFileOnce) {
  test_support::MemorySource inner;
  inner.add("a", std::string("12345"));
  inner.add("b", std::string("123"));
  CountingSource source(inner);
  source.read("a");
  source.read("b");
  source.read("a");
  EXPECT_EQ(source.bytes(), 8);
}

}  // namespace
}  // namespace tileflight::fetch::tile_source_test
