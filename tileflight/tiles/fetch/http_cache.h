#pragma once

struct sqlite3;

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/tiles/fetch/cache_control.h"

namespace tileflight::fetch {

/// Limits of a cache, and its clock.
struct HttpCacheOptions {
  std::uintmax_t max_bytes = std::uintmax_t{4} << 30;  ///< limit of all entries; the least recently used goes first
  /// The time of last use of an entry is updated at most this often.
  std::int64_t touch_interval_us = 60'000'000;
  /// Returns the Unix time in microseconds; empty: the system clock.
  std::function<std::int64_t()> now_us;
};

/// Metadata that the cache stores with a response body.
struct CachedResponse {
  HttpHeaders headers;
  std::int64_t fresh_until_s = 0;
  bool must_revalidate = false;
};

/// Stores server responses on disk in a SQLite database in WAL mode. Several processes share it, and it stays
/// consistent if any of them is killed. Keys are URLs without secrets; callers must make sure that no body contains a
/// secret. A damaged database is set aside and replaced by a new one, with one warning. If the database cannot be
/// written at all, nothing is cached. Only the constructor throws, if the folder cannot be created. Thread safe.
class HttpCache {
 public:
  struct Entry {
    std::string key;
    CachedResponse response;
    std::vector<std::byte> body;
  };

  explicit HttpCache(const std::filesystem::path& folder, const HttpCacheOptions& options = {});
  HttpCache(const HttpCache&) = delete;
  HttpCache& operator=(const HttpCache&) = delete;
  ~HttpCache();

  /// Returns the metadata of an entry; nullopt if there is none.
  std::optional<CachedResponse> find(const std::string& key);
  /// Returns the body of an entry; nullopt if there is none, or if its bytes are damaged (it is then removed).
  std::optional<std::vector<std::byte>> body(const std::string& key);
  /// Stores an entry and replaces an existing one. A body larger than the whole cache is not stored.
  void store(const std::string& key, const CachedResponse& answer, std::span<const std::byte> body);
  /// Stores several entries in one transaction.
  void store(std::span<const Entry* const> entries);
  /// Updates the headers of an entry whose body has not changed.
  void refresh(const std::string& key, const CachedResponse& answer);
  void remove(const std::string& key);

  /// Opens a second connection to the same database, which does not wait for this one.
  std::unique_ptr<HttpCache> open_second_connection() const {
    return std::make_unique<HttpCache>(file_.parent_path(), options_);
  }

  /// Returns the size of all entries.
  std::uintmax_t bytes();
  /// Returns the warnings so far, each once.
  std::vector<std::string> warnings() const;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  class Statement;

  std::int64_t now_us() const;
  /// Runs `work` on the database, or on a new one if the database is damaged.
  void run(const std::function<void(sqlite3*)>& work);
  void attempt(const std::function<void(sqlite3*)>& work);
  void open();
  void open_locked();
  void begin_anew();
  void warn_and_stop(const std::string& cause);
  void put(sqlite3* database, const std::string& key, const CachedResponse& answer, std::span<const std::byte> body);
  void evict(sqlite3* database);

  std::filesystem::path file_;
  std::filesystem::path lock_file_;
  HttpCacheOptions options_;
  mutable std::mutex mutex_;  ///< guards the members below; a connection serves one thread at a time
  std::unique_ptr<sqlite3, Close> database_;
  std::uint64_t inode_ = 0;  ///< inode of the opened file; if it changes, another process has replaced the database
  std::vector<std::string> warnings_;
};

/// Stores responses in a cache on its own thread, so that reading and decoding never wait for the database. One
/// transaction stores all that have queued up. If the process is killed, only entries not yet stored are lost.
class HttpCacheWriter {
 public:
  /// Opens its own connection to the database of `cache`.
  explicit HttpCacheWriter(const HttpCache& cache);
  HttpCacheWriter(const HttpCacheWriter&) = delete;
  HttpCacheWriter& operator=(const HttpCacheWriter&) = delete;
  /// Stores all queued entries.
  ~HttpCacheWriter();

  /// Queues an entry; blocks only while more than 64 MB are queued.
  void store(HttpCache::Entry entry);
  /// Returns when all entries queued earlier under this key are stored.
  void wait_for(const std::string& key);
  /// Returns when all entries queued earlier are stored.
  void wait_for_all();
  std::vector<std::string> warnings() const { return cache_->warnings(); }

 private:
  using Entries = std::map<std::string, HttpCache::Entry>;
  void run();

  std::unique_ptr<HttpCache> cache_;
  std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  Entries waiting_;
  Entries in_hand_;  ///< entries that are being stored
  std::size_t waiting_bytes_ = 0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace tileflight::fetch
