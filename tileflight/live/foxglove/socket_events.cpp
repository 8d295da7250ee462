#include "tileflight/live/foxglove/socket_events.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::foxglove {
namespace {

constexpr std::size_t kFragmentBytes = std::size_t{256} << 10U;

/// Copies the bytes from `from` on of head and body, as many as fit.
std::size_t copy_part(const OutgoingMessage& message, std::size_t from, unsigned char* to, std::size_t room) {
  std::size_t copied = 0;
  const auto take = [&](std::string_view bytes, std::size_t offset) {
    if (offset >= bytes.size()) return;
    const std::string_view part = bytes.substr(offset, room - copied);
    std::ranges::copy(part, to + copied);
    copied += part.size();
  };
  take(message.head, from);
  if (message.body) take(*message.body, from > message.head.size() ? from - message.head.size() : 0);
  return copied;
}

}  // namespace

Connection::Connection(lws* socket, ClientSession session)
    : socket_(socket), session_(std::move(session)), scratch_(LWS_PRE + kFragmentBytes) {}

std::optional<std::string> Connection::receive(std::string_view fragment, std::size_t max_bytes) {
  if (lws_frame_is_binary(socket_) != 0) throw ProtocolError("sends binary messages, of which this server takes none");
  if (received_.size() + fragment.size() + lws_remaining_packet_payload(socket_) > max_bytes)
    throw ProtocolError("sends a message of more than " + std::to_string(max_bytes) + " bytes");
  received_ += fragment;
  if (lws_is_final_fragment(socket_) == 0 || lws_remaining_packet_payload(socket_) != 0) return std::nullopt;
  return std::exchange(received_, {});
}

bool Connection::send() {
  do {
    if (!current_) {
      current_ = session_.next();
      sent_ = 0;
      if (!current_) return true;
    }
    if (!send_fragment()) return false;
    progress_ = std::chrono::steady_clock::now();
  } while (lws_send_pipe_choked(socket_) == 0);
  if (has_unsent()) lws_callback_on_writable(socket_);
  return true;
}

bool Connection::send_fragment() {
  unsigned char* payload = scratch_.data() + LWS_PRE;
  const std::size_t bytes = copy_part(*current_, sent_, payload, kFragmentBytes);
  const bool is_first = sent_ == 0;
  sent_ += bytes;
  const bool is_last = sent_ == current_->size();
  const lws_write_protocol kind = current_->is_text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY;
  const int flags = lws_write_ws_flags(kind, is_first ? 1 : 0, is_last ? 1 : 0);
  if (is_last) current_.reset();
  return lws_write(socket_, payload, bytes, static_cast<lws_write_protocol>(flags)) >= static_cast<int>(bytes);
}

std::chrono::steady_clock::duration Connection::since_progress() const {
  return std::chrono::steady_clock::now() - progress_;
}

namespace {

using std::chrono::milliseconds;

constexpr int kHandshake_s = 10;       ///< for a connection to become a WebSocket
constexpr milliseconds kGoodbye{500};  ///< for clients to answer the goodbye
constexpr std::size_t kReadBytes = std::size_t{64} << 10U;
constexpr std::size_t kWriteBytes = std::size_t{1} << 20U;  ///< at once
constexpr unsigned kSpareConnections = 32;  ///< beyond the clients: those that are refused, or ask for something else

/// Returns the address of a connection's peer, or "(gone)".
std::string peer_of(lws* socket) {
  std::array<char, 64> name{};
  const bool is_known = lws_get_peer_simple(socket, name.data(), name.size()) != nullptr;
  return is_known ? name.data() : "(gone)";
}

std::string new_session_id() {
  return std::to_string(std::chrono::system_clock::now().time_since_epoch() / milliseconds(1));
}

}  // namespace

Server::Impl::Impl(const ServerOptions& server_options, ParameterAccess access, Log log_line)
    : options(server_options), parameters(std::move(access)), log(std::move(log_line)), session_id(new_session_id()) {}

namespace {

/// Whether a socket can listen at a numeric address; true for another kind of address, which the library resolves.
bool can_bind(const std::string& address, std::uint16_t port) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) return true;
  const int one = 1, socket_number = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  bool bound = false;
  if (socket_number >= 0) {
    setsockopt(socket_number, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
    bound = bind(socket_number, found->ai_addr, found->ai_addrlen) == 0 && ::listen(socket_number, 1) == 0;
    close(socket_number);
  }
  freeaddrinfo(found);
  return bound;
}

}  // namespace

