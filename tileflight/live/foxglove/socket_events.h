#pragma once

#include <libwebsockets.h>

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "tileflight/live/foxglove/connection.h"
#include "tileflight/live/foxglove/server.h"

namespace tileflight::foxglove {

/// A socket of a client, before and after it became a WebSocket.
struct Peer {
  std::string name;
  bool is_explained = false;  ///< it became a WebSocket, or why it did not is logged
};

/// The sockets of a server, and what happens on them, in a thread of its own; what a program asks of them is in
/// server.cpp.
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

  // Events, in the server's thread. What is returned other than 0 closes the connection.
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
  /// For each client; one whose answers exceed their limit is to be closed. The mutex must be held.
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
