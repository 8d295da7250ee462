#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::fetch {

/// States how often and when a request is retried.
struct RetryOptions {
  int max_tries = 5;
  std::chrono::milliseconds initial_backoff{500};      ///< doubled with each further try
  std::chrono::milliseconds max_backoff{20'000};       ///< limit of the doubling
  std::chrono::milliseconds max_retry_after{120'000};  ///< fails if the server asks for more (Retry-After)
};

/// Limits of each request, and the number of parallel requests.
struct HttpOptions {
  int max_parallel = 48;
  std::chrono::milliseconds connect_timeout{10'000};
  /// A transfer that receives fewer than `stall_bytes` in this time is aborted (and retried).
  std::chrono::milliseconds stall_timeout{30'000};
  std::int64_t stall_bytes = 1024;
  /// Limit for a request from start to end, including redirects, waits and retries.
  std::chrono::milliseconds whole_timeout{300'000};
  /// Limit of one response, decompressed. Announced sizes are checked before allocation.
  std::uintmax_t max_response_bytes = std::uintmax_t{1} << 30;
  int max_redirects = 5;
  RetryOptions retry;
  std::filesystem::path ca_file;  ///< trusted certificates (PEM); empty: the system's
  std::uint64_t jitter_seed = 1;
};

/// Options of a network source.
struct HttpSourceOptions {
  HttpOptions http;
  std::vector<std::string> allowed_hosts;  ///< in addition to the tileset's own host (origin_policy.h)
  /// Limit for prefetched data not yet read; each running request is counted with the largest response so far.
  std::uintmax_t max_prefetch_bytes = std::uintmax_t{256} << 20;
};

/// Address of an S3-compatible object store and the keys to read it. The AWS tools take these from the environment.
struct S3Options {
  std::string endpoint_url;       ///< AWS_ENDPOINT_URL; empty: Amazon's endpoint of the region
  std::string region;             ///< AWS_REGION or AWS_DEFAULT_REGION; empty, with an endpoint: us-east-1
  std::string access_key_id;      ///< AWS_ACCESS_KEY_ID
  std::string secret_access_key;  ///< AWS_SECRET_ACCESS_KEY
  std::string session_token;      ///< AWS_SESSION_TOKEN; empty: the keys are permanent
};

}  // namespace tileflight::fetch
