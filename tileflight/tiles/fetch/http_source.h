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

#include "tileflight/tiles/fetch/http_cache.h"
#include "tileflight/tiles/fetch/http_client.h"
#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/http_provider.h"
#include "tileflight/tiles/fetch/origin_policy.h"
#include "tileflight/tiles/fetch/tile_source.h"

namespace tileflight::fetch {

/// A tileset from the network. `read` fetches and waits; `prefetch` starts requests ahead of the readers. Each read
/// returns either the correct bytes or throws one InputError, in bounded time. With a cache, fresh entries are used
/// without a request and stale ones are revalidated (ETag, Last-Modified); if the server does not answer, a stale entry
/// is used with a warning, unless the server or the provider's terms forbid that.
class HttpSource : public TileSource {
 public:
  /// Resolves the root URL. Throws InputError if the provider cannot be opened. `cache`: may be nullptr; it is not used
  /// if the provider's terms forbid caching and `terms_accepted` is false.
  explicit HttpSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options = {},
                      std::unique_ptr<HttpCache> cache = nullptr, bool terms_accepted = false);
  ~HttpSource() override;

  std::string root_uri() const override { return root_uri_; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::string base_uri(const std::string& uri) const override;
  std::optional<std::uintmax_t> size(const std::string& /*uri*/) override { return std::nullopt; }
  bool knows_sizes() const override { return false; }
  bool prefetch(const std::vector<std::string>& uris) override;
  std::vector<std::string> attribution() const override { return provider_->attribution(); }
  TermsOfUse terms() const override { return provider_->terms(); }

  std::vector<std::string> warnings() const override;

 private:
  /// A completed request.
  struct FetchResult {
    HttpResult outcome;
    int generation = 0;  ///< generation of the credentials that were used
  };
  /// A URI that is being or has been prefetched.
  struct Prefetch {
    bool done = false;
    bool wanted = true;  ///< false: a later `prefetch` dropped it while it was running
    FetchResult result;
  };

  void require_allowed(const std::string& uri) const;
  HttpRequest make_request(const std::string& uri, bool conditional = true);
  FetchResult fetch(const std::string& uri, bool conditional = true);
  /// Takes a prefetched result; nullopt if the URI was not prefetched or its request has not started.
  std::optional<FetchResult> take_prefetched(const std::string& uri);
  void start_prefetches(std::unique_lock<std::mutex>& lock);
  void on_prefetch_done(const std::string& uri, HttpResult outcome);
  bool may_start_prefetch() const;

  /// Finds the metadata of a cache entry; nullopt if there is no entry or no cache.
  std::optional<CachedResponse> find_cached(const std::string& key);
  bool is_fresh_in_cache(const std::string& uri);
  std::vector<std::byte> process_result(const std::string& uri, FetchResult asked);
  std::vector<std::byte> fall_back_to_stale(const std::string& uri, const InputError& failure);
  std::vector<std::byte> process_not_modified(const std::string& uri, const HttpResponse& response);
  std::vector<std::byte> process_response(const std::string& uri, HttpResponse response);
  std::optional<std::vector<std::byte>> cached_body(const std::string& uri, const CachedResponse& cached);
  /// Notes where the redirects of a request ended, without secrets; empty: there were none.
  void note_redirect(const std::string& uri, const std::string& final_url);
  void store_in_cache(const std::string& uri, const HttpResponse& response);
  [[noreturn]] void throw_http_error(const std::string& uri, const HttpResponse& response) const;

  std::unique_ptr<HttpProvider> provider_;
  HttpSourceOptions options_;
  std::unique_ptr<HttpCache> cache_;         ///< nullptr: nothing is cached
  std::unique_ptr<HttpCacheWriter> writer_;  ///< writes to cache_
  std::unique_ptr<HttpClient> client_;
  bool may_use_stale_ = true;
  std::string root_uri_;
  std::unique_ptr<OriginPolicy> policy_;

  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  std::deque<std::string> prefetch_queue_;  ///< URIs to prefetch, in this order
  std::map<std::string, Prefetch> prefetches_;
  std::size_t under_way_ = 0;
  std::uintmax_t held_bytes_ = 0;
  std::uintmax_t largest_bytes_ = 0;
  std::map<std::string, std::string> redirected_;  ///< URIs and where their redirects ended, without secrets
  std::int64_t used_stale_ = 0;  ///< number of stale cache entries used because the server did not answer
};

}  // namespace tileflight::fetch
