#include "tileflight/live/rpc/message_scanner.h"

#include <string>

namespace tileflight::rpc {
namespace {

/// Decoded header of a value: its length, and the number of values it contains.
struct Header {
  std::size_t bytes = 1;      ///< of the header itself
  std::uint64_t payload = 0;  ///< bytes that follow
  std::uint64_t values = 0;   ///< values that follow (a map's entry is two)
  bool container = false;
};

std::uint64_t big_endian(std::string_view bytes, std::size_t offset, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8U | static_cast<std::uint8_t>(bytes[offset + i]);
  return value;
}

Header container_header(std::size_t bytes, std::uint64_t values) { return {bytes, 0, values, true}; }

/// Number of length bytes after the first byte; 0 for formats without any.
std::size_t length_bytes(std::uint8_t first) {
  switch (first) {
    case 0xc4:
    case 0xc7:
    case 0xd9:
      return 1;
    case 0xc5:
    case 0xc8:
    case 0xda:
    case 0xdc:
    case 0xde:
      return 2;
    case 0xc6:
    case 0xc9:
    case 0xdb:
    case 0xdd:
    case 0xdf:
      return 4;
    default:
      return 0;
  }
}

Header fixed_header(std::uint8_t first) {
  if (first <= 0x7f || first >= 0xe0) return {};
  if (first <= 0x8f) return container_header(1, 2U * (first & 0x0fU));
  if (first <= 0x9f) return container_header(1, first & 0x0fU);
  if (first <= 0xbf) return {1, first & 0x1fU};
  switch (first) {
    case 0xc0:
    case 0xc2:
    case 0xc3:
      return {};
    case 0xcc:
    case 0xd0:
      return {1, 1};
    case 0xcd:
    case 0xd1:
      return {1, 2};
    case 0xca:
    case 0xce:
    case 0xd2:
      return {1, 4};
    case 0xcb:
    case 0xcf:
    case 0xd3:
      return {1, 8};
    case 0xd4:
    case 0xd5:
    case 0xd6:
    case 0xd7:
    case 0xd8:
      return {1, 1 + (std::uint64_t{1} << (first - 0xd4U))};
    default:
      throw ProtocolError("byte 0xc1, which cannot start a MessagePack value");
  }
}

/// nullopt: the header is incomplete.
std::optional<Header> read_header(std::string_view bytes, std::size_t offset) {
  if (offset >= bytes.size()) return std::nullopt;
  const auto first = static_cast<std::uint8_t>(bytes[offset]);
  const std::size_t count = length_bytes(first);
  if (count == 0) return fixed_header(first);
  if (bytes.size() - offset < 1 + count) return std::nullopt;
  const std::uint64_t length = big_endian(bytes, offset + 1, count);
  if (first == 0xdc || first == 0xdd) return container_header(1 + count, length);
  if (first == 0xde || first == 0xdf) return container_header(1 + count, 2 * length);
  const bool extension = first >= 0xc7 && first <= 0xc9;
  return Header{1 + count, length + (extension ? 1 : 0)};
}

}  // namespace

void MessageScanner::restart() {
  offset_ = 0;
  values_ = 0;
  open_.clear();
  begun_ = false;
  whole_ = false;
}

void MessageScanner::open_container(std::uint64_t values) {
  values_ += values;
  if (values_ > limits_.max_values) {
    throw ProtocolError("a message of more than " + std::to_string(limits_.max_values) + " values");
  }
  if (open_.size() == limits_.max_depth) {
    throw ProtocolError("arrays nested more than " + std::to_string(limits_.max_depth) + " deep");
  }
  open_.push_back(values);
}

void MessageScanner::close_finished_containers() {
  while (!open_.empty() && open_.back() == 0) {
    open_.pop_back();
    if (!open_.empty()) --open_.back();
  }
  whole_ = open_.empty();
}

std::optional<std::size_t> MessageScanner::find_message_end(std::string_view bytes) {
  while (!whole_) {
    const std::optional<Header> header = read_header(bytes, offset_);
    if (!header) return std::nullopt;
    if (!begun_ && !(header->container && (header->values == 4 || header->values == 3))) {
      throw ProtocolError("a message is an array of 4 values, a notification of 3");
    }
    begun_ = true;
    if (header->payload > limits_.max_bytes || offset_ + header->bytes + header->payload > limits_.max_bytes) {
      throw ProtocolError("a message of more than " + std::to_string(limits_.max_bytes) + " bytes");
    }
    offset_ += header->bytes + static_cast<std::size_t>(header->payload);
    if (header->container) {
      open_container(header->values);
    } else {
      --open_.back();  // never empty: a message begins with an array
    }
    close_finished_containers();
  }
  return offset_ <= bytes.size() ? std::optional(offset_) : std::nullopt;
}

}  // namespace tileflight::rpc
