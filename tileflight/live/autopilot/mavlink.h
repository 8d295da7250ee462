#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tileflight::autopilot {

/// A message of MAVLink 2 as it travels (mavlink.io, Packet Serialization).
struct MavlinkFrame {
  std::uint8_t sequence = 0, system = 1, component = 1;
  std::uint32_t message = 0;  ///< its number
  std::string payload;        ///< as long as it came: zero bytes at its end may be missing
};

/// A message's number, the seed of its checksum (CRC_EXTRA: from names and types of its fields), and its longest
/// payload.
struct MavlinkMessage {
  std::uint32_t number;
  std::uint8_t crc_extra;
  std::size_t bytes;
};

/// The checksum of MAVLink: CRC-16/MCRF4XX (X.25's polynomial), continued from `crc`.
std::uint16_t mavlink_crc(std::string_view bytes, std::uint16_t crc = 0xFFFF);

/// Frame of a message without signature; zero bytes at the payload's end, its first apart, are left out.
std::string encode_frame(const MavlinkMessage& message, const MavlinkFrame& frame);

/// Frames in the bytes of a stream. Noise between frames, wrong checksums and messages other than those of
/// hil_messages.h are counted and skipped; signatures are not checked. Holds at most one frame's bytes beyond what was
/// pushed last.
class MavlinkReader {
 public:
  void push(std::string_view bytes) { bytes_.append(bytes); }
  /// The next frame, or nullopt until more bytes come.
  std::optional<MavlinkFrame> next();

  std::uint64_t wrong_checksums() const { return wrong_checksums_; }
  std::uint64_t noise_bytes() const { return noise_bytes_; }

 private:
  std::string bytes_;
  std::uint64_t wrong_checksums_ = 0, noise_bytes_ = 0;
};

}  // namespace tileflight::autopilot
