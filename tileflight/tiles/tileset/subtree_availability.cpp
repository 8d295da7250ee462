#include "tileflight/tiles/tileset/subtree_availability.h"

#include <algorithm>
#include <bit>

#include "tileflight/core/base/input_error.h"

namespace tileflight::tileset {

Availability::Availability(const tile_content::Json& json, std::size_t bits, SubtreeBuffers& buffers,
                           const std::string& where)
    : bits_(bits) {
  auto stream = tile_content::find_index(json, "bitstream", where);
  if (!stream) stream = tile_content::find_index(json, "bufferView", where);  // before 1.1
  const auto constant = tile_content::find_index(json, "constant", where, 1);
  if (!stream && !constant) throw InputError(where, "has no bitstream and no constant");
  if (stream && constant) throw InputError(where, "has both bitstream and constant");
  constant_ = constant.value_or(0) == 1;
  if (!stream) return;
  stream_ = buffers.view(*stream);
  if (stream_.size() < (bits + 7) / 8) {
    throw InputError(where, "its bitstream has " + std::to_string(stream_.size()) + " bytes, expected " +
                                std::to_string((bits + 7) / 8));
  }
}

std::size_t Availability::count(std::size_t bits) const {
  if (stream_.empty()) return constant_ ? bits : 0;
  std::size_t set = 0;
  for (std::size_t i = 0; i < bits / 8; ++i)
    set += static_cast<std::size_t>(std::popcount(std::to_integer<unsigned>(stream_[i])));
  return set + count(bits / 8 * 8, bits);
}

std::size_t Availability::count(std::size_t from, std::size_t to) const {
  std::size_t set = 0;
  for (std::size_t i = from; i < to; ++i) set += at(i) ? 1 : 0;
  return set;
}

AvailabilityRank::AvailabilityRank(const Availability& availability, std::size_t bits) {
  before_.reserve(bits / kBlock + 1);
  std::size_t set = 0;
  for (std::size_t from = 0; from <= bits; from += kBlock) {
    before_.push_back(static_cast<std::uint32_t>(set));
    set += availability.count(from, std::min(from + kBlock, bits));
  }
}

}  // namespace tileflight::tileset
