#pragma once

#include <string_view>

namespace tileflight::rpc {

/// Whether a client's token is correct, in a time that depends only on the length of `presented`, so that timing
/// reveals nothing about partial matches.
bool equal_in_constant_time(std::string_view presented, std::string_view right);

}  // namespace tileflight::rpc
