#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <optional>
#include <string_view>

namespace tileflight::tiles {

/// How often and when a request is tried again.
struct RetryOptions {
  int max_tries = 5;
  std::chrono::milliseconds first_wait{500};         ///< doubled with each further try
  std::chrono::milliseconds longest_wait{20'000};    ///< of the doubling
  std::chrono::milliseconds longest_asked{120'000};  ///< a server that asks for more (Retry-After) is given up on
};

/// Whether a status may be another one later: 408, 425, 429, 500, 502, 503, 504 (RFC 9110, section 15; RFC 6585, 8470).
bool is_worth_a_retry(long status);

/// How long a server asks to wait (RFC 9110, section 10.2.3): seconds, or a date, which is taken relative to `now`
/// (a date that has passed: 0). nullopt: it is neither.
std::optional<std::chrono::milliseconds> parse_retry_after(std::string_view text, std::time_t now);

/// Exponential backoff with jitter: before try `tries_done` + 1, a wait between half and all of
/// first_wait * 2^(tries_done - 1), at most longest_wait. `random`: any number; its lowest 32 bits choose within.
std::chrono::milliseconds backoff(const RetryOptions& options, int tries_done, std::uint64_t random);

}  // namespace tileflight::tiles
