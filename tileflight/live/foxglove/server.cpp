#include "tileflight/live/foxglove/server.h"

#include <algorithm>

#include "tileflight/live/foxglove/socket_events.h"

namespace tileflight::foxglove {

Server::Server(const ServerOptions& options, ParameterAccess parameters, Log log)
    : impl_(std::make_unique<Impl>(options, std::move(parameters), std::move(log))) {
  impl_->listen();
  impl_->thread = std::jthread([impl = impl_.get()] { impl->run(); });
}

Server::~Server() { impl_->stop(); }

std::uint16_t Server::port() const { return impl_->port; }

ChannelId Server::add_channel(Channel channel) {
  const std::lock_guard lock(impl_->mutex);
  const ChannelId id = impl_->next_channel++;
  for (auto& [socket, connection] : impl_->connections) connection.session().advertise(id, channel);
  impl_->channels.emplace(id, OpenChannel{std::move(channel), 0, nullptr});
  lws_cancel_service(impl_->context);
  return id;
}

void Server::remove_channel(ChannelId channel) {
  const std::lock_guard lock(impl_->mutex);
  if (impl_->channels.erase(channel) == 0) return;
  for (auto& [socket, connection] : impl_->connections) connection.session().unadvertise(channel);
  ++impl_->changes;
  lws_cancel_service(impl_->context);
}

bool Server::is_subscribed(ChannelId channel) const {
  const std::lock_guard lock(impl_->mutex);
  return std::ranges::any_of(impl_->connections,
                             [&](const auto& one) { return one.second.session().is_subscribed(channel); });
}

std::uint64_t Server::subscription_changes() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->changes;
}

bool Server::wait_for_subscriber(const std::stop_token& stop) const {
  std::unique_lock lock(impl_->mutex);
  impl_->changed.wait(lock, stop, [this] {
    return std::ranges::any_of(impl_->connections,
                               [](const auto& one) { return one.second.session().has_subscriptions(); });
  });
  return !stop.stop_requested();
}

void Server::publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) {
  if (bytes.size() > impl_->options.queue.max_bytes) return impl_->refuse_message(channel, bytes.size());
  const auto shared = std::make_shared<const std::string>(std::move(bytes));
  const std::lock_guard lock(impl_->mutex);
  const auto at = impl_->channels.find(channel);
  if (at == impl_->channels.end()) return;
  OpenChannel& open = at->second;
  if (open.channel.is_latched) {
    open.time_ns = time_ns;
    open.last = shared;
  }
  const std::size_t share = impl_->options.max_queued_bytes / std::max<std::size_t>(1, impl_->connections.size());
  for (auto& [socket, connection] : impl_->connections)
    connection.session().offer({channel, time_ns, shared}, open.channel.is_latched, share);
  lws_cancel_service(impl_->context);
}

void Server::publish_time(std::uint64_t time_ns) {
  const std::lock_guard lock(impl_->mutex);
  for (auto& [socket, connection] : impl_->connections) connection.session().offer_time(time_ns);
  lws_cancel_service(impl_->context);
}

void Server::warn(const std::string& text) {
  const std::lock_guard lock(impl_->mutex);
  impl_->for_each_session([&](ClientSession& session) { session.send_status(StatusLevel::kWarning, text); });
  lws_cancel_service(impl_->context);
}

void Server::wait_until_sent(std::chrono::milliseconds limit) const {
  std::unique_lock lock(impl_->mutex);
  impl_->changed.wait_for(lock, limit, [this] {
    return std::ranges::none_of(impl_->connections, [](const auto& one) { return one.second.has_unsent(); });
  });
}

ServerStatistics Server::statistics() const {
  const std::lock_guard lock(impl_->mutex);
  return {impl_->connections.size(), impl_->refused, impl_->dropped_now()};
}

}  // namespace tileflight::foxglove
