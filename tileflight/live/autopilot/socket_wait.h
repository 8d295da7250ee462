#pragma once

#include <asio.hpp>
#include <chrono>
#include <string>

namespace tileflight::autopilot {

/// The address to listen on. Throws InputError if it is none.
asio::ip::address listening_address(const std::string& text);

/// Whether a socket can be read (or has ended) before the time is over.
bool wait_readable(int socket, std::chrono::milliseconds patience);

}  // namespace tileflight::autopilot