/// The library writes to stderr by itself, unless it is told not to: what matters to a user is logged here.
void Server::Impl::listen() {
  lws_set_log_level(0, nullptr);
  // The first is for clients that ask for no sub-protocol of these: they are refused.
  static const std::array<lws_protocols, 4> kProtocols{
      {{"http-only", &dispatch, 0, kReadBytes, 0, nullptr, kWriteBytes},
       {"foxglove.sdk.v1", &dispatch, 0, kReadBytes, 1, nullptr, kWriteBytes},
       {"foxglove.websocket.v1", &dispatch, 0, kReadBytes, 2, nullptr, kWriteBytes},
       {nullptr, nullptr, 0, 0, 0, nullptr, 0}}};
  lws_context_creation_info info{};
  info.port = options.port;
  const bool is_ipv6 = options.address.find(':') != std::string::npos;
  const bool is_any = options.address == "0.0.0.0" || options.address == "::";
  const std::string address = options.address == "localhost" ? "127.0.0.1" : options.address;
  info.iface = is_any ? nullptr : address.c_str();
  info.protocols = kProtocols.data();
  info.gid = info.uid = -1;
  info.user = this;
  info.timeout_secs = kHandshake_s;
  info.timeout_secs_ah_idle = kHandshake_s;
  info.max_http_header_pool = static_cast<unsigned short>(options.max_clients + kSpareConnections);
  info.fd_limit_per_thread = static_cast<unsigned>(options.max_clients) + kSpareConnections;
  info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND;
  if (!is_ipv6) info.options |= LWS_SERVER_OPTION_DISABLE_IPV6;
  // Version 4.3.5 (Debian 13) waits without end for an address that is none of this machine.
  if (can_bind(address, options.port)) context = lws_create_context(&info);
  lws_vhost* host = context != nullptr ? lws_create_vhost(context, &info) : nullptr;
  port = host != nullptr ? static_cast<std::uint16_t>(std::max(0, lws_get_vhost_listen_port(host))) : 0;
  if (port != 0) return;
  if (context != nullptr) lws_context_destroy(context);
  throw InputError(options.address + ":" + std::to_string(options.port),
                   "cannot listen there; the port may be in use, or the address is none of this machine");
}

void Server::Impl::run() {
  for (;;) {
    {
      const std::lock_guard lock(mutex);
      if (is_over) return;
    }
    lws_service(context, 0);
  }
}

void Server::Impl::stop() {
  std::unique_lock lock(mutex);
  is_stopping = true;
  for (auto& [socket, connection] : connections) connection.is_leaving = true;
  lws_cancel_service(context);
  changed.wait_for(lock, kGoodbye, [this] { return connections.empty(); });
  is_over = true;
  lock.unlock();
  lws_cancel_service(context);
  thread.join();
  lws_context_destroy(context);
}

int Server::Impl::dispatch(lws* socket, lws_callback_reasons reason, void* /*user*/, void* in, std::size_t size) {
  auto* self = static_cast<Impl*>(lws_context_user(lws_get_context(socket)));
  return self->handle(socket, reason, {static_cast<const char*>(in), in != nullptr ? size : 0});
}

int Server::Impl::handle(lws* socket, lws_callback_reasons reason, std::string_view bytes) {
  switch (reason) {
    case LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED:
      peers[socket].name = peer_of(socket);
      return 0;
    case LWS_CALLBACK_WSI_DESTROY:
      forget_peer(socket);
      return 0;
    case LWS_CALLBACK_HTTP:
      return refuse(socket, "asks for a page; open this address as a Foxglove WebSocket");
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
      return admit(socket);
    case LWS_CALLBACK_ESTABLISHED:
      return open(socket);
    case LWS_CALLBACK_RECEIVE:
      return receive(socket, bytes);
    case LWS_CALLBACK_SERVER_WRITEABLE:
      return send(socket);
    case LWS_CALLBACK_TIMER:
      return check_progress(socket);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
      accept_goodbye(socket);
      return 0;
    case LWS_CALLBACK_CLOSED:
      close(socket);
      return 0;
    case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
      wake_connections();
      return 0;
    default:
      return 0;
  }
}

int Server::Impl::refuse(lws* socket, const std::string& why) {
  peers[socket].is_explained = true;
  log_client(socket, "refused: " + why);
  return -1;
}

int Server::Impl::admit(lws* socket) {
  if (lws_get_protocol(socket)->id == 0)
    return refuse(socket, "asks for neither foxglove.sdk.v1 nor foxglove.websocket.v1");
  {
    const std::lock_guard lock(mutex);
    if (!is_stopping && connections.size() < options.max_clients) return 0;
    ++refused;
  }
  return refuse(socket, "there are " + std::to_string(options.max_clients) + " clients already");
}

