#include "tileflight/tiles/fetch/http_cache_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>

#include "tests/temporary_folder.h"

namespace tileflight::fetch::http_cache_writer_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

HttpCache::Entry entry(const std::string& key, const std::string& text) {
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  return {key, {{{"etag", "\"" + key + "\""}}, 1000, false}, {bytes, bytes + text.size()}};
}

std::string text_in(HttpCache& cache, const std::string& key) {
  const auto body = cache.body(key);
  return body ? std::string(reinterpret_cast<const char*>(body->data()), body->size()) : "nothing";
}

TEST(HttpCacheWriter, EverythingIsStoredWhenItSaysSo) {
  const tests::TemporaryFolder folder;
  HttpCache cache(folder.path());
  HttpCacheWriter writer(cache);
  for (int i = 0; i < 300; ++i) writer.store(entry(std::to_string(i), "body " + std::to_string(i)));
  writer.wait_for("299");
  EXPECT_EQ(text_in(cache, "299"), "body 299");
  writer.wait_for_all();
  for (int i = 0; i < 300; ++i) EXPECT_EQ(text_in(cache, std::to_string(i)), "body " + std::to_string(i));
  EXPECT_EQ(cache.find("7")->headers.at("etag"), "\"7\"");
  EXPECT_EQ(cache.find("7")->fresh_until_s, 1000);
  EXPECT_THAT(writer.warnings(), IsEmpty());
}

TEST(HttpCacheWriter, TheLastOfOneNameStays) {
  const tests::TemporaryFolder folder;
  HttpCache cache(folder.path());
  HttpCacheWriter writer(cache);
  for (int i = 0; i < 50; ++i) writer.store(entry("same", std::to_string(i)));
  writer.wait_for("same");
  EXPECT_EQ(text_in(cache, "same"), "49");
}

TEST(HttpCacheWriter, StoresWhatIsLeftAtItsEnd) {
  const tests::TemporaryFolder folder;
  HttpCache cache(folder.path());
  {
    HttpCacheWriter writer(cache);
    for (int i = 0; i < 100; ++i) writer.store(entry(std::to_string(i), "x"));
  }
  for (int i = 0; i < 100; ++i) EXPECT_EQ(text_in(cache, std::to_string(i)), "x");
}

TEST(HttpCacheWriter, KeepsToTheBoundOfItsCache) {
  const tests::TemporaryFolder folder;
  HttpCache cache(folder.path(), {.max_bytes = 100'000});
  HttpCacheWriter writer(cache);
  for (int i = 0; i < 50; ++i) writer.store(entry(std::to_string(i), std::string(10'000, 'x')));
  writer.store(entry("huge", std::string(200'000, 'x')));
  writer.wait_for_all();
  EXPECT_LE(cache.bytes(), 100'000U);
  EXPECT_GE(cache.bytes(), 80'000U);
  EXPECT_EQ(text_in(cache, "huge"), "nothing");
}

TEST(HttpCacheWriter, DamageIsSetAsideWithAWarning) {
  const tests::TemporaryFolder folder;
  const std::string file = (folder / "http-1.sqlite").string();
  {
    HttpCache cache(folder.path());
    for (int i = 0; i < 50; ++i) cache.store(std::to_string(i), {}, entry("", std::string(10'000, 'x')).body);
  }
  sqlite3* database = nullptr;
  sqlite3_open(file.c_str(), &database);
  sqlite3_exec(database, "PRAGMA wal_checkpoint(TRUNCATE)", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  {
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    const auto size = static_cast<std::streamoff>(std::filesystem::file_size(file));
    for (std::streamoff at = 4096; at < size; at += 4096) {  // all pages but the first, which is read on opening
      stream.seekp(at);
      stream << std::string(64, '\xAA');
    }
  }
  const HttpCache cache(folder.path());
  HttpCacheWriter writer(cache);
  for (int i = 0; i < 20; ++i) writer.store(entry(std::to_string(i), "new"));
  writer.wait_for_all();
  std::vector<std::string> warnings = cache.warnings();  // whichever of the two finds the damage first
  for (const std::string& warning : writer.warnings()) warnings.push_back(warning);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("a new one was started")));
  HttpCache after(folder.path());
  EXPECT_EQ(text_in(after, "19"), "new");
}

}  // namespace
}  // namespace tileflight::fetch::http_cache_writer_test
