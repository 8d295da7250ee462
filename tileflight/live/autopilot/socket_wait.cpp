#include "tileflight/live/autopilot/socket_wait.h"

#include <poll.h>

#include "tileflight/core/base/input_error.h"

namespace tileflight::autopilot {

asio::ip::address listening_address(const std::string& text) {
  if (text == "localhost") return asio::ip::address_v4::loopback();
  asio::error_code fault;
  const asio::ip::address address = asio::ip::make_address(text, fault);
  if (fault) throw InputError("address " + text, "is not an IPv4 or IPv6 address of this machine");
  return address;
}

bool wait_readable(int socket, std::chrono::milliseconds patience) {
  pollfd one{socket, POLLIN, 0};
  return ::poll(&one, 1, static_cast<int>(patience.count())) > 0;
}

}  // namespace tileflight::autopilot
