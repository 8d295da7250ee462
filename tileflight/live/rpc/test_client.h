#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cstdint>
#include <msgpack.hpp>
#include <optional>
#include <stdexcept>
#include <string>

#include "tileflight/live/rpc/message_scanner.h"

namespace tileflight::rpc {

/// Test client of a local server that sends and receives raw bytes.
class TestClient {
 public:
  explicit TestClient(std::uint16_t port, double patience_s = 10.0) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval patience{static_cast<time_t>(patience_s), 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(port);
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&server), sizeof server) != 0) {
      throw std::runtime_error("cannot connect");
    }
  }
  ~TestClient() { ::close(socket_); }
  TestClient(const TestClient&) = delete;
  TestClient& operator=(const TestClient&) = delete;

  /// False: the server has closed the connection, or accepts no data.
  bool send(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }

  /// Tells the server that nothing more will be sent.
  void end_sending() const { ::shutdown(socket_, SHUT_WR); }

  /// The bytes of the next message from the server; nullopt: it has closed the connection, or is silent.
  std::optional<std::string> receive() {
    MessageScanner scanner(MessageLimits{.max_bytes = std::size_t{1} << 30U, .max_values = 1U << 30U});
    while (true) {
      if (const auto bytes = scanner.find_message_end(received_)) {
        std::string message = received_.substr(0, *bytes);
        received_.erase(0, *bytes);
        return message;
      }
      char chunk[65536];
      const ssize_t got = ::recv(socket_, chunk, sizeof chunk, 0);
      if (got <= 0) return std::nullopt;
      received_.append(chunk, static_cast<std::size_t>(got));
    }
  }

  /// Sends a request and returns the next message from the server.
  std::optional<std::string> ask(std::string_view bytes) { return send(bytes) ? receive() : std::nullopt; }

  /// Whether the server closes the connection (or resets it) within the client's timeout.
  bool is_closed() {
    char chunk[65536];
    while (true) {
      const ssize_t got = ::recv(socket_, chunk, sizeof chunk, 0);
      if (got > 0) continue;
      return got == 0 || errno == ECONNRESET;
    }
  }

 private:
  int socket_;
  std::string received_;
};

/// `[0, id, method, [arguments...]]`
template <class... Arguments>
std::string request_bytes(std::uint32_t id, const std::string& method, const Arguments&... arguments) {
  msgpack::sbuffer buffer;
  msgpack::pack(buffer, std::make_tuple(0, id, method, std::make_tuple(arguments...)));
  return {buffer.data(), buffer.size()};
}

/// A decoded response.
struct TestResponse {
  std::uint32_t id = 0;
  std::optional<std::string> error;
  msgpack::object_handle handle;
  const msgpack::object& result() const { return handle.get().via.array.ptr[3]; }
};

inline TestResponse decode_response(const std::string& bytes) {
  TestResponse answer;
  answer.handle = msgpack::unpack(bytes.data(), bytes.size());
  const msgpack::object* values = answer.handle.get().via.array.ptr;
  answer.id = values[1].as<std::uint32_t>();
  if (!values[2].is_nil()) answer.error = values[2].as<std::string>();
  return answer;
}

}  // namespace tileflight::rpc
