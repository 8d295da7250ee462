#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/tiles/http_retry.h"

namespace tileflight::tiles {

/// Bounds of every request, and how many run at once.
struct HttpOptions {
  int max_parallel = 48;
  std::chrono::milliseconds connect_timeout{10'000};
  /// A transfer that brings fewer than `stall_bytes` in this time is given up on (and tried again).
  std::chrono::milliseconds stall_timeout{30'000};
  std::int64_t stall_bytes = 1024;
  /// A request from its start to its end, with redirects, waits and further tries.
  std::chrono::milliseconds whole_timeout{300'000};
  /// Of one answer, unpacked. What a server announces is checked before anything is allocated.
  std::uintmax_t max_response_bytes = std::uintmax_t{1} << 30;
  int max_redirects = 5;
  RetryOptions retry;
  std::filesystem::path ca_file;  ///< certificates to trust (PEM); empty: the system's
  std::uint64_t jitter_seed = 1;
};

struct HttpSourceOptions {
  HttpOptions http;
  std::vector<std::string> allowed_hosts;  ///< beside the tileset's own (origin_policy.h)
  /// Of what has been fetched ahead and not been read yet; what is on its way is reckoned at the largest size so far.
  std::uintmax_t max_ahead_bytes = std::uintmax_t{256} << 20;
};

}  // namespace tileflight::tiles
