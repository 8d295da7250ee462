#include "tileflight/live/rpc/connection.h"

#include <netinet/tcp.h>

#include <cstdint>

#include "tileflight/live/rpc/method_table.h"

namespace tileflight::rpc {

bool equal_in_constant_time(std::string_view presented, std::string_view right) {
  volatile std::uint8_t different = presented.size() == right.size() && !right.empty() ? 0 : 1;
  for (std::size_t i = 0; i < presented.size(); ++i) {
    const char other = right.empty() ? '\0' : right[i % right.size()];
    different = static_cast<std::uint8_t>(different | static_cast<std::uint8_t>(presented[i] ^ other));
  }
  return different == 0;
}

namespace {

std::string endpoint_text(const asio::ip::tcp::socket& socket) {
  asio::error_code gone;
  const asio::ip::tcp::endpoint endpoint = socket.remote_endpoint(gone);
  return gone ? "a client" : endpoint.address().to_string() + ":" + std::to_string(endpoint.port());
}

std::string seconds_text(double seconds) {
  std::string text = std::to_string(seconds);
  return text.substr(0, text.find('.') + 2) + " s";
}

/// Detects a silently lost client in two minutes, not in the usual two hours.
void enable_keepalive(asio::ip::tcp::socket& socket) {
  using Seconds = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPIDLE>;
  using Interval = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPINTVL>;
  asio::error_code ignored;
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  socket.set_option(Seconds(60), ignored);
  socket.set_option(Interval(10), ignored);
}

}  // namespace

Connection::Connection(asio::ip::tcp::socket socket, ServerContext& service, std::uint64_t number)
    : socket_(std::move(socket)),
      service_(service),
      number_(number),
      client_(endpoint_text(socket_)),
      authenticated_(service.options.token.empty()),
      scanner_(message_limits()),
      quick_{service.workers, {}, 0},
      slow_{service.slow_workers, {}, 0},
      begun_s_(steady_seconds()) {
  asio::error_code ignored;
  socket_.set_option(asio::ip::tcp::no_delay(true), ignored);
  enable_keepalive(socket_);
}

const MessageLimits& Connection::message_limits() const {
  return authenticated_ ? service_.options.limits.message : service_.options.limits.message_before_authentication;
}

void Connection::start() { read(); }

void Connection::close(const std::string& reason) {
  if (!open_) return;
  open_ = false;
  if (!reason.empty()) {
    ++service_.counters.cut;
    if (service_.log) service_.log(client_ + ": closed: " + reason);
  }
  const auto self = shared_from_this();  // keeps this object alive after it is removed from the server
  release(held_bytes_);
  buffer_ = {};
  quick_.waiting.clear();
  slow_.waiting.clear();
  service_.on_closed(this);
  asio::error_code ignored;
  socket_.close(ignored);  // last, so that a client that sees the close finds the statistics up to date
}

void Connection::check_timeouts(double now_s) {
  const ServerLimits& limits = service_.options.limits;
  if (!authenticated_ && now_s - begun_s_ > limits.authentication_timeout_s)
    return close("no token after " + seconds_text(limits.authentication_timeout_s));
  if (message_begun_s_ && now_s - *message_begun_s_ > limits.message_timeout_s) {
    return close("incomplete message after " + seconds_text(limits.message_timeout_s));
  }
  if (last_write_s_ && now_s - *last_write_s_ > limits.write_timeout_s) {
    close("answer not read after " + seconds_text(limits.write_timeout_s));
  }
}

void Connection::hold(std::size_t bytes) {
  held_bytes_ += bytes;
  service_.counters.held_bytes += bytes;
  service_.on_bytes_held();
}

void Connection::release(std::size_t bytes) {
  held_bytes_ -= bytes;
  service_.counters.held_bytes -= bytes;
}

/// Calls that only wait do not count.
bool Connection::is_full() const {
  const ServerLimits& limits = service_.options.limits;
  return quick_.pending() + responses_.size() >= limits.max_pending_per_connection ||
         slow_.pending() >= limits.max_slow_pending_per_connection;
}

bool Connection::has_requests() const { return quick_.pending() + slow_.pending() + parked_ + responses_.size() > 0; }

void Connection::read() {
  if (!open_ || reading_ || finished_sending_ || is_full()) return;
  reading_ = true;
  socket_.async_read_some(asio::buffer(chunk_), [self = shared_from_this()](asio::error_code fault, std::size_t bytes) {
    self->reading_ = false;
    if (!self->open_) return;
    if (fault == asio::error::eof) return self->finish_reading();
    if (fault) return self->close();
    self->buffer_.append(self->chunk_.data(), bytes);
    self->hold(bytes);
    self->take_messages();
  });
}

/// A client that shuts down its sending side after its last request still expects the responses. A lost client looks
/// the same until something is sent to it or a keep-alive probe fails: then the socket reports an error.
void Connection::finish_reading() {
  finished_sending_ = true;
  socket_.async_wait(asio::ip::tcp::socket::wait_error,
                     [self = shared_from_this()](asio::error_code) { self->close(); });
  take_messages();
}

void Connection::take_messages() {
  std::size_t taken = 0;
  try {
    while (open_ && taken < buffer_.size() && !is_full()) {
      const std::string_view rest = std::string_view(buffer_).substr(taken);
      const std::optional<std::size_t> bytes = scanner_.find_message_end(rest);
      if (!bytes) break;
      scanner_.restart();
      message_begun_s_.reset();
      taken += *bytes;
      take_message(std::string(rest.substr(0, *bytes)));
    }
  } catch (const ProtocolError& fault) {
    return close(fault.what());
  }
  if (!open_) return;
  buffer_.erase(0, taken);
  if (buffer_.empty() && buffer_.capacity() > chunk_.size()) buffer_ = {};
  continue_reading();
}

/// Called after all complete messages that may be taken now have been taken.
void Connection::continue_reading() {
  const bool paused = is_full();
  if (buffer_.empty() || paused || finished_sending_) message_begun_s_.reset();
  if (finished_sending_ && !has_requests()) return close();
  if (!buffer_.empty() && !paused && !finished_sending_ && !message_begun_s_) message_begun_s_ = steady_seconds();
  read();
}

void Connection::take_message(std::string message) {
  if (!authenticated_) {
    const std::size_t bytes = message.size();
    authenticated_ = authenticate(message);
    if (authenticated_) scanner_ = MessageScanner(message_limits());
    if (open_) release(bytes);
    return;
  }
  ++service_.counters.requests;
  Lane& lane = service_.methods.is_slow(method_of(message)) ? slow_ : quick_;
  lane.waiting.push_back(std::move(message));
  start_queued_requests();
}

bool Connection::authenticate(const std::string& message) {
  const Request request(message);
  const std::string& method = service_.options.token_method;
  if (request.method() != method) {
    const std::string error = "tileflight: this server requires a token: call " + method + " first";
    if (request.expects_response()) queue_response(encode_error(request.id(), error));
    return false;
  }
  std::string token;
  try {
    if (request.arguments().size() == 1) token = decode_argument<std::string>(request.arguments(), 0);
  } catch (const DecodeError&) {
    token.clear();  // a value that is not a string is not the token
  }
  if (!equal_in_constant_time(token, service_.options.token)) {
    close("wrong token");
    return false;
  }
  Encoder out;
  out.array(4);
  out.unsigned_integer(1);
  out.unsigned_integer(request.id());
  out.nil();
  out.boolean(true);
  if (request.expects_response()) queue_response(out.take());
  return true;
}

void Connection::start_queued_requests() {
  start_queued_requests(quick_);
  start_queued_requests(slow_);
}

void Connection::start_queued_requests(Lane& lane) {
  while (!lane.waiting.empty() && lane.running < service_.options.limits.max_running_per_connection) {
    ++lane.running;
    lane.workers.submit([self = shared_from_this(), &lane, message = std::move(lane.waiting.front())]() mutable {
      self->execute_in_worker(lane, std::move(message));
    });
    lane.waiting.pop_front();
  }
}

Response Connection::call(const Request& request) {
  return service_.caller ? service_.caller(service_.methods, number_, request) : service_.methods.call(request);
}

/// Its place among the running calls is free while it waits.
Response Connection::call_that_waits(const Request& request) {
  asio::post(service_.network, [self = shared_from_this()] { self->park_call(); });
  struct EndWaiting {
    WorkerPool& workers;
    ~EndWaiting() { workers.end_waiting(); }
  } const end_waiting{service_.workers};
  return call(request);
}

void Connection::park_call() {
  --quick_.running;
  ++parked_;
  if (!open_) return;
  start_queued_requests();
  take_messages();
}

/// Logs an error that the client may not see. The log of one client is bounded.
void Connection::log_error(const std::string& error) {
  constexpr int kMost = 100;
  const int number = ++errors_logged_;
  if (!service_.log || number > kMost) return;
  service_.log(client_ + ": " + error + (number == kMost ? " (further errors of this client are not logged)" : ""));
}

void Connection::execute_in_worker(Lane& lane, std::string message) {
  const std::size_t message_bytes = message.size();
  std::string answer;
  std::string fault_of_message;
  bool is_parked = false;
  ++service_.counters.running;
  try {
    const Request request(std::move(message));
    const bool waits = service_.methods.is_waiting(request.method());
    is_parked = waits && service_.workers.begin_waiting();
    Response result = is_parked ? call_that_waits(request) : call(request);
    const bool is_known = service_.methods.contains(request.method());
    if (is_known) service_.counters.add_call(request.method(), result.failed, result.seconds);
    if (request.expects_response()) answer = std::move(result.bytes);
    if (result.failed && (waits || !is_known || !request.expects_response())) log_error(result.error);
  } catch (const std::exception& fault) {
    fault_of_message = fault.what();
  }
  --service_.counters.running;
  std::size_t& place = is_parked ? parked_ : lane.running;
  asio::post(service_.network, [self = shared_from_this(), &place, message_bytes, answer = std::move(answer),
                                fault_of_message = std::move(fault_of_message)]() mutable {
    if (!self->open_) return;
    if (!fault_of_message.empty()) return self->close(fault_of_message);
    self->finish_call(place, message_bytes, std::move(answer));
  });
}

/// `place`: the count in which the call was.
void Connection::finish_call(std::size_t& place, std::size_t message_bytes, std::string answer) {
  --place;
  release(message_bytes);
  if (!answer.empty()) {
    ++service_.counters.answers;
    queue_response(std::move(answer));
  }
  if (!open_) return;
  start_queued_requests();
  take_messages();
}

void Connection::queue_response(std::string bytes) {
  if (queued_bytes_ > service_.options.limits.max_queued_bytes) {
    return close(std::to_string(queued_bytes_) + " bytes of answers were not read");
  }
  queued_bytes_ += bytes.size();
  const std::size_t size = bytes.size();
  responses_.push_back(std::move(bytes));
  hold(size);
  if (open_ && responses_.size() == 1) write();
}

void Connection::write() {
  if (!last_write_s_) last_write_s_ = steady_seconds();
  const std::string& answer = responses_.front();
  const auto rest = asio::buffer(answer.data() + written_, answer.size() - written_);
  socket_.async_write_some(rest, [self = shared_from_this()](asio::error_code fault, std::size_t bytes) {
    if (!self->open_) return;
    if (fault) return self->close();
    self->last_write_s_.reset();
    self->written_ += bytes;
    const std::size_t size = self->responses_.front().size();
    if (self->written_ == size) {
      self->responses_.pop_front();
      self->queued_bytes_ -= size;
      self->written_ = 0;
      self->release(size);
      self->take_messages();
    }
    if (self->open_ && !self->responses_.empty()) self->write();
  });
}

}  // namespace tileflight::rpc
