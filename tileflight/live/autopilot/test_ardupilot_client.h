#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/live/autopilot/test_scripted_autopilot.h"

namespace tileflight::autopilot::test_support {

/// A datagram of ArduPilot with 16 or 32 channels, little endian.
inline std::string servo_datagram(std::uint16_t rate, std::uint32_t frame, const std::vector<std::uint16_t>& pwm,
                                  int channels = 16) {
  std::string bytes;
  const auto put = [&](std::uint32_t value, int count) {
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFFU);
  };
  put(channels == 16 ? 18458U : 29569U, 2);
  put(rate, 2);
  put(frame, 4);
  for (int i = 0; i < channels; ++i)
    put(static_cast<std::size_t>(i) < pwm.size() ? pwm[static_cast<std::size_t>(i)] : 1000U, 2);
  return bytes;
}

inline std::vector<std::uint16_t> pulses(const std::vector<double>& outputs) {
  std::vector<std::uint16_t> pwm;
  for (const double one : outputs) pwm.push_back(static_cast<std::uint16_t>(std::lround(1000.0 + 1000.0 * one)));
  return pwm;
}

/// The state that a simulator has sent.
inline Observation parse_state(const std::string& line) {
  const auto json = nlohmann::json::parse(line);
  const auto vec = [](const nlohmann::json& v) { return geometry::Vec3(v.at(0), v.at(1), v.at(2)); };
  const auto& q = json.at("quaternion");
  return {json.at("timestamp"), vec(json.at("position")), vec(json.at("velocity")),
          Eigen::Quaterniond(q.at(0), q.at(1), q.at(2), q.at(3)), vec(json.at("imu").at("gyro"))};
}

/// A UDP socket that talks to a port of this machine, as ArduPilot's does.
class UdpClient {
 public:
  explicit UdpClient(std::uint16_t port, double patience_s = 10.0) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    const timeval patience{static_cast<time_t>(patience_s), static_cast<suseconds_t>(std::fmod(patience_s, 1.0) * 1e6)};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(port);
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::connect(socket_, reinterpret_cast<sockaddr*>(&server), sizeof server);
  }
  ~UdpClient() { ::close(socket_); }
  UdpClient(const UdpClient&) = delete;
  UdpClient& operator=(const UdpClient&) = delete;

  void send(const std::string& bytes) const { ::send(socket_, bytes.data(), bytes.size(), 0); }
  /// The next datagram; empty if none comes in time.
  std::string receive() const {
    std::string bytes(65536, '\0');
    const ssize_t got = ::recv(socket_, bytes.data(), bytes.size(), 0);
    bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return bytes;
  }
  std::string ask(const std::string& bytes) const {
    send(bytes);
    return receive();
  }

 private:
  int socket_;
};

}  // namespace tileflight::autopilot::test_support
