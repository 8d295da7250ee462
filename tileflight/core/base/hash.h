#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace tileflight::base {

/// MD5 (RFC 1321), used by the index of a .3tz to name its files. Not for security.
std::array<std::uint8_t, 16> md5(std::string_view bytes);

/// Computes CRC-16/MCRF4XX (X.25's polynomial), the checksum of MAVLink, continued from `crc`.
std::uint16_t crc16_mcrf4xx(std::string_view bytes, std::uint16_t crc = 0xFFFF);

/// SHA-256 (FIPS 180-4) of bytes that are added in parts (OpenSSL).
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void add(std::string_view bytes);
  /// Hash of all bytes added so far, lower-case hexadecimal.
  std::string hex() const;

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

}  // namespace tileflight::base
