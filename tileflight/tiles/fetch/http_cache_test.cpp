#include "tileflight/tiles/fetch/http_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::http_cache_test {
namespace {

namespace fs = std::filesystem;
using base::test_support::error_of;
using base::test_support::to_bytes;
using base::test_support::to_text;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const CachedResponse kAnswer = {{{"etag", "\"1\""}, {"x-other", "not kept"}}, 1000, true};

class HttpCacheTest : public ::testing::Test {
 protected:
  HttpCache open() { return HttpCache(folder_.path(), options_); }
  fs::path file() const { return folder_ / "http-1.sqlite"; }
  static std::string text(HttpCache& cache, const std::string& key) {
    const auto body = cache.body(key);
    return body ? base::test_support::to_text(*body) : "(none)";
  }
  /// Result of SQLite's own integrity check.
  std::string integrity() const {
    sqlite3* database = nullptr;
    sqlite3_open_v2(file().c_str(), &database, SQLITE_OPEN_READONLY, nullptr);
    std::string result;
    sqlite3_exec(
        database, "PRAGMA integrity_check",
        [](void* out, int, char** values, char**) {
          *static_cast<std::string*>(out) += values[0];
          return 0;
        },
        &result, nullptr);
    sqlite3_close(database);
    return result;
  }

  tests::TemporaryFolder folder_;
  std::int64_t now_us_ = 0;
  HttpCacheOptions options_ = {.touch_interval_us = 0, .now_us = [this] { return ++now_us_; }};
};

TEST_F(HttpCacheTest, KeepsAnswersAcrossOpenings) {
  {
    HttpCache cache = open();
    EXPECT_FALSE(cache.find("a"));
    EXPECT_EQ(text(cache, "a"), "(none)");
    cache.store("a", kAnswer, base::test_support::to_bytes("first"));
    cache.store("empty", kAnswer, {});
  }
  HttpCache cache = open();
  const auto found = cache.find("a");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->headers, (HttpHeaders{{"etag", "\"1\""}}));
  EXPECT_EQ(found->fresh_until_s, 1000);
  EXPECT_TRUE(found->must_revalidate);
  EXPECT_EQ(text(cache, "a"), "first");
  EXPECT_EQ(text(cache, "empty"), "");
  cache.store("a", {{}, 5, false}, base::test_support::to_bytes("second"));
  EXPECT_EQ(text(cache, "a"), "second");
  cache.refresh("a", {{{"etag", "\"2\""}}, 2000, false});
  EXPECT_EQ(cache.find("a")->headers.at("etag"), "\"2\"");
  EXPECT_EQ(cache.find("a")->fresh_until_s, 2000);
  EXPECT_EQ(text(cache, "a"), "second") << "the body stays";
  cache.remove("a");
  EXPECT_FALSE(cache.find("a"));
  EXPECT_THAT(cache.warnings(), IsEmpty());
  EXPECT_EQ(integrity(), "ok");
}

TEST_F(HttpCacheTest, TheLeastRecentlyUsedGoFirst) {
  options_.max_bytes = 3500;
  HttpCache cache = open();
  for (const char* key : {"a", "b", "c"})
    cache.store(key, kAnswer, base::test_support::to_bytes(std::string(1000, *key)));
  EXPECT_EQ(text(cache, "a"), std::string(1000, 'a')) << "used again";
  cache.store("d", kAnswer, base::test_support::to_bytes(std::string(1000, 'd')));
  EXPECT_TRUE(cache.find("a"));
  EXPECT_FALSE(cache.find("b"));
  EXPECT_TRUE(cache.find("c"));
  EXPECT_LE(cache.bytes(), 3500U);
  cache.store("huge", kAnswer, base::test_support::to_bytes(std::string(4000, 'x')));
  EXPECT_FALSE(cache.find("huge"));
  EXPECT_TRUE(cache.find("d")) << "what cannot stay drives nothing out";
}

