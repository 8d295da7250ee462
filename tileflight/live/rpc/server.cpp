#include "tileflight/live/rpc/server.h"

#include <algorithm>
#include <asio.hpp>
#include <chrono>
#include <csignal>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/rpc/connection.h"
#include "tileflight/live/rpc/worker_pool.h"

namespace tileflight::rpc {
namespace {

using asio::ip::tcp;

asio::ip::address parse_address(const std::string& text) {
  if (text == "localhost") return asio::ip::address_v4::loopback();
  asio::error_code fault;
  const asio::ip::address address = asio::ip::make_address(text, fault);
  if (fault)
    throw InputError("address " + text,
                     "is not an IPv4 or IPv6 address of this machine (such as 127.0.0.1, 0.0.0.0, ::1)");
  return address;
}

tcp::acceptor open_acceptor(asio::io_context& network, const ServerOptions& options) {
  const tcp::endpoint endpoint(parse_address(options.address), options.port);
  try {
    tcp::acceptor acceptor(network);
    acceptor.open(endpoint.protocol());
    acceptor.set_option(asio::socket_base::reuse_address(true));
    acceptor.bind(endpoint);
    acceptor.listen();
    return acceptor;
  } catch (const asio::system_error& fault) {
    throw InputError("port " + std::to_string(options.port) + " of " + options.address,
                     "cannot listen on it (" + fault.code().message() + "); choose another port (0: any free one)");
  }
}

/// Interval at which time limits are checked.
double timer_period_s(const ServerLimits& limits) {
  return std::clamp(
      0.25 * std::min({limits.message_timeout_s, limits.write_timeout_s, limits.authentication_timeout_s}), 0.01, 1.0);
}

}  // namespace

bool is_loopback(const std::string& address) { return parse_address(address).is_loopback(); }

struct Server::Impl {
  Impl(MethodTable table, const ServerOptions& server_options, Server::Log log, Server::Caller caller)
      : methods(std::move(table)),
        options(server_options),
        acceptor(open_acceptor(network, options)),
        timer(network),
        workers(options.limits.max_workers, options.limits.max_waiting_calls, options.limits.worker_idle_timeout_s),
        slow_workers(options.limits.max_workers, 0, options.limits.worker_idle_timeout_s),
        context{network,
                methods,
                options,
                workers,
                slow_workers,
                counters,
                std::move(log),
                std::move(caller),
                [this] { close_largest_holder(); },
                [this](Connection* connection) { remove_connection(connection); }} {}

  void accept();
  void add(tcp::socket socket);
  void evict_finished_client();
  void tick();
  void close_largest_holder();
  void remove_connection(Connection* connection);
  void close_all();

  MethodTable methods;
  ServerOptions options;
  asio::io_context network{1};
  tcp::acceptor acceptor;
  asio::steady_timer timer;
  asio::signal_set signals{network};
  ServerCounters counters;
  std::set<std::shared_ptr<Connection>> connections;
  WorkerPool workers;  ///< declared after the members that its work uses, so that it is destroyed first
  WorkerPool slow_workers;
  ServerContext context;
  bool accepting = false;
  bool stopping = false;
};

void Server::Impl::accept() {
  accepting = true;
  acceptor.async_accept([this](asio::error_code fault, tcp::socket socket) {
    accepting = false;
    if (stopping) return;
    if (fault) {  // the client has disconnected, or file descriptors are exhausted: tick() tries again
      if (context.log) context.log("a client could not be accepted: " + fault.message());
      return;
    }
    add(std::move(socket));
    accept();
  });
}

void Server::Impl::add(tcp::socket socket) {
  if (connections.size() >= options.limits.max_connections) evict_finished_client();
  if (connections.size() >= options.limits.max_connections) {
    ++counters.refused;
    if (context.log) context.log("a client was refused: there are " + std::to_string(connections.size()) + " already");
    return;
  }
  const auto connection = std::make_shared<Connection>(std::move(socket), context, ++counters.accepted);
  connections.insert(connection);
  counters.connections = connections.size();
  connection->start();
}

/// Among clients that have finished sending, one that waits for a response cannot be distinguished from a lost one.
void Server::Impl::evict_finished_client() {
  const auto ended = std::ranges::find_if(connections, [](const auto& one) { return one->has_finished_sending(); });
  if (ended == connections.end()) return;
  const std::shared_ptr<Connection> kept =
      *ended;  // NOLINT(performance-unnecessary-copy-initialization): closing erases it
  kept->close("idle, and another client needs its connection");
}

void Server::Impl::tick() {
  timer.expires_after(std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(timer_period_s(options.limits))));
  timer.async_wait([this](asio::error_code) {
    if (stopping) return;
    if (!accepting) accept();
    const auto all = connections;  // a copy, because closed connections are removed from the set
    for (const auto& connection : all) connection->check_timeouts(steady_seconds());
    tick();
  });
}

void Server::Impl::close_largest_holder() {
  while (counters.held_bytes > options.limits.max_held_bytes && !connections.empty()) {
    const auto greediest = *std::ranges::max_element(
        connections, {}, [](const std::shared_ptr<Connection>& connection) { return connection->held_bytes(); });
    greediest->close("it holds " + std::to_string(greediest->held_bytes()) + " of the " +
                     std::to_string(counters.held_bytes) + " bytes waiting to be sent");
  }
}

void Server::Impl::remove_connection(Connection* connection) {
  std::erase_if(connections, [&](const std::shared_ptr<Connection>& one) { return one.get() == connection; });
  counters.connections = connections.size();
}

void Server::Impl::close_all() {
  stopping = true;
  asio::error_code ignored;
  acceptor.close(ignored);
  timer.cancel();
  signals.cancel(ignored);
  const auto all = connections;
  for (const auto& connection : all) connection->close();
}

Server::Server(MethodTable methods, const ServerOptions& options, Log log, Caller caller)
    : impl_(std::make_unique<Impl>(std::move(methods), options, std::move(log), std::move(caller))) {}

Server::~Server() = default;

std::uint16_t Server::port() const { return impl_->acceptor.local_endpoint().port(); }

void Server::run() {
  asio::post(impl_->network, [this] {
    if (impl_->stopping) return;
    impl_->accept();
    impl_->tick();
  });
  impl_->network.run();
}

void Server::stop() {
  asio::post(impl_->network, [impl = impl_.get()] { impl->close_all(); });
}

void Server::stop_at_signals() {
  impl_->signals.add(SIGINT);
  impl_->signals.add(SIGTERM);
  impl_->signals.async_wait([impl = impl_.get()](asio::error_code fault, int) {
    if (!fault) impl->close_all();
  });
}

ServerStatistics Server::statistics() const {
  ServerStatistics result = impl_->counters.snapshot();
  result.workers = impl_->workers.workers() + impl_->slow_workers.workers();
  return result;
}

}  // namespace tileflight::rpc
