#include "tileflight/live/autopilot/ports.h"

#include <poll.h>

#include <array>
#include <asio.hpp>
#include <optional>

#include "tileflight/core/base/input_error.h"

namespace tileflight::autopilot {
namespace {

/// Parses the address to listen on. Throws InputError if it is none.
asio::ip::address listening_address(const std::string& text) {
  if (text == "localhost") return asio::ip::address_v4::loopback();
  asio::error_code fault;
  const asio::ip::address address = asio::ip::make_address(text, fault);
  if (fault) throw InputError("address " + text, "is not an IPv4 or IPv6 address of this machine");
  return address;
}

/// Waits until a socket can be read or has ended. Returns false if the time is over first.
bool wait_readable(int socket, std::chrono::milliseconds patience) {
  pollfd one{socket, POLLIN, 0};
  return ::poll(&one, 1, static_cast<int>(patience.count())) > 0;
}

}  // namespace

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

namespace {

constexpr int kMaxUnread_ms = 1000;
constexpr std::size_t kChunk_bytes = std::size_t{64} << 10U;

}  // namespace

struct TcpPort::Impl {
  asio::io_context network{1};
  asio::ip::tcp::acceptor acceptor{network};
  std::optional<asio::ip::tcp::socket> peer;
};

TcpPort::TcpPort(const std::string& address, std::uint16_t port) : impl_(std::make_unique<Impl>()) {
  const asio::ip::tcp::endpoint endpoint(listening_address(address), port);
  try {
    impl_->acceptor.open(endpoint.protocol());
    impl_->acceptor.set_option(asio::socket_base::reuse_address(true));
    impl_->acceptor.bind(endpoint);
    impl_->acceptor.listen();
    impl_->acceptor.non_blocking(true);
  } catch (const asio::system_error& fault) {
    throw InputError("TCP port " + std::to_string(port) + " of " + address,
                     "cannot listen on it (" + fault.code().message() + "); choose another TcpPort");
  }
}

TcpPort::~TcpPort() = default;

std::uint16_t TcpPort::port() const { return impl_->acceptor.local_endpoint().port(); }

bool TcpPort::connected() const { return impl_->peer.has_value(); }

bool TcpPort::accept(std::chrono::milliseconds patience) {
  impl_->peer.reset();
  if (!wait_readable(impl_->acceptor.native_handle(), patience)) return false;
  asio::error_code fault;
  asio::ip::tcp::socket peer(impl_->network);
  impl_->acceptor.accept(peer, fault);
  if (!fault) peer.set_option(asio::ip::tcp::no_delay(true), fault);
  if (!fault) peer.non_blocking(true, fault);
  if (fault) return false;  // it has gone again
  impl_->peer = std::move(peer);
  return true;
}

std::string TcpPort::receive(std::chrono::milliseconds patience) {
  if (!impl_->peer || !wait_readable(impl_->peer->native_handle(), patience)) return {};
  std::string bytes(kChunk_bytes, '\0');
  asio::error_code fault;
  const std::size_t got = impl_->peer->read_some(asio::buffer(bytes), fault);
  if (fault && fault != asio::error::would_block) impl_->peer.reset();
  bytes.resize(fault ? 0 : got);
  return bytes;
}

void TcpPort::send(std::string_view bytes) {
  while (impl_->peer && !bytes.empty()) {
    asio::error_code fault;
    const std::size_t sent = impl_->peer->write_some(asio::buffer(bytes.data(), bytes.size()), fault);
    bytes.remove_prefix(sent);
    if (!fault) continue;
    pollfd one{impl_->peer->native_handle(), POLLOUT, 0};
    if (fault != asio::error::would_block || ::poll(&one, 1, kMaxUnread_ms) <= 0) impl_->peer.reset();
  }
}

}  // namespace tileflight::autopilot
