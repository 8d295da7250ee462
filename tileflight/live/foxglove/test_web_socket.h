#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <optional>
#include <string>

namespace tileflight::foxglove {

/// A client of its own for tests: RFC 6455 over a plain socket, without any library, so that it can also send what no
/// library would. Reading gives up after a minute.
class TestWebSocket {
 public:
  /// Connects; `protocol` empty: no more than that.
  explicit TestWebSocket(std::uint16_t port, const std::string& protocol = "foxglove.websocket.v1",
                         int receive_buffer_bytes = 0) {
    socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
    const timeval patience{60, 0};
    const int at_once = 1;
    ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (receive_buffer_bytes > 0)
      ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    if (protocol.empty()) return;
    send_raw(
        "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: " +
        protocol + "\r\n\r\n");
    while (answer_.find("\r\n\r\n") == std::string::npos) {
      const std::string more = read_some(1);
      if (more.empty()) return;
      answer_ += more;
    }
  }
  ~TestWebSocket() { ::close(socket_); }
  TestWebSocket(const TestWebSocket&) = delete;
  TestWebSocket& operator=(const TestWebSocket&) = delete;

  const std::string& answer() const { return answer_; }  ///< to the handshake
  bool is_open() const { return answer_.starts_with("HTTP/1.1 101"); }

  void send_raw(const std::string& bytes) { ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// A whole text message, masked with zeros.
  void send_text(const std::string& text) { send_raw(frame_head(0x81, text.size()) + text); }
  /// First byte, length and mask of a frame from a client (section 5.2).
  static std::string frame_head(int first, std::uint64_t size) {
    std::string head(1, static_cast<char>(first));
    if (size < 126) {
      head += static_cast<char>(0x80U | size);
    } else {
      head += static_cast<char>(0x80U | 127U);
      for (int shift = 56; shift >= 0; shift -= 8)
        head += static_cast<char>((size >> static_cast<unsigned>(shift)) & 0xFFU);
    }
    return head + std::string(4, '\0');
  }

  struct Message {
    bool is_text = false;
    std::string bytes;
  };
  /// The next whole message; nullopt once the connection is closed.
  std::optional<Message> read() {
    Message message;
    for (bool is_last = false; !is_last;) {
      const std::string head = read_all(2);
      if (head.size() < 2) return std::nullopt;
      const int opcode = head[0] & 0x0F;
      is_last = (head[0] & 0x80) != 0;
      std::uint64_t size = head[1] & 0x7F;
      if (size == 126 || size == 127) size = big_endian(read_all(size == 126 ? 2 : 8));
      const std::string part = read_all(size);
      has_goodbye_ = has_goodbye_ || opcode == 8;
      if (opcode == 8 || part.size() < size) return std::nullopt;
      if (opcode == 1) message.is_text = true;
      message.bytes += part;
      ++fragments_;
    }
    return message;
  }
  /// The next text that contains this; empty: the connection was closed before.
  std::string read_text_with(const std::string& part) {
    while (const auto message = read())
      if (message->is_text && message->bytes.find(part) != std::string::npos) return message->bytes;
    return {};
  }
  /// The next Message Data; nullopt once the connection is closed.
  std::optional<std::string> read_data() {
    while (auto message = read())
      if (!message->is_text && !message->bytes.empty() && message->bytes[0] == 1) return message->bytes;
    return std::nullopt;
  }
  /// Reads until the server says goodbye or closes the connection; false if neither happens within a minute.
  bool is_closed_by_server() {
    while (read().has_value()) continue;
    return has_goodbye_ || is_at_end_;
  }
  int fragments() const { return fragments_; }  ///< of all messages read

 private:
  static std::uint64_t big_endian(const std::string& bytes) {
    std::uint64_t value = 0;
    for (const char c : bytes) value = value << 8U | static_cast<unsigned char>(c);
    return value;
  }
  std::string read_some(std::size_t most) {
    std::string bytes(most, '\0');
    const ssize_t got = ::recv(socket_, bytes.data(), most, 0);
    is_at_end_ = is_at_end_ || got == 0 || (got < 0 && errno == ECONNRESET);
    bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return bytes;
  }
  std::string read_all(std::size_t size) {
    std::string bytes;
    while (bytes.size() < size) {
      const std::string more = read_some(size - bytes.size());
      if (more.empty()) break;
      bytes += more;
    }
    return bytes;
  }

  int socket_ = -1;
  std::string answer_;
  int fragments_ = 0;
  bool has_goodbye_ = false, is_at_end_ = false;
};

}  // namespace tileflight::foxglove
