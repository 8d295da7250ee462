#include "tileflight/live/autopilot/mavlink.h"

#include <algorithm>

#include "tileflight/core/base/hash.h"

namespace tileflight::autopilot {
namespace {

constexpr char kStart = '\xFD';
constexpr std::size_t kFrameHeaderBytes = 10, kChecksumBytes = 2, kSignatureBytes = 13;
constexpr unsigned kSigned = 0x01;

unsigned byte_at(std::string_view bytes, std::size_t at) { return static_cast<unsigned char>(bytes[at]); }

std::uint32_t message_number(std::string_view frame) {
  return byte_at(frame, 7) | byte_at(frame, 8) << 8U | byte_at(frame, 9) << 16U;
}

std::size_t frame_bytes(std::string_view header) {
  return kFrameHeaderBytes + byte_at(header, 1) + kChecksumBytes +
         ((byte_at(header, 2) & kSigned) != 0 ? kSignatureBytes : 0);
}

/// Over all but the start byte, and the message's seed.
std::uint16_t checksum(std::string_view frame_without_checksum, std::uint8_t crc_extra) {
  const char extra = static_cast<char>(crc_extra);
  return base::crc16_mcrf4xx({&extra, 1}, base::crc16_mcrf4xx(frame_without_checksum.substr(1)));
}

bool is_intact(std::string_view frame, std::uint8_t crc_extra) {
  const std::size_t end = kFrameHeaderBytes + byte_at(frame, 1);
  return checksum(frame.substr(0, end), crc_extra) == (byte_at(frame, end) | byte_at(frame, end + 1) << 8U);
}

}  // namespace

std::string encode_frame(const MavlinkMessage& message, const MavlinkFrame& frame) {
  std::string payload = frame.payload;
  while (payload.size() > 1 && payload.back() == '\0') payload.pop_back();
  std::string bytes{kStart, static_cast<char>(payload.size()), 0, 0};
  bytes += static_cast<char>(frame.sequence);
  bytes += static_cast<char>(frame.system);
  bytes += static_cast<char>(frame.component);
  for (unsigned shift = 0; shift < 24; shift += 8) bytes += static_cast<char>(message.number >> shift & 0xFFU);
  bytes += payload;
  const unsigned sum = checksum(bytes, message.crc_extra);
  bytes += static_cast<char>(sum & 0xFFU);
  bytes += static_cast<char>(sum >> 8U);
  return bytes;
}

std::optional<MavlinkMessage> known_message(std::uint32_t number) {
  for (const MavlinkMessage& one :
       {Heartbeat::kMessage, HilActuatorControls::kMessage, HilSensor::kMessage, HilGps::kMessage,
        HilStateQuaternion::kMessage, DistanceSensor::kMessage, HilOpticalFlow::kMessage, Odometry::kMessage}) {
    if (one.number == number) return one;
  }
  return std::nullopt;
}

std::optional<MavlinkFrame> MavlinkReader::next() {
  while (true) {
    const std::size_t noise = std::min(bytes_.find(kStart), bytes_.size());
    noise_bytes_ += noise;
    bytes_.erase(0, noise);
    if (bytes_.size() > 2 &&
        (byte_at(bytes_, 2) & ~kSigned) != 0) {  // flags that forbid to read on (Packet Serialization)
      ++noise_bytes_;
      bytes_.erase(0, 1);
      continue;
    }
    if (bytes_.size() < kFrameHeaderBytes || bytes_.size() < frame_bytes(bytes_)) return std::nullopt;
    const std::uint32_t number = message_number(bytes_);
    const auto message = known_message(number);
    if (message && !is_intact(bytes_, message->crc_extra)) {
      ++wrong_checksums_;  // its length may be wrong, too: the next frame may begin right behind the start byte
      bytes_.erase(0, 1);
      continue;
    }
    const std::string frame = bytes_.substr(0, frame_bytes(bytes_));
    bytes_.erase(0, frame.size());
    if (!message) continue;
    return MavlinkFrame{static_cast<std::uint8_t>(frame[4]), static_cast<std::uint8_t>(frame[5]),
                        static_cast<std::uint8_t>(frame[6]), number,
                        frame.substr(kFrameHeaderBytes, byte_at(frame, 1))};
  }
}

}  // namespace tileflight::autopilot
