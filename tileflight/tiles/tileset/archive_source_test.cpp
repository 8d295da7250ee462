#include "tileflight/tiles/fetch/archive_source.h"

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/hash.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tileset::archive_source_test {
namespace {

namespace fs = std::filesystem;
using base::test_support::error_of;
using base::test_support::to_bytes;
using base::test_support::to_text;
using fetch::test_support::ZipEntry;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// zlib's stream: -15 raw, 31 gzip.
std::string deflated(const std::string& text, int window_bits) {
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, window_bits, 9, Z_DEFAULT_STRATEGY);
  std::string out(compressBound(text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(out.size() - stream.avail_out);
  deflateEnd(&stream);
  return out;
}

std::string zstd(const std::string& text) {
  std::string out(ZSTD_compressBound(text.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), text.data(), text.size(), 3));
  return out;
}

std::string words(std::size_t count) {
  std::mt19937 random(7);
  std::string out;
  for (std::size_t i = 0; i < count; ++i) out += std::to_string(random() % 1000) + " tiles ";
  return out;
}

TEST(Unpack, GzipRoundTripAndBounds) {
  for (const std::size_t count : {0U, 1U, 10000U}) {
    const std::string text = words(count);
    const auto packed = base::test_support::to_bytes(deflated(text, 31));
    EXPECT_TRUE(base::is_gzip(packed));
    EXPECT_EQ(base::test_support::to_text(base::gunzip(packed, text.size(), "t")), text);
    if (!text.empty()) {
      EXPECT_THAT(base::test_support::error_of([&] { base::gunzip(packed, text.size() - 1, "t"); }),
                  HasSubstr("the limit"));
      EXPECT_THAT(
          base::test_support::error_of([&] { base::gunzip(std::span(packed).first(packed.size() / 2), 1 << 20, "t"); }),
          HasSubstr("truncated"));
    }
  }
  EXPECT_EQ(base::test_support::to_text(
                base::gunzip(base::test_support::to_bytes(deflated("ab", 31) + deflated("cd", 31)), 4, "t")),
            "abcd");
}

/// Zeros, a thousand times the size of their gzip: rejected at the limit, not after.
TEST(Unpack, ABombStopsAtTheLimit) {
  const auto bomb = base::test_support::to_bytes(deflated(std::string(std::size_t{1} << 26, '\0'), 31));
  EXPECT_LT(bomb.size(), 100000U);
  EXPECT_THAT(base::test_support::error_of([&] { base::gunzip(bomb, 1 << 20, "t"); }),
              HasSubstr("more than the limit of 1048576 bytes"));
  EXPECT_THAT(base::test_support::error_of([&] {
                base::decompress_zstd(base::test_support::to_bytes("(\xB5/\xFD"), std::size_t{1} << 40, "t");
              }),
              HasSubstr("declares"));
}

/// RFC 1321, appendix A.5.
TEST(Md5, TheVectorsOfItsRfc) {
  const auto hex = [](const std::string& text) {
    std::string out;
    for (const std::uint8_t byte : base::md5(text)) {
      char two[3];
      std::snprintf(two, sizeof two, "%02x", byte);
      out += two;
    }
    return out;
  };
  EXPECT_EQ(hex(""), "d41d8cd98f00b204e9800998ecf8427e");
  EXPECT_EQ(hex("message digest"), "f96b697d7cb7938d525a2f31aaf161d0");
  EXPECT_EQ(hex("12345678901234567890123456789012345678901234567890123456789012345678901234567890"),
            "57edf4a22be3c955ac49da2e2107b67a");
}

fetch::ZipArchive open(const std::string& zip, const fetch::ZipLimits& limits = {}) {
  return {[zip](std::uint64_t offset, std::size_t length) {
            return base::test_support::to_bytes(zip.substr(static_cast<std::size_t>(offset), length));
          },
          zip.size(), "a.3tz", limits};
}

/// An archive of these files with a correct index.
std::string indexed(std::vector<ZipEntry> entries) {
  std::vector<std::uint64_t> offsets;
  fetch::test_support::make_zip(entries, &offsets);
  std::vector<std::pair<std::pair<std::uint64_t, std::uint64_t>, std::uint64_t>> index;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto digest = base::md5(entries[i].path);
    std::pair<std::uint64_t, std::uint64_t> hash;
    std::memcpy(&hash.first, digest.data(), 8);
    std::memcpy(&hash.second, digest.data() + 8, 8);
    index.emplace_back(hash, offsets[i]);
  }
  std::sort(index.begin(), index.end());
  std::string bytes;
  for (const auto& [hash, offset] : index)
    bytes += base::test_support::to_raw_bytes<std::uint64_t>({hash.first, hash.second, offset});
  entries.push_back({"@3dtilesIndex1@", bytes});
  return fetch::test_support::make_zip(entries);
}

std::vector<ZipEntry> three_files() {
  const std::string text = words(3000);
  return {{"tileset.json", "{}"}, {"sub/a.b3dm", text, deflated(text, -15), 8}, {"b.glb", text, zstd(text), 93}};
}

TEST(ZipArchive, StoredDeflatedAndZstandard) {
  const fetch::ZipArchive archive = open(indexed(three_files()));
  EXPECT_THAT(archive.warnings(), IsEmpty());
  for (const ZipEntry& entry : three_files()) {
    EXPECT_EQ(base::test_support::to_text(archive.read(entry.path)), entry.content);
    EXPECT_EQ(archive.size(entry.path), entry.content.size());
  }
  EXPECT_THAT(base::test_support::error_of([&] { archive.read("c.glb"); }), HasSubstr("c.glb: is missing in a.3tz"));
}

TEST(ZipArchive, AnIndexThatMisleadsIsWarnedOfAndNotFollowed) {
  EXPECT_THAT(open(fetch::test_support::make_zip(three_files())).warnings(), ElementsAre(HasSubstr("no index")));
  std::string zip = indexed(three_files());
  const std::size_t at = zip.find("@3dtilesIndex1@") + 15 + 16;
  zip[at] = static_cast<char>(zip[at] + 1);
  // The index's own checksum must be correct; otherwise another fault (a damaged archive) is reported.
  EXPECT_THAT(base::test_support::error_of([&] { open(zip); }), HasSubstr("its checksum differs"));
  std::vector<ZipEntry> entries = three_files();
  entries.push_back({"@3dtilesIndex1@", std::string(72, '\x01')});
  const fetch::ZipArchive archive = open(fetch::test_support::make_zip(entries));
  EXPECT_THAT(archive.warnings(), ElementsAre(HasSubstr("does not point to")));
  EXPECT_EQ(base::test_support::to_text(archive.read("tileset.json")), "{}");
}

TEST(ZipArchive, FaultsAreNamed) {
  const std::string good = indexed(three_files());
  for (std::size_t length = 0; length < good.size(); length += 1 + good.size() / 40) {
    EXPECT_THAT(base::test_support::error_of([&] { open(good.substr(0, length)); }), HasSubstr("a.3tz")) << length;
  }
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "1"}, {"a", "2"}}));
              }),
              HasSubstr("contains 'a' twice"));
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "12", "12", 14}})).read("a");
              }),
              HasSubstr("method 14"));
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "12", "\xff\xff\xff", 8}})).read("a");
              }),
              HasSubstr("malformed"));
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "123", deflated("12", -15), 8}})).read("a");
              }),
              HasSubstr("fewer bytes"));
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "12"}}), {.max_file_bytes = 1}).read("a");
              }),
              HasSubstr("more than the limit of 1"));
  EXPECT_THAT(base::test_support::error_of([&] {
                open(fetch::test_support::make_zip({{"a", "12"}, {"b", "1"}}), {.max_entries = 1});
              }),
              HasSubstr("limit of 1"));
  std::string damaged = fetch::test_support::make_zip({{"a", "content"}});
  damaged[damaged.find("content")] = 'C';
  EXPECT_THAT(base::test_support::error_of([&] { open(damaged).read("a"); }), HasSubstr("its checksum differs"));
  std::mt19937 random(3);
  for (int i = 0; i < 150; ++i) {
    std::string broken = good;
    for (int k = 0; k < 3; ++k) broken[broken.size() - 1 - random() % 400] = static_cast<char>(random());
    EXPECT_THAT(base::test_support::error_of([&] {
                  const fetch::ZipArchive archive = open(broken);
                  for (const ZipEntry& entry : three_files()) archive.read(entry.path);
                }),
                ::testing::Not(HasSubstr("\n")));
  }
}

