#include "tileflight/rpc/server.h"

#include <algorithm>
#include <asio.hpp>
#include <chrono>
#include <csignal>
#include <set>

#include "tileflight/geometry/input_error.h"
#include "tileflight/rpc/connection.h"
#include "tileflight/rpc/record.h"
#include "tileflight/rpc/worker_pool.h"

namespace tileflight::rpc {
namespace {

using asio::ip::tcp;

asio::ip::address address_of(const std::string& text) {
  if (text == "localhost") return asio::ip::address_v4::loopback();
  asio::error_code fault;
  const asio::ip::address address = asio::ip::make_address(text, fault);
  if (fault)
    throw InputError("address " + text, "is no IPv4 or IPv6 address of this machine (127.0.0.1, 0.0.0.0, ::1)");
  return address;
}

tcp::acceptor listening(asio::io_context& network, const ServerOptions& options) {
  const tcp::endpoint endpoint(address_of(options.address), options.port);
  try {
    tcp::acceptor acceptor(network);
    acceptor.open(endpoint.protocol());
    acceptor.set_option(asio::socket_base::reuse_address(true));
    acceptor.bind(endpoint);
    acceptor.listen();
    return acceptor;
  } catch (const asio::system_error& fault) {
    throw InputError("port " + std::to_string(options.port) + " of " + options.address,
                     "cannot be listened at (" + fault.code().message() + "); choose another one (0: any free one)");
  }
}

/// How often the limits of time are looked at.
double tick_s(const Limits& limits) {
  return std::clamp(0.25 * std::min({limits.half_message_s, limits.unread_answer_s, limits.token_s}), 0.01, 1.0);
}

}  // namespace

bool is_loopback(const std::string& address) { return address_of(address).is_loopback(); }

struct Server::Impl {
  Impl(MethodTable table, const ServerOptions& server_options, Server::Log log)
      : methods(std::move(table)),
        options(server_options),
        acceptor(listening(network, options)),
        timer(network),
        workers(options.limits.max_workers, options.limits.idle_worker_s),
        service{network,
                methods,
                options,
                workers,
                record,
                std::move(log),
                [this] { cut_greediest(); },
                [this](Connection* connection) { forget(connection); }} {}

  void accept();
  void add(tcp::socket socket);
  void give_way();
  void tick();
  void cut_greediest();
  void forget(Connection* connection);
  void close_all();

  MethodTable methods;
  ServerOptions options;
  asio::io_context network{1};
  tcp::acceptor acceptor;
  asio::steady_timer timer;
  asio::signal_set signals{network};
  Record record;
  std::set<std::shared_ptr<Connection>> connections;
  WorkerPool workers;  ///< after what its work uses, so that it ends first
  Service service;
  bool accepting = false;
  bool stopping = false;
};

void Server::Impl::accept() {
  accepting = true;
  acceptor.async_accept([this](asio::error_code fault, tcp::socket socket) {
    accepting = false;
    if (stopping) return;
    if (fault) {  // the client has gone already, or there are no file descriptors left: tick() tries again
      if (service.log) service.log("a client could not be accepted: " + fault.message());
      return;
    }
    add(std::move(socket));
    accept();
  });
}

void Server::Impl::add(tcp::socket socket) {
  if (connections.size() >= options.limits.max_connections) give_way();
  if (connections.size() >= options.limits.max_connections) {
    ++record.refused;
    if (service.log) service.log("a client was refused: there are " + std::to_string(connections.size()) + " already");
    return;
  }
  const auto connection = std::make_shared<Connection>(std::move(socket), service);
  connections.insert(connection);
  ++record.accepted;
  record.connections = connections.size();
  connection->start();
}

/// Of clients that send no more, one that waits for an answer cannot be told from one that is gone.
void Server::Impl::give_way() {
  const auto ended = std::ranges::find_if(connections, [](const auto& one) { return one->has_ended(); });
  if (ended == connections.end()) return;
  const std::shared_ptr<Connection> one = *ended;
  one->close("it sends no more, and another client wants its place");
}

void Server::Impl::tick() {
  timer.expires_after(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(tick_s(options.limits))));
  timer.async_wait([this](asio::error_code) {
    if (stopping) return;
    if (!accepting) accept();
    const auto all = connections;  // those that are closed leave the set
    for (const auto& connection : all) connection->check_time(steady_seconds());
    tick();
  });
}

void Server::Impl::cut_greediest() {
  while (record.held_bytes > options.limits.max_held_bytes && !connections.empty()) {
    const auto greediest = *std::ranges::max_element(
        connections, {}, [](const std::shared_ptr<Connection>& connection) { return connection->held_bytes(); });
    greediest->close("it holds " + std::to_string(greediest->held_bytes()) + " of the " +
                     std::to_string(record.held_bytes) + " bytes that wait");
  }
}

void Server::Impl::forget(Connection* connection) {
  std::erase_if(connections, [&](const std::shared_ptr<Connection>& one) { return one.get() == connection; });
  record.connections = connections.size();
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

Server::Server(MethodTable methods, const ServerOptions& options, Log log)
    : impl_(std::make_unique<Impl>(std::move(methods), options, std::move(log))) {}

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
  ServerStatistics result = impl_->record.snapshot();
  result.workers = impl_->workers.counts().workers;
  return result;
}

}  // namespace tileflight::rpc
