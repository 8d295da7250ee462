#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/tiles/http_cache.h"

namespace tileflight::tiles {

/// Stores answers in a cache on a thread of its own, as many in one transaction as have come in meanwhile, so that who
/// reads and decodes waits for no database. What is not stored yet when a process is killed is lost, nothing else.
class HttpCacheWriter {
 public:
  /// Has a connection of its own to the database of `cache`.
  explicit HttpCacheWriter(const HttpCache& cache);
  HttpCacheWriter(const HttpCacheWriter&) = delete;
  HttpCacheWriter& operator=(const HttpCacheWriter&) = delete;
  /// Stores what is left.
  ~HttpCacheWriter();

  /// Soon; waits only where more than 64 MB have not been stored yet.
  void store(HttpCache::Entry entry);
  /// Returns when what was given under this name before is stored.
  void wait_for(const std::string& key);
  /// Returns when everything given before is stored.
  void wait_for_all();
  std::vector<std::string> warnings() const { return cache_->warnings(); }

 private:
  using Entries = std::map<std::string, HttpCache::Entry>;
  void run();

  std::unique_ptr<HttpCache> cache_;
  std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  Entries waiting_;
  Entries in_hand_;  ///< being stored
  std::size_t waiting_bytes_ = 0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace tileflight::tiles
