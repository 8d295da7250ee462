#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "tileflight/tiles/http_cache.h"
#include "tileflight/tiles/http_cache_writer.h"
#include "tileflight/tiles/http_client.h"
#include "tileflight/tiles/http_options.h"
#include "tileflight/tiles/http_provider.h"
#include "tileflight/tiles/origin_policy.h"
#include "tileflight/tiles/tile_source.h"

namespace tileflight::tiles {

/// A tileset from the network. `read` fetches and waits; with `prefetch`, requests run ahead of the readers. Each read
/// gives either the right bytes or one InputError, in bounded time. With a cache, what is fresh in it is not asked for,
/// and what is stale is asked about (ETag, Last-Modified); where the server gives no answer, what is stale is used with
/// a warning, unless its server or the provider's terms forbid that.
class HttpSource : public TileSource {
 public:
  /// Throws InputError where the provider cannot be opened.
  /// `cache`: nullptr: none. Left alone where the provider's terms forbid it and `terms_accepted` is false.
  explicit HttpSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options = {},
                      std::unique_ptr<HttpCache> cache = nullptr, bool terms_accepted = false);
  ~HttpSource() override;

  std::string root_uri() const override { return root_uri_; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& /*uri*/) override { return std::nullopt; }
  bool knows_sizes() const override { return false; }
  bool prefetch(const std::vector<std::string>& uris) override;
  std::vector<std::string> attribution() const override { return provider_->attribution(); }
  Terms terms() const override { return provider_->terms(); }

  std::vector<std::string> warnings() const override;

  /// Ends everything under way: who waits gets an InputError ("cancelled").
  void cancel();

 private:
  /// A request that was made out, and what came of it.
  struct Asked {
    HttpOutcome outcome;
    int generation = 0;  ///< of the credentials it was asked with
  };
  /// A URI that is fetched ahead.
  struct Ahead {
    bool done = false;
    bool wanted = true;  ///< false: dropped by a later `prefetch` while it was under way
    Asked asked;
  };

  HttpRequest request_for(const std::string& uri, bool conditional = true);
  Asked ask(const std::string& uri, bool conditional = true);
  /// What was fetched ahead; nullopt: nothing was, or not yet begun.
  std::optional<Asked> take_ahead(const std::string& uri);
  void start_ahead(std::unique_lock<std::mutex>& lock);
  void ahead_done(const std::string& uri, HttpOutcome outcome);
  bool may_start_ahead() const;

  /// nullopt: not there, or there is no cache.
  std::optional<CachedAnswer> find_cached(const std::string& key);
  bool is_fresh_in_cache(const std::string& uri);
  std::vector<std::byte> settle(const std::string& uri, Asked asked);
  std::vector<std::byte> settle_without_answer(const std::string& uri, const InputError& failure);
  std::vector<std::byte> settle_not_modified(const std::string& uri, const HttpResponse& response);
  std::vector<std::byte> settle_answer(const std::string& uri, HttpResponse response);
  void keep(const std::string& uri, const HttpResponse& response);
  [[noreturn]] void refuse(const std::string& uri, const HttpResponse& response) const;

  std::unique_ptr<HttpProvider> provider_;
  HttpSourceOptions options_;
  std::unique_ptr<HttpCache> cache_;         ///< nullptr: none
  std::unique_ptr<HttpCacheWriter> writer_;  ///< of it
  std::unique_ptr<HttpClient> client_;
  bool may_use_stale_ = true;
  std::string root_uri_;
  std::unique_ptr<OriginPolicy> policy_;

  mutable std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  std::deque<std::string> wanted_;  ///< to be fetched ahead, in this order
  std::map<std::string, Ahead> ahead_;
  std::size_t under_way_ = 0;
  std::uintmax_t held_bytes_ = 0;
  std::uintmax_t largest_bytes_ = 0;
  std::int64_t used_stale_ = 0;  ///< answers from the cache that the server could not be asked about
};

}  // namespace tileflight::tiles
