#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "tileflight/rpc/limits.h"
#include "tileflight/rpc/method_table.h"

namespace tileflight::rpc {

struct ServerOptions {
  std::string address = "127.0.0.1";  ///< of this machine, or "localhost"; 0.0.0.0 or :: for all of its networks
  std::uint16_t port = 0;             ///< 0: any free one
  /// What a client must send first, as the only argument of the method below; empty: nothing is asked for.
  std::string token;
  std::string token_method = "authenticate";
  Limits limits;
};

/// What one method has done since the start.
struct MethodStatistics {
  std::uint64_t calls = 0;
  std::uint64_t errors = 0;
  double seconds = 0.0;  ///< of the method itself: without decoding, encoding, waiting and network
};

struct ServerStatistics {
  std::uint64_t connections = 0;           ///< open now
  std::uint64_t connections_accepted = 0;  ///< since the start
  std::uint64_t connections_refused = 0;   ///< for there were too many
  std::uint64_t connections_cut = 0;       ///< closed by the server, for a reason that was logged
  std::uint64_t requests = 0;              ///< that have come, since the start
  std::uint64_t answers = 0;
  std::uint64_t running = 0;     ///< requests that a worker is at
  std::uint64_t workers = 0;     ///< threads
  std::uint64_t held_bytes = 0;  ///< messages that are not answered and answers that are not read
  std::map<std::string, MethodStatistics> methods;
};

/// Whether only programs on this machine can reach a server there. Throws InputError for what is no address.
bool is_loopback(const std::string& address);

/// Serves a table of methods by msgpack-rpc over TCP. Each request, also of one connection, runs in a thread of its
/// own, so a long call holds up nobody and answers come in any order. Whatever comes over the network is bounded by
/// ServerOptions::limits: a client that goes beyond is cut, the others do not notice.
class Server {
 public:
  /// Told one line of each connection that is cut or refused and why. Called by the thread in run() or by a worker.
  using Log = std::function<void(const std::string& line)>;

  /// Listens from here on. Throws InputError if that address and port cannot be listened at.
  Server(MethodTable methods, const ServerOptions& options, Log log = {});
  /// Waits for the calls that are running.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;

  /// Serves until stop(); then all connections are closed. Calls that are running go on.
  void run();
  /// Any thread.
  void stop();
  /// From here on SIGINT and SIGTERM stop the server instead of ending the process.
  void stop_at_signals();

  ServerStatistics statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::rpc