TEST(ArchiveSource, NoPathLeavesTheArchive) {
  EXPECT_EQ(fetch::path_in_archive("sub/a%20b.glb?v=1", "x"), "sub/a b.glb");
  for (const char* uri : {"../a", "/etc/passwd", "file:///etc/passwd", "http://host/a", "//host/a", "a/%2e%2e/../b",
                          "a/../../b", "..", "a/..", "%2Fa"}) {
    EXPECT_THAT(base::test_support::error_of([&] { fetch::path_in_archive(uri, "x.3tz"); }),
                HasSubstr("refers to a file outside the archive x.3tz"))
        << uri;
  }
}

class ArchiveFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("tileflight_archives_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }

  /// A database made by these statements; the blobs are bound to their parameters in order.
  fs::path database(const std::string& name, const std::vector<std::string>& statements,
                    const std::map<std::string, std::string>& media = {}) const {
    sqlite3* database = nullptr;
    sqlite3_open((folder_ / name).c_str(), &database);
    for (const std::string& sql : statements) {
      EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    }
    for (const auto& [key, content] : media) {
      sqlite3_stmt* insert = nullptr;
      sqlite3_prepare_v2(database, "INSERT INTO media VALUES (?1, ?2)", -1, &insert, nullptr);
      sqlite3_bind_text(insert, 1, key.c_str(), -1, SQLITE_TRANSIENT);
      sqlite3_bind_blob(insert, 2, content.data(), static_cast<int>(content.size()), SQLITE_TRANSIENT);
      EXPECT_EQ(sqlite3_step(insert), SQLITE_DONE);
      sqlite3_finalize(insert);
    }
    sqlite3_close(database);
    return folder_ / name;
  }

  static std::string tileset() {
    return fetch::test_support::tileset(
               fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, "sub/a.glb"))
        .dump();
  }

  fs::path folder_;
};

