#include "tileflight/live/autopilot/udp_port.h"

#include <array>
#include <asio.hpp>

#include "tileflight/live/autopilot/socket_wait.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::autopilot {

struct UdpPort::Impl {
  asio::io_context network{1};
  asio::ip::udp::socket socket{network};
  asio::ip::udp::endpoint sender;
  std::array<char, 2048> buffer{};
};

UdpPort::UdpPort(const std::string& address, std::uint16_t port) : impl_(std::make_unique<Impl>()) {
  const asio::ip::udp::endpoint endpoint(listening_address(address), port);
  try {
    impl_->socket.open(endpoint.protocol());
    impl_->socket.bind(endpoint);
    impl_->socket.non_blocking(true);
  } catch (const asio::system_error& fault) {
    throw InputError("UDP port " + std::to_string(port) + " of " + address,
                     "cannot listen on it (" + fault.code().message() + "); choose another ControlPort");
  }
}

UdpPort::~UdpPort() = default;

std::uint16_t UdpPort::port() const { return impl_->socket.local_endpoint().port(); }

std::optional<std::string> UdpPort::receive(std::chrono::milliseconds patience) {
  if (!wait_readable(impl_->socket.native_handle(), patience)) return std::nullopt;
  asio::error_code fault;
  const std::size_t bytes = impl_->socket.receive_from(asio::buffer(impl_->buffer), impl_->sender, 0, fault);
  if (fault) return std::nullopt;
  return std::string(impl_->buffer.data(), bytes);
}

void UdpPort::answer(std::string_view bytes) {
  asio::error_code lost;
  impl_->socket.send_to(asio::buffer(bytes.data(), bytes.size()), impl_->sender, 0, lost);
}

}  // namespace tileflight::autopilot
