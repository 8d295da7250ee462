#pragma once

#include <string_view>

namespace tileflight::rpc {

/// Whether a client's token is the right one, in a time that depends on the given one's length only, so that it tells
/// nothing of how much of a guess was right.
bool equal_in_constant_time(std::string_view given, std::string_view right);

}  // namespace tileflight::rpc