constexpr char kMedia[] = "CREATE TABLE media (key TEXT PRIMARY KEY, content BLOB)";

TEST_F(ArchiveFiles, OnePlaceInAFolderIn3tzAndIn3dtiles) {
  const std::string glb = fetch::test_support::triangle_glb();
  const fs::path zip = write("a.3tz", indexed({{"tileset.json", tileset()}, {"sub/a.glb", deflated(glb, 31)}}));
  const fs::path sqlite =
      database("a.3dtiles", {kMedia}, {{"tileset.json", deflated(tileset(), 31)}, {"sub/a.glb", glb}});
  fs::create_directories(folder_ / "sub");
  const fs::path plain = write("tileset.json", tileset());
  write("sub/a.glb", glb);
  const LoadedTiles expected = load_region(plain.string(), {});
  EXPECT_EQ(expected.triangles, 1);
  for (const fs::path& file : {zip, sqlite}) {
    const LoadedTiles tiles = load_region(file.string(), {});
    EXPECT_TRUE(tiles.complete);
    EXPECT_EQ(tiles.cut_hash, expected.cut_hash);
    EXPECT_EQ(tiles.meshes[0].mesh.vertices, expected.meshes[0].mesh.vertices);
    EXPECT_THAT(tiles.warnings, IsEmpty());
    EXPECT_GT(fetch::open_source(file.string())->size("sub/a.glb").value_or(0), 0U);
    EXPECT_FALSE(fetch::open_source(file.string())->size("b.glb").has_value());
  }
}