int Server::Impl::open(lws* socket) {
  peers[socket].is_explained = true;
  const std::lock_guard lock(mutex);
  connections.try_emplace(socket, socket, ClientSession(options.name, session_id, channels, parameters, options.queue));
  lws_callback_on_writable(socket);
  lws_set_timer_usecs(socket, std::chrono::microseconds(options.max_silence).count());
  return 0;
}

int Server::Impl::receive(lws* socket, std::string_view fragment) {
  std::string fault;
  {
    const std::lock_guard lock(mutex);
    Connection& connection = connections.at(socket);
    try {
      const std::optional<std::string> text = connection.receive(fragment, options.max_message_bytes);
      if (!text) return 0;
      const std::vector<std::string> set = connection.session().receive(*text);
      if (!set.empty()) for_each_session([all = parameters.read()](ClientSession& one) { one.offer_parameters(all); });
      ++changes;
      changed.notify_all();
    } catch (const ProtocolError& error) {
      fault = error.what();
      connection.is_explained = true;
    }
  }
  if (fault.empty()) {
    wake_connections();
    return 0;
  }
  log_client(socket, "closed: " + fault);
  lws_close_reason(socket, LWS_CLOSE_STATUS_POLICY_VIOLATION, nullptr, 0);
  return -1;
}

int Server::Impl::send(lws* socket) {
  const std::lock_guard lock(mutex);
  Connection& connection = connections.at(socket);
  if (connection.is_leaving) {
    lws_close_reason(socket, LWS_CLOSE_STATUS_GOINGAWAY, nullptr, 0);
    return -1;
  }
  if (!connection.send()) return -1;
  if (!connection.has_unsent()) changed.notify_all();
  return 0;
}

/// A client that reads keeps its connection, however slow it is.
int Server::Impl::check_progress(lws* socket) {
  bool is_silent = false;
  {
    const std::lock_guard lock(mutex);
    Connection& connection = connections.at(socket);
    is_silent = connection.has_unsent() && connection.since_progress() >= options.max_silence;
    connection.is_explained = is_silent;
  }
  if (is_silent) {
    log_client(socket, "closed: it does not read");
    return -1;
  }
  lws_set_timer_usecs(socket, std::chrono::microseconds(options.max_silence).count());
  return 0;
}

void Server::Impl::wake_connections() {
  std::vector<std::pair<lws*, std::string>> faulty;
  {
    const std::lock_guard lock(mutex);
    for (auto& [socket, connection] : connections) {
      if (!connection.fault.empty()) {
        connection.is_explained = true;
        faulty.emplace_back(socket, std::exchange(connection.fault, {}));
      }
      if (connection.has_unsent() || connection.is_leaving) lws_callback_on_writable(socket);
    }
  }
  for (const auto& [socket, fault] : faulty) {
    log_client(socket, "closed: " + fault);
    lws_set_timeout(socket, PENDING_TIMEOUT_CLOSE_SEND, LWS_TO_KILL_ASYNC);
  }
}

/// Told once of each channel, to the log and to viewers: it would wait for a place that it cannot get.
void Server::Impl::refuse_message(ChannelId channel, std::size_t bytes) {
  std::string line;
  {
    const std::lock_guard lock(mutex);
    const auto at = channels.find(channel);
    if (at == channels.end() || std::exchange(at->second.is_refusal_told, true)) return;
    line = at->second.channel.topic + ": a message of " + std::to_string(bytes) + " bytes is not sent; at most " +
           std::to_string(options.queue.max_bytes) + " are";
    for_each_session([&](ClientSession& session) { session.send_status(StatusLevel::kWarning, line); });
    lws_cancel_service(context);
  }
  if (log) log("foxglove: " + line);
}

void Server::Impl::accept_goodbye(lws* socket) {
  const std::lock_guard lock(mutex);
  connections.at(socket).is_explained = true;
}

/// The library itself closes connections that break the rules of WebSockets (RFC 6455).
void Server::Impl::close(lws* socket) {
  bool is_explained = false;
  {
    const std::lock_guard lock(mutex);
    const auto at = connections.find(socket);
    if (at == connections.end()) return;
    is_explained = at->second.is_explained || is_stopping;
    dropped += at->second.session().dropped();
    connections.erase(at);
    ++changes;
    changed.notify_all();
  }
  if (!is_explained)
    log_client(socket, "is gone without a goodbye: the connection broke, or it broke the rules of WebSockets");
}

/// The last that is heard of a socket; those of the server itself were never a peer's.
void Server::Impl::forget_peer(lws* socket) {
  const auto peer = peers.find(socket);
  if (peer == peers.end()) return;
  if (!peer->second.is_explained) log_client(socket, "closed: it did not become a WebSocket");
  peers.erase(peer);
}

}  // namespace tileflight::foxglove
