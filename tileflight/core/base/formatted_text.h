#pragma once

#include <string>

namespace tileflight::base {

/// The text that printf would print.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace tileflight::base