TEST_F(ArchiveFiles, WhatIsNoArchiveIsNamed) {
  EXPECT_THAT(base::test_support::error_of([&] { fetch::open_source(write("a.3tz", "nothing").string()); }),
              HasSubstr("no end record"));
  EXPECT_THAT(base::test_support::error_of([&] {
                fetch::open_source(write("b.3tz", fetch::test_support::make_zip({{"a", "1"}})).string());
              }),
              HasSubstr("no tileset.json"));
  EXPECT_THAT(base::test_support::error_of(
                  [&] { fetch::open_source(database("c.3dtiles", {"CREATE TABLE m (a TEXT)"}).string()); }),
              HasSubstr("no table 'media'"));
  EXPECT_THAT(base::test_support::error_of([&] { fetch::open_source(database("d.3dtiles", {kMedia}).string()); }),
              HasSubstr("no tileset.json"));
  EXPECT_THAT(base::test_support::error_of(
                  [&] { fetch::open_source(database("e.3dtiles", {"CREATE TABLE media (key TEXT)"}).string()); }),
              HasSubstr("no such column: content"));
  // A view could compute endlessly.
  EXPECT_THAT(
      base::test_support::error_of([&] {
        fetch::open_source(
            database("f.3dtiles", {"CREATE VIEW media AS SELECT 'tileset.json' AS key, 'x' AS content"}).string());
      }),
      HasSubstr("no table 'media'"));
  EXPECT_THAT(base::test_support::error_of(
                  [&] { fetch::open_source(write("g.3dtiles", "SQLite format 3" + std::string(900, '\7')).string()); }),
              HasSubstr("g.3dtiles"));
}

TEST(ArchiveSource, RealArchives) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/tools_specs");
  for (const char* stem : {"basicProcessing", "implicitProcessing"}) {
    const LoadedTiles expected = load_region((folder / "tilesetProcessing" / stem).string(), {});
    for (const char* ending : {".3tz", ".3dtiles"}) {
      const LoadedTiles tiles = load_region((folder / "tilesetProcessing" / (std::string(stem) + ending)).string(), {});
      EXPECT_EQ(tiles.cut_hash, expected.cut_hash) << stem << ending;
      EXPECT_EQ(tiles.triangles, expected.triangles);
      EXPECT_GT(tiles.triangles, 0);
      EXPECT_THAT(tiles.warnings, IsEmpty());
    }
  }
  int packages = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "packages")) {
    ++packages;
    const std::string name = entry.path().filename();
    const std::string message =
        base::test_support::error_of([&] { fetch::open_source(entry.path().string())->read("tileset.json"); });
    if (name.starts_with("valid.")) {
      EXPECT_EQ(message, "") << name;
    } else if (name.ends_with(".3tz")) {
      EXPECT_THAT(message, HasSubstr("no tileset.json")) << name;  // archives of an empty.json
    }
    EXPECT_THAT(message, ::testing::Not(HasSubstr("\n")));
  }
  EXPECT_GE(packages, 10);
}

TEST(ArchiveSource, ArchivesOfGzipFiles) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs/tilesets/packages");
  for (const char* name : {"validTilesetPackage.3tz", "validTilesetPackage.3dtiles", "validTilesetPackageZipped.3tz",
                           "validTilesetPackageZipped.3dtiles", "tilesetPackageWithWarnings.3tz"}) {
    EXPECT_EQ(load_region((folder / name).string(), {}).triangles, 1) << name;
  }
}

}  // namespace
}  // namespace tileflight::tileset::archive_source_test
