#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/cache_control.h"

struct sqlite3;

namespace tileflight::tiles {

struct HttpCacheOptions {
  std::uintmax_t max_bytes = std::uintmax_t{4} << 30;  ///< of what is kept; the least recently used goes first
  /// That an entry was used is noted when this long has passed since it was noted last.
  std::int64_t note_use_after_us = 60'000'000;
  /// Unix time in microseconds; empty: the system's clock.
  std::function<std::int64_t()> now_us;
};

/// What the cache knows of an answer beside its body.
struct CachedAnswer {
  HttpHeaders headers;
  std::int64_t fresh_until_s = 0;
  bool must_revalidate = false;
};

/// Answers of servers on disk: a SQLite database in WAL mode that several processes share, and that is sound after any
/// of them is killed. Entries are named by URLs without secrets; who stores is to see that none is in a body. A damaged
/// database is set aside and begun anew, with one warning; where it cannot be written at all, nothing is kept. Nothing
/// here throws but the constructor, for a folder that cannot be made. Safe from several threads at once.
class HttpCache {
 public:
  struct Entry {
    std::string key;
    CachedAnswer answer;
    std::vector<std::byte> body;
  };

  explicit HttpCache(const std::filesystem::path& folder, const HttpCacheOptions& options = {});
  HttpCache(const HttpCache&) = delete;
  HttpCache& operator=(const HttpCache&) = delete;
  ~HttpCache();

  std::optional<CachedAnswer> find(const std::string& key);
  /// nullopt where there is none, or where its bytes are not what was stored (it is dropped then).
  std::optional<std::vector<std::byte>> body(const std::string& key);
  /// Replaces what was there. What is larger than the whole cache may be is not kept.
  void store(const std::string& key, const CachedAnswer& answer, std::span<const std::byte> body);
  /// The same for several, in one transaction.
  void store(std::span<const Entry* const> entries);
  /// New headers for a body that has not changed.
  void refresh(const std::string& key, const CachedAnswer& answer);
  void remove(const std::string& key);

  /// A connection of its own to the same database, which does not wait for this one's.
  std::unique_ptr<HttpCache> another() const { return std::make_unique<HttpCache>(file_.parent_path(), options_); }

  std::uintmax_t bytes();
  /// Distinct.
  std::vector<std::string> warnings() const;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  class Statement;

  std::int64_t now_us() const;
  /// Runs `work` on the database; where that finds damage, on a new one.
  void run(const std::function<void(sqlite3*)>& work);
  void attempt(const std::function<void(sqlite3*)>& work);
  void open();
  void open_locked();
  void begin_anew();
  void warn_and_stop(const std::string& cause);
  void put(sqlite3* database, const std::string& key, const CachedAnswer& answer, std::span<const std::byte> body);
  void evict(sqlite3* database);

  std::filesystem::path file_;
  std::filesystem::path lock_file_;
  HttpCacheOptions options_;
  mutable std::mutex mutex_;  ///< of what follows; a connection serves one thread at a time
  std::unique_ptr<sqlite3, Close> database_;
  std::uint64_t inode_ = 0;  ///< of the file that was opened; another one means that another process has begun anew
  std::vector<std::string> warnings_;
};

}  // namespace tileflight::tiles
