#pragma once

#include <libwebsockets.h>

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "tileflight/live/foxglove/client_session.h"
#include "tileflight/live/foxglove/server.h"

namespace tileflight::foxglove {

/// One WebSocket connection: joins the fragments of a client's messages, and cuts messages to the client into fragments
/// (RFC 6455, section 5.4), so that little of a large message is copied at a time. Used by the server's thread, with
/// the session guarded by the server's mutex.
class Connection {
 public:
  Connection(lws* socket, ClientSession session);

  lws* socket() const { return socket_; }
  ClientSession& session() { return session_; }
  const ClientSession& session() const { return session_; }

  /// Takes a fragment from the client. Returns the whole text once it is complete. Throws ProtocolError for a binary
  /// message, or one that is or announces to be larger than `max_bytes`.
  std::optional<std::string> receive(std::string_view fragment, std::size_t max_bytes);

  /// Sends until the socket takes no more or nothing waits. Returns false if the connection is broken.
  bool send();
  bool has_unsent() const { return current_.has_value() || session_.has_next(); }
  std::chrono::steady_clock::duration since_progress() const;

  std::string fault;          ///< the reason to close the connection; empty: none
  bool is_leaving = false;    ///< the server stops
  bool is_explained = false;  ///< its end needs no log line: the client said goodbye, or the reason is logged

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

/// A socket of a client, before and after it became a WebSocket.
struct Peer {
  std::string name;
  bool is_explained = false;  ///< it became a WebSocket, or the log says why it did not
};

/// The sockets of a server and the handlers of their events, which run in a thread of their own. The functions that a
/// program calls are in server.cpp.
struct Server::Impl {
  Impl(const ServerOptions& server_options, ParameterAccess access, Log log_line);

  ServerOptions options;
  ParameterAccess parameters;
  Log log;
  std::string session_id;
  lws_context* context = nullptr;
  std::uint16_t port = 0;

  mutable std::mutex mutex;  ///< guards the members below
  mutable std::condition_variable_any changed;
  ClientSession::Channels channels;
  ChannelId next_channel = 1;
  std::map<lws*, Connection> connections;
  std::map<lws*, Peer> peers;  ///< of all sockets; the server's thread only
  std::uint64_t changes = 0;
  std::uint64_t refused = 0;
  std::uint64_t dropped = 0;  ///< for clients that are gone
  bool is_stopping = false;
  bool is_over = false;

  std::jthread thread;  ///< last member: ends first

  void listen();
  void run();
  void stop();

  // Handlers of events, in the server's thread. A result other than 0 closes the connection.
  static int dispatch(lws* socket, lws_callback_reasons reason, void* user, void* in, std::size_t size);
  int handle(lws* socket, lws_callback_reasons reason, std::string_view bytes);
  int refuse(lws* socket, const std::string& why);
  int admit(lws* socket);
  int open(lws* socket);
  int receive(lws* socket, std::string_view fragment);
  int send(lws* socket);
  int check_progress(lws* socket);
  void wake_connections();
  void accept_goodbye(lws* socket);
  void refuse_message(ChannelId channel, std::size_t bytes);
  void close(lws* socket);
  void forget_peer(lws* socket);

  void log_client(lws* socket, const std::string& what) const {
    const auto peer = peers.find(socket);
    if (log && peer != peers.end()) log("foxglove client " + peer->second.name + " " + what);
  }
  /// Applies an action to each client, and marks one whose answers exceed their limit to be closed. The mutex must be
  /// held.
  template <class Action>
  void for_each_session(const Action& action) {
    for (auto& [socket, connection] : connections) {
      try {
        action(connection.session());
      } catch (const ProtocolError& error) {
        connection.fault = error.what();
      }
    }
  }
  std::uint64_t dropped_now() const {
    std::uint64_t sum = dropped;
    for (const auto& [socket, connection] : connections) sum += connection.session().dropped();
    return sum;
  }
};

}  // namespace tileflight::foxglove
