#pragma once

#include <libwebsockets.h>

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/live/foxglove/client_session.h"

namespace tileflight::foxglove {

/// One WebSocket connection: puts the fragments of a client's messages together, and cuts those to the client into
/// fragments (RFC 6455, section 5.4), so that of a large message little is copied. Used by the server's thread, with
/// the session guarded by the server's mutex.
class Connection {
 public:
  Connection(lws* socket, ClientSession session);

  lws* socket() const { return socket_; }
  ClientSession& session() { return session_; }
  const ClientSession& session() const { return session_; }

  /// A fragment from the client. Returns the whole text once it is complete. Throws ProtocolError: a binary message
  /// (this server takes none), or one that is or says that it will be larger than `max_bytes`.
  std::optional<std::string> receive(std::string_view fragment, std::size_t max_bytes);

  /// Sends until the socket takes no more or nothing waits. Returns false if the connection is broken.
  bool send();
  bool has_unsent() const { return current_.has_value() || session_.has_next(); }
  std::chrono::steady_clock::duration since_progress() const;

  std::string fault;          ///< the reason for which it is to be closed; empty: none
  bool is_leaving = false;    ///< the server stops
  bool is_explained = false;  ///< its end needs no line: the client said goodbye, or the reason is logged

 private:
  bool send_fragment();

  lws* socket_;
  ClientSession session_;
  std::string received_;
  std::optional<OutgoingMessage> current_;  ///< the message that is being sent
  std::size_t sent_ = 0;                    ///< bytes of it
  std::chrono::steady_clock::time_point progress_ = std::chrono::steady_clock::now();
  std::vector<unsigned char> scratch_;
};

}  // namespace tileflight::foxglove
