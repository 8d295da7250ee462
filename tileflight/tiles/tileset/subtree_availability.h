#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/subtree_buffers.h"

namespace tileflight::tileset {

/// One bit for each possible tile, or one for all of them (3D Tiles 1.1, section "Availability"). A view into the
/// subtree's buffers.
class Availability {
 public:
  Availability() = default;
  /// `bits`: number of bits. Throws InputError (where, cause) if they are not there.
  Availability(const tile_content::Json& json, std::size_t bits, SubtreeBuffers& buffers, const std::string& where);

  bool at(std::size_t index) const {
    if (stream_.empty()) return constant_;
    return (std::to_integer<unsigned>(stream_[index / 8]) >> (index % 8) & 1U) != 0;
  }
  /// Number of set bits among the first `bits`.
  std::size_t count(std::size_t bits) const;
  std::size_t count() const { return count(bits_); }
  /// Number of set bits from one index up to, not including, another.
  std::size_t count(std::size_t from, std::size_t to) const;

 private:
  std::size_t bits_ = 0;
  bool constant_ = false;
  std::span<const std::byte> stream_;
};

/// Row of an available entry in its metadata: the number of available entries before it.
class AvailabilityRank {
 public:
  AvailabilityRank() = default;
  AvailabilityRank(const Availability& availability, std::size_t bits);

  std::size_t of(const Availability& availability, std::size_t index) const {
    return before_[index / kBlock] + availability.count(index / kBlock * kBlock, index);
  }

 private:
  static constexpr std::size_t kBlock = 128;
  std::vector<std::uint32_t> before_;  ///< available entries before each block
};

}  // namespace tileflight::tileset