TEST_F(HttpCacheTest, ItsFileStaysBounded) {
  options_.max_bytes = 200'000;
  HttpCache cache = open();
  for (int i = 0; i < 300; ++i)
    cache.store(std::to_string(i), kAnswer, base::test_support::to_bytes(std::string(10'000, 'x')));
  EXPECT_LE(cache.bytes(), 200'000U);
  EXPECT_GE(cache.bytes(), 180'000U);
  EXPECT_LE(fs::file_size(file()), 600'000U);
}

TEST_F(HttpCacheTest, UseIsNotedNowAndThenOnly) {
  options_.max_bytes = 2500;
  options_.touch_interval_us = 1'000'000;
  HttpCache cache = open();
  cache.store("a", kAnswer, base::test_support::to_bytes(std::string(1000, 'a')));
  cache.store("b", kAnswer, base::test_support::to_bytes(std::string(1000, 'b')));
  text(cache, "a");
  cache.store("c", kAnswer, base::test_support::to_bytes(std::string(1000, 'c')));
  EXPECT_FALSE(cache.find("a")) << "its use was noted too short a time ago";
}

TEST_F(HttpCacheTest, BytesThatHaveChangedOnDiskAreNotGivenOut) {
  {
    HttpCache cache = open();
    cache.store("a", kAnswer, base::test_support::to_bytes(std::string(50, 'a')));
  }
  sqlite3* database = nullptr;
  sqlite3_open(file().c_str(), &database);
  sqlite3_exec(database, "UPDATE entry SET body = CAST('changed' AS BLOB)", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  HttpCache cache = open();
  EXPECT_EQ(text(cache, "a"), "(none)");
  EXPECT_FALSE(cache.find("a"));
}

TEST_F(HttpCacheTest, WhatIsNoDatabaseIsSetAsideWithOneWarning) {
  std::ofstream(file()) << std::string(5000, 'x');
  HttpCache cache = open();
  cache.store("a", kAnswer, base::test_support::to_bytes("new"));
  EXPECT_EQ(text(cache, "a"), "new");
  EXPECT_THAT(cache.warnings(),
              ElementsAre(HasSubstr("the cache was damaged; it was renamed to http-1.sqlite.damaged")));
  EXPECT_EQ(fs::file_size(folder_ / "http-1.sqlite.damaged"), 5000U);
  EXPECT_EQ(integrity(), "ok");
}

TEST_F(HttpCacheTest, DamageWithinIsSetAsideWhenItIsMet) {
  {
    HttpCache cache = open();
    for (int i = 0; i < 50; ++i)
      cache.store(std::to_string(i), kAnswer, base::test_support::to_bytes(std::string(10'000, 'x')));
  }
  sqlite3* database = nullptr;
  sqlite3_open(file().c_str(), &database);
  sqlite3_exec(database, "PRAGMA wal_checkpoint(TRUNCATE)", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  const auto size = static_cast<std::streamoff>(fs::file_size(file()));
  ASSERT_GT(size, 400'000);
  std::fstream stream(file(), std::ios::in | std::ios::out | std::ios::binary);
  for (std::streamoff at = 4096; at < size; at += 4096) {  // all pages but the first, which is read on opening
    stream.seekp(at);
    stream << std::string(64, '\xAA');
  }
  stream.close();
  HttpCache cache = open();
  for (int i = 0; i < 50; ++i) cache.body(std::to_string(i));
  cache.store("a", kAnswer, base::test_support::to_bytes("new"));
  EXPECT_EQ(text(cache, "a"), "new");
  EXPECT_THAT(cache.warnings(), ElementsAre(HasSubstr("a new one was started")));
  EXPECT_EQ(integrity(), "ok");
}

TEST_F(HttpCacheTest, ATableOfAnotherShapeIsToldOnce) {
  sqlite3* database = nullptr;
  sqlite3_open(file().c_str(), &database);
  sqlite3_exec(database, "CREATE TABLE entry (other TEXT)", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  HttpCache cache = open();
  cache.store("a", kAnswer, base::test_support::to_bytes("new"));
  EXPECT_EQ(cache.warnings().size(), 1U);
  EXPECT_FALSE(cache.find("a"));
}

TEST_F(HttpCacheTest, APlaceThatCannotBeWrittenIsToldOnce) {
  EXPECT_THAT(base::test_support::error_of([] { HttpCache("/dev/null/cache"); }), HasSubstr("--no-cache"));
  fs::create_directories(file());  // a folder where the file should be
  HttpCache cache = open();
  cache.store("a", kAnswer, base::test_support::to_bytes("new"));
  EXPECT_EQ(text(cache, "a"), "(none)");
  EXPECT_THAT(cache.warnings(), ElementsAre(HasSubstr("continuing without it")));
}

TEST_F(HttpCacheTest, ThreadsShareIt) {
  HttpCache cache(folder_.path());
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 30; ++i) {
        const std::string key = std::to_string(t) + "/" + std::to_string(i);
        cache.store(key, kAnswer, base::test_support::to_bytes(key));
        wrong += text(cache, key) != key;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

/// The body that any process stores under a key.
std::string body_of(const std::string& key) { return std::string(20'000, key.back()) + key; }

/// Stores and reads in an endless loop.
[[noreturn]] void hammer(const fs::path& folder, int process) {
  HttpCache cache(folder, {.max_bytes = 1'000'000});
  for (int i = 0;; ++i) {
    const std::string key = "http://host/" + std::to_string((i * 7 + process * 13) % 100);
    const auto body = cache.body(key);
    if (body && base::test_support::to_text(*body) != body_of(key)) _exit(3);
    if (!body) cache.store(key, kAnswer, base::test_support::to_bytes(body_of(key)));
    if (!cache.warnings().empty()) _exit(4);
  }
}

TEST_F(HttpCacheTest, SeveralProcessesShareItAndKillingThemLeavesItSound) {
  for (int round = 0; round < 4; ++round) {
    std::vector<pid_t> children;
    for (int process = 0; process < 3; ++process) {
      const pid_t child = fork();
      if (child == 0) hammer(folder_.path(), process);
      ASSERT_GT(child, 0);
      children.push_back(child);
    }
    // Waits until there is something to corrupt.
    for (int i = 0; i < 1000 && (!fs::exists(file()) || fs::file_size(file()) < 100'000); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20 + 17 * round));
    for (const pid_t child : children) {
      int status = 0;
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      EXPECT_TRUE(WIFSIGNALED(status)) << "exit " << WEXITSTATUS(status) << ": 3 wrong bytes, 4 a warning";
    }
    HttpCache cache(folder_.path(), {.max_bytes = 1'000'000});
    int found = 0;
    for (int i = 0; i < 100; ++i) {
      const std::string key = "http://host/" + std::to_string(i);
      const auto body = cache.body(key);
      if (!body) continue;
      ++found;
      EXPECT_EQ(base::test_support::to_text(*body), body_of(key));
    }
    EXPECT_GT(found, 0);
    EXPECT_LE(cache.bytes(), 1'000'000U);
    EXPECT_THAT(cache.warnings(), IsEmpty());
    EXPECT_EQ(integrity(), "ok");
  }
}

}  // namespace
}  // namespace tileflight::fetch::http_cache_test

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
