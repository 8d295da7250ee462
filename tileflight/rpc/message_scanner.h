#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "tileflight/rpc/limits.h"

namespace tileflight::rpc {

/// Bytes that are no msgpack-rpc message, or one beyond the limits. Nothing after them can be understood, so the
/// connection that they came from is closed; the message is the reason.
class ProtocolError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Finds where the first message of a byte stream ends, without decoding it and without believing what it claims: the
/// memory used is one count a level of nesting. MessagePack specification, "Formats".
class MessageScanner {
 public:
  explicit MessageScanner(const MessageLimits& limits) : limits_(limits) {}

  /// `bytes`: all that has come of the message, from its first byte on; each call continues where the last one stopped.
  /// The message's length once it is all there. Throws ProtocolError.
  std::optional<std::size_t> end(std::string_view bytes);

  /// Ready for the next message.
  void restart();

 private:
  void enter(std::uint64_t values);
  void leave_finished();

  MessageLimits limits_;
  std::size_t offset_ = 0;           ///< of the next value's first byte
  std::uint64_t values_ = 0;         ///< seen and promised
  std::vector<std::uint64_t> open_;  ///< values still to come, of each array or map that is not at its end
  bool begun_ = false;
  bool whole_ = false;
};

}  // namespace tileflight::rpc
