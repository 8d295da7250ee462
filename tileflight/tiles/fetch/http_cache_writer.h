#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/tiles/fetch/http_cache.h"

namespace tileflight::fetch {

/// Stores responses in a cache on its own thread, all that have queued up in one transaction, so that reading and
/// decoding never wait for the database. If the process is killed, only entries not yet stored are lost.
class HttpCacheWriter {
 public:
  /// Opens its own connection to the database of `cache`.
  explicit HttpCacheWriter(const HttpCache& cache);
  HttpCacheWriter(const HttpCacheWriter&) = delete;
  HttpCacheWriter& operator=(const HttpCacheWriter&) = delete;
  /// Stores all queued entries first.
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
  Entries in_hand_;  ///< being stored
  std::size_t waiting_bytes_ = 0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace tileflight::fetch
