#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "tileflight/live/rpc/message_scanner.h"
#include "tileflight/live/rpc/method_table.h"

namespace tileflight::rpc {

struct ServerOptions {
  std::string address = "127.0.0.1";  ///< of this machine, or "localhost"; 0.0.0.0 or :: for all of its networks
  std::uint16_t port = 0;             ///< 0: any free port
  /// Token that a client must send first, as the only argument of `token_method`; empty: no authentication.
  std::string token;
  std::string token_method = "authenticate";
  ServerLimits limits;
};

/// Statistics of one method since the start.
struct MethodStatistics {
  std::uint64_t calls = 0;
  std::uint64_t errors = 0;
  double seconds = 0.0;  ///< spent in the method itself: without decoding, encoding, waiting and network
};

struct ServerStatistics {
  std::uint64_t connections = 0;           ///< open now
  std::uint64_t connections_accepted = 0;  ///< since the start
  std::uint64_t connections_refused = 0;   ///< because there were too many
  std::uint64_t connections_cut = 0;       ///< closed by the server, for a logged reason
  std::uint64_t requests = 0;              ///< received since the start
  std::uint64_t answers = 0;
  std::uint64_t running = 0;     ///< requests being executed
  std::uint64_t workers = 0;     ///< threads
  std::uint64_t held_bytes = 0;  ///< unanswered messages and unread responses
  std::map<std::string, MethodStatistics> methods;
};

/// Returns whether a server at this address can be reached only from this machine. Throws InputError for an invalid
/// address.
bool is_loopback(const std::string& address);

/// Serves a method table by msgpack-rpc over TCP. Each request, even of the same connection, runs in its own thread, so
/// a long call blocks no other and responses come in any order; calls that only wait (MethodTable::mark_waiting()) take
/// no other call's place, up to ServerLimits::max_waiting_calls. Calls that compute for long (MethodTable::mark_slow())
/// have threads of their own and keep no other call waiting, whatever their number. All network input is bounded by
/// ServerOptions::limits: a client that exceeds them is disconnected; others are not affected.
class Server {
 public:
  /// Receives one line for each connection that is closed or refused, with the reason, and for each error that its
  /// client may not see. Called by the thread in run() or by a worker.
  using Log = std::function<void(const std::string& line)>;
  /// Makes a call in place of MethodTable::call(), from any thread. `client`: number of the connection, from 1.
  using Caller = std::function<Response(const MethodTable& methods, std::uint64_t client, const Request& request)>;

  /// Starts listening. Throws InputError if that address and port cannot be used.
  Server(MethodTable methods, const ServerOptions& options, Log log = {}, Caller caller = {});
  /// Waits for running calls.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;

  /// Serves until stop(), then closes all connections. Running calls continue.
  void run();
  /// May be called from any thread.
  void stop();
  /// Lets SIGINT and SIGTERM stop the server from now on instead of ending the process.
  void stop_at_signals();

  ServerStatistics statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::rpc
