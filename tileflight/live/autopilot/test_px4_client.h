#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/live/autopilot/mavlink.h"
#include "tileflight/live/autopilot/test_scripted_autopilot.h"

namespace tileflight::autopilot::test_support {

/// Bytes of a message as PX4 sends it.
template <class Message>
std::string frame_of(const Message& message, std::uint8_t sequence) {
  return encode_frame(Message::kMessage, {.sequence = sequence, .payload = encode_payload(message)});
}

/// A TCP connection to a port of this machine.
class TcpClient {
 public:
  explicit TcpClient(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval patience{10, 0};
    const int yes = 1;
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(port);
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::connect(socket_, reinterpret_cast<sockaddr*>(&server), sizeof server);
  }
  ~TcpClient() { ::close(socket_); }
  TcpClient(const TcpClient&) = delete;
  TcpClient& operator=(const TcpClient&) = delete;

  void send(const std::string& bytes) const { ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// Returns the received bytes; empty if nothing comes in time, or the connection has ended.
  std::string receive() const {
    std::string bytes(65536, '\0');
    const ssize_t got = ::recv(socket_, bytes.data(), bytes.size(), 0);
    bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return bytes;
  }

 private:
  int socket_;
};

/// The simulator's side of the conversation as PX4 hears it.
class Px4Ears {
 public:
  explicit Px4Ears(std::uint16_t port) : client_(port) {}

  const TcpClient& client() const { return client_; }
  /// Reads up to and with the next sensors; false if the connection ends.
  bool hear() {
    while (true) {
      while (const auto frame = reader_.next()) {
        heard_ += frame->payload;
        if (frame->message == HilStateQuaternion::kMessage.number)
          state = decode_payload<HilStateQuaternion>(frame->payload);
        if (frame->message == DistanceSensor::kMessage.number) {
          const auto read = decode_payload<DistanceSensor>(frame->payload);
          distances[read.id] = read;
        }
        if (frame->message == HilOpticalFlow::kMessage.number)
          flows.push_back(decode_payload<HilOpticalFlow>(frame->payload));
        if (frame->message == Odometry::kMessage.number) odometries.push_back(decode_payload<Odometry>(frame->payload));
        if (frame->message == HilGps::kMessage.number) gps = decode_payload<HilGps>(frame->payload);
        if (frame->message != HilSensor::kMessage.number) continue;
        sensor = decode_payload<HilSensor>(frame->payload);
        return true;
      }
      const std::string bytes = client_.receive();
      if (bytes.empty()) return false;
      reader_.push(bytes);
    }
  }
  /// All payloads so far.
  const std::string& heard() const { return heard_; }

  HilSensor sensor;
  HilStateQuaternion state;
  std::optional<HilGps> gps;
  std::map<int, DistanceSensor> distances;  ///< the last of each sensor
  std::vector<HilOpticalFlow> flows;
  std::vector<Odometry> odometries;

 private:
  TcpClient client_;
  MavlinkReader reader_;
  std::string heard_;
};

/// The true state as its message tells it: NED from `home`, by a small place's radii of the Earth.
inline Observation true_state(const HilStateQuaternion& home, const HilStateQuaternion& now) {
  constexpr double kEquator_m = 6378137.0, kFlattening = 1.0 / 298.257223563;
  constexpr double kRadiansPerUnit = 1e-7 * std::numbers::pi / 180.0;
  const double latitude_rad = home.latitude_e7_deg * kRadiansPerUnit;
  const double e2 = kFlattening * (2.0 - kFlattening), w2 = 1.0 - e2 * std::pow(std::sin(latitude_rad), 2);
  const double across_m = kEquator_m / std::sqrt(w2), along_m = across_m * (1.0 - e2) / w2;
  const auto v = [](const auto& a) { return geometry::Vec3(a[0], a[1], a[2]); };
  Observation seen;
  seen.time_s = 1e-6 * static_cast<double>(now.time_us) - 1.0;
  seen.position_m = {
      (now.latitude_e7_deg - home.latitude_e7_deg) * kRadiansPerUnit * along_m,
      (now.longitude_e7_deg - home.longitude_e7_deg) * kRadiansPerUnit * across_m * std::cos(latitude_rad),
      -1e-3 * (now.altitude_mm - home.altitude_mm)};
  seen.velocity_m_s = 0.01 * v(now.velocity_ned_cm_s);
  seen.R_ned_body =
      Eigen::Quaterniond(now.attitude_wxyz[0], now.attitude_wxyz[1], now.attitude_wxyz[2], now.attitude_wxyz[3]);
  seen.gyro_rad_s = v(now.rates_rad_s);
  return seen;
}

/// The scripted autopilot in PX4's place: it sees the true state, as far as its message tells it, and the gyro.
class ScriptedPx4 {
 public:
  ScriptedPx4(std::uint16_t port, std::vector<geometry::Vec3> points)
      : ears_(port), autopilot_(vehicle::make_airframe(vehicle::AirframeKind::kQuadX), std::move(points), 0.0) {}

  /// One round: sensors in, outputs back; false if the connection ends.
  bool round() {
    if (!ears_.hear()) return false;
    HilActuatorControls answer;
    answer.time_us = ears_.sensor.time_us;
    const auto outputs = autopilot_.outputs(observation(), 0.004);
    for (std::size_t i = 0; i < outputs.size(); ++i) answer.controls[i] = static_cast<float>(outputs[i]);
    answer.flags = 1;
    answer.mode = autopilot_.armed() ? 129 : 1;
    ears_.client().send(frame_of(answer, sequence_++));
    return true;
  }
  void fly(double limit_s) {
    while (!autopilot_.landed() && time_s() < limit_s && round()) {
    }
  }
  double time_s() const { return 1e-6 * static_cast<double>(ears_.sensor.time_us) - 1.0; }
  Px4Ears& ears() { return ears_; }
  const ScriptedAutopilot& autopilot() const { return autopilot_; }

  /// From the first position; the gyro's reading.
  Observation observation() {
    if (!home_) home_ = ears_.state;
    Observation seen = true_state(*home_, ears_.state);
    seen.gyro_rad_s = {ears_.sensor.gyro_rad_s[0], ears_.sensor.gyro_rad_s[1], ears_.sensor.gyro_rad_s[2]};
    return seen;
  }

 private:
  Px4Ears ears_;
  ScriptedAutopilot autopilot_;
  std::optional<HilStateQuaternion> home_;
  std::uint8_t sequence_ = 0;
};

}  // namespace tileflight::autopilot::test_support
