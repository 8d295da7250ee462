#pragma once

#include <array>
#include <asio.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "tileflight/rpc/message_scanner.h"
#include "tileflight/rpc/record.h"
#include "tileflight/rpc/server.h"
#include "tileflight/rpc/worker_pool.h"

namespace tileflight::rpc {

/// What the connections of a server share.
struct Service {
  asio::io_context& network;
  const MethodTable& methods;
  const ServerOptions& options;
  WorkerPool& workers;
  Record& record;
  Server::Log log;
  std::function<void()> held_more;                   ///< a connection holds more bytes than before
  std::function<void(class Connection*)> forgotten;  ///< a connection is closed
};

/// One client. Everything but answer_in_worker() runs in the one thread of the network. The way of a request:
/// buffer_ (bytes) -> waiting_ (whole messages) -> a worker -> answers_ (bytes) -> the socket.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(asio::ip::tcp::socket socket, Service& service);

  void start();
  /// Closes it if it has held a message, an answer or its token back for too long.
  void check_time(double now_s);
  /// Closes it; with a reason, that is logged.
  void close(const std::string& reason = {});
  /// The client has said that it sends no more; it is closed once it has its answers.
  bool has_ended() const { return ended_; }
  /// Bytes of messages and answers that are in memory for it.
  std::size_t held_bytes() const { return held_bytes_; }

 private:
  using Message = std::shared_ptr<std::string>;

  void read();
  void finish_reading();
  void take_messages();
  void go_on();
  void take_message(std::string message);
  bool authenticate(const std::string& message);
  void start_waiting();
  void answer_in_worker(std::string message);
  void queue_answer(std::string bytes);
  void finish_call(std::size_t message_bytes, std::string answer);
  void write();
  void hold(std::size_t bytes);
  void release(std::size_t bytes);
  std::size_t pending() const { return waiting_.size() + running_ + answers_.size(); }
  const MessageLimits& message_limits() const;

  asio::ip::tcp::socket socket_;
  Service& service_;
  std::string client_;  ///< address and port, for the log
  bool open_ = true;
  bool trusted_;
  bool reading_ = false;
  bool ended_ = false;

  std::array<char, 64 * 1024> chunk_;
  std::string buffer_;
  MessageScanner scanner_;
  std::deque<std::string> waiting_;
  std::size_t running_ = 0;
  std::deque<std::string> answers_;  ///< the first is being written
  std::size_t queued_bytes_ = 0;     ///< of answers_
  std::size_t written_ = 0;          ///< of the first
  std::size_t held_bytes_ = 0;

  double begun_s_;                         ///< when the client came
  std::optional<double> message_begun_s_;  ///< of the message whose first bytes are in buffer_
  std::optional<double> last_write_s_;     ///< when the client last took something of an answer that waits
};

}  // namespace tileflight::rpc
