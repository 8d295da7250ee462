#pragma once

#include <array>
#include <asio.hpp>
#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "tileflight/live/rpc/message_scanner.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/rpc/worker_pool.h"

namespace tileflight::rpc {

/// Thread-safe counters of the server.
class ServerCounters {
 public:
  std::atomic<std::uint64_t> connections{0}, accepted{0}, refused{0}, cut{0}, requests{0}, answers{0}, running{0},
      held_bytes{0};

  /// `method`: one of the table's names (arbitrary names chosen by clients would grow the map without bound).
  void add_call(const std::string& method, bool failed, double seconds) {
    const std::lock_guard lock(mutex_);
    MethodStatistics& entry = methods_[method];
    ++entry.calls;
    entry.errors += failed ? 1 : 0;
    entry.seconds += seconds;
  }

  ServerStatistics snapshot() const {
    ServerStatistics result{.connections = connections,
                            .connections_accepted = accepted,
                            .connections_refused = refused,
                            .connections_cut = cut,
                            .requests = requests,
                            .answers = answers,
                            .running = running,
                            .held_bytes = held_bytes};
    const std::lock_guard lock(mutex_);
    result.methods = methods_;
    return result;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, MethodStatistics> methods_;
};

/// Compares a client's token in a time that depends only on the length of `presented`, so that timing reveals nothing
/// about partial matches.
bool equal_in_constant_time(std::string_view presented, std::string_view right);

/// State shared by all connections of a server.
struct ServerContext {
  asio::io_context& network;
  const MethodTable& methods;
  const ServerOptions& options;
  WorkerPool& workers;
  WorkerPool& slow_workers;
  ServerCounters& counters;
  Server::Log log;
  Server::Caller caller;
  std::function<void()> on_bytes_held;               ///< called when a connection holds more bytes than before
  std::function<void(class Connection*)> on_closed;  ///< called when a connection is closed
};

/// One client connection. Everything except execute_in_worker() and what it calls runs in the network thread. Path of a
/// request: buffer_ (bytes) -> a lane (whole messages) -> a worker -> responses_ (bytes) -> the socket.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  /// `number`: number of the connection, from 1.
  Connection(asio::ip::tcp::socket socket, ServerContext& service, std::uint64_t number);

  void start();
  /// Closes the connection if its message, its reading of a response or its token is overdue.
  void check_timeouts(double now_s);
  /// Closes the connection; a non-empty reason is logged.
  void close(const std::string& reason = {});
  /// The client has finished sending; the connection is closed once its responses are delivered.
  bool has_finished_sending() const { return finished_sending_; }
  /// Bytes of this connection's messages and responses in memory.
  std::size_t held_bytes() const { return held_bytes_; }

 private:
  void read();
  void finish_reading();
  void take_messages();
  void continue_reading();
  void take_message(std::string message);
  bool authenticate(const std::string& message);
  struct Lane;
  void start_queued_requests();
  void start_queued_requests(Lane& lane);
  void log_error(const std::string& error);
  void execute_in_worker(Lane& lane, std::string message);
  Response call(const Request& request);
  Response call_that_waits(const Request& request);
  void park_call();
  void queue_response(std::string bytes);
  void finish_call(std::size_t& place, std::size_t message_bytes, std::string answer);
  void write();
  void hold(std::size_t bytes);
  void release(std::size_t bytes);
  bool is_full() const;
  bool has_requests() const;
  const MessageLimits& message_limits() const;

  asio::ip::tcp::socket socket_;
  ServerContext& service_;
  std::uint64_t number_;
  std::string client_;  ///< address and port, for the log
  bool open_ = true;
  bool authenticated_;
  bool reading_ = false;
  bool finished_sending_ = false;

  std::array<char, 64 * 1024> chunk_;
  std::string buffer_;
  MessageScanner scanner_;
  /// Queues requests that share a number of places.
  struct Lane {
    WorkerPool& workers;
    std::deque<std::string> waiting;
    std::size_t running = 0;
    std::size_t pending() const { return waiting.size() + running; }
  };
  Lane quick_;
  Lane slow_;                          ///< they compute for long, and keep no quick one waiting
  std::size_t parked_ = 0;             ///< calls that only wait; not in a lane
  std::deque<std::string> responses_;  ///< the first one is being written
  std::size_t queued_bytes_ = 0;       ///< of responses_
  std::size_t written_ = 0;            ///< of the first response
  std::size_t held_bytes_ = 0;

  std::atomic<int> errors_logged_{0};

  double begun_s_;                         ///< when the client connected
  std::optional<double> message_begun_s_;  ///< of the message whose first bytes are in buffer_
  std::optional<double> last_write_s_;     ///< when the client last read part of a pending response
};

}  // namespace tileflight::rpc
