#include "tileflight/tiles/fetch/http_cache_writer.h"

#include <utility>

namespace tileflight::fetch {

namespace {

constexpr std::size_t kMaxWaitingBytes = std::size_t{64} << 20;

}  // namespace

HttpCacheWriter::HttpCacheWriter(const HttpCache& cache)
    : cache_(cache.open_second_connection()), thread_([this] { run(); }) {}

HttpCacheWriter::~HttpCacheWriter() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void HttpCacheWriter::store(HttpCache::Entry entry) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_bytes_ <= kMaxWaitingBytes; });
  const auto before = waiting_.find(entry.key);
  if (before != waiting_.end()) waiting_bytes_ -= before->second.body.size();
  waiting_bytes_ += entry.body.size();
  std::string key = entry.key;
  waiting_.insert_or_assign(std::move(key), std::move(entry));
  changed_.notify_all();
}

void HttpCacheWriter::wait_for(const std::string& key) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !waiting_.contains(key) && !in_hand_.contains(key); });
}

void HttpCacheWriter::wait_for_all() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.empty() && in_hand_.empty(); });
}

void HttpCacheWriter::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    in_hand_.swap(waiting_);
    waiting_bytes_ = 0;
    lock.unlock();
    changed_.notify_all();  // the queue has room again
    std::vector<const HttpCache::Entry*> entries;
    for (const auto& [key, entry] : in_hand_) entries.push_back(&entry);
    cache_->store(entries);
    lock.lock();
    in_hand_.clear();
    changed_.notify_all();
  }
}

}  // namespace tileflight::fetch
