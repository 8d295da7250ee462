#include "tileflight/live/foxglove/connection.h"

#include <algorithm>
#include <utility>

namespace tileflight::foxglove {
namespace {

constexpr std::size_t kFragmentBytes = std::size_t{256} << 10U;

/// Copies the bytes from `from` on of head and body, as many as fit.
std::size_t copy_part(const OutgoingMessage& message, std::size_t from, unsigned char* to, std::size_t room) {
  std::size_t copied = 0;
  const auto take = [&](std::string_view bytes, std::size_t offset) {
    if (offset >= bytes.size()) return;
    const std::string_view part = bytes.substr(offset, room - copied);
    std::ranges::copy(part, to + copied);
    copied += part.size();
  };
  take(message.head, from);
  if (message.body) take(*message.body, from > message.head.size() ? from - message.head.size() : 0);
  return copied;
}

}  // namespace

Connection::Connection(lws* socket, ClientSession session)
    : socket_(socket), session_(std::move(session)), scratch_(LWS_PRE + kFragmentBytes) {}

std::optional<std::string> Connection::receive(std::string_view fragment, std::size_t max_bytes) {
  if (lws_frame_is_binary(socket_) != 0) throw ProtocolError("sends binary messages, of which this server takes none");
  if (received_.size() + fragment.size() + lws_remaining_packet_payload(socket_) > max_bytes)
    throw ProtocolError("sends a message of more than " + std::to_string(max_bytes) + " bytes");
  received_ += fragment;
  if (lws_is_final_fragment(socket_) == 0 || lws_remaining_packet_payload(socket_) != 0) return std::nullopt;
  return std::exchange(received_, {});
}

bool Connection::send() {
  do {
    if (!current_) {
      current_ = session_.next();
      sent_ = 0;
      if (!current_) return true;
    }
    if (!send_fragment()) return false;
    progress_ = std::chrono::steady_clock::now();
  } while (lws_send_pipe_choked(socket_) == 0);
  if (has_unsent()) lws_callback_on_writable(socket_);
  return true;
}

bool Connection::send_fragment() {
  unsigned char* payload = scratch_.data() + LWS_PRE;
  const std::size_t bytes = copy_part(*current_, sent_, payload, kFragmentBytes);
  const bool is_first = sent_ == 0;
  sent_ += bytes;
  const bool is_last = sent_ == current_->size();
  const lws_write_protocol kind = current_->is_text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY;
  const int flags = lws_write_ws_flags(kind, is_first ? 1 : 0, is_last ? 1 : 0);
  if (is_last) current_.reset();
  return lws_write(socket_, payload, bytes, static_cast<lws_write_protocol>(flags)) >= static_cast<int>(bytes);
}

std::chrono::steady_clock::duration Connection::since_progress() const {
  return std::chrono::steady_clock::now() - progress_;
}

}  // namespace tileflight::foxglove
