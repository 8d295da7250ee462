#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <msgpack.hpp>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/live/rpc/codec.h"

namespace tileflight::rpc {

/// A decoded call. msgpack-rpc specification: `[0, id, method, [args…]]`, or a notification, which gets no response:
/// `[2, method, [args…]]`.
class Request {
 public:
  /// `message`: one whole message, as delimited by MessageScanner. Throws ProtocolError if it is not a call.
  explicit Request(std::string message);

  /// Returns the message as it came.
  const std::string& message() const { return message_; }
  bool expects_response() const { return expects_response_; }
  std::uint32_t id() const { return id_; }
  const std::string& method() const { return method_; }
  std::span<const msgpack::object> arguments() const { return arguments_; }

 private:
  std::string message_;  ///< storage for strings and blobs of the arguments
  msgpack::object_handle handle_;
  bool expects_response_ = false;
  std::uint32_t id_ = 0;
  std::string method_;
  std::span<const msgpack::object> arguments_;
};

/// Result of a call: the response bytes (`[1, id, error, result]`) and statistics.
struct Response {
  std::string bytes;
  bool failed = false;
  std::string error;     ///< empty unless failed
  double seconds = 0.0;  ///< spent in the method itself, without decoding and encoding
};

/// The methods that clients may call, by name and number of arguments. A name may be registered with several numbers of
/// arguments, each a separate method: clients of different versions send more or fewer.
class MethodTable {
 public:
  /// Reads the arguments (as many as registered), does the work, writes the result and adds the seconds it took. Throws
  /// std::exception on failure; anything written until then is discarded.
  using Handler = std::function<void(std::span<const msgpack::object>, Encoder&, double& seconds)>;

  void add_handler(const std::string& name, std::size_t arguments, Handler handler);
  /// Adds a method that accepts any number of arguments.
  void add_variadic(const std::string& name, Handler handler) { add_handler(name, kVariadic, std::move(handler)); }

  /// Adds a function of any types that codec.h supports; an argument of the wrong type is rejected, naming its number.
  template <class Result, class... Arguments, class Function>
  void add(const std::string& name, Function function);

  /// Never throws because of client input: errors are responses, whose wording starts as that of the servers known to
  /// AirSim's clients. May be called by several threads at once.
  Response call(const Request& request) const;

  /// Marks a method whose calls wait for long (for a flight, for the clock) rather than compute. The server logs its
  /// errors, because AirSim's clients do not show them.
  void mark_waiting(const std::string& name) { waiting_.insert(name); }
  bool is_waiting(const std::string& name) const { return waiting_.contains(name); }

  /// Marks a method whose calls compute for long (render, cast rays, read tiles).
  void mark_slow(const std::string& name) { slow_.insert(name); }
  bool is_slow(const std::string& name) const { return slow_.contains(name); }

  bool contains(const std::string& name) const { return methods_.contains(name); }
  std::vector<std::string> names() const;

 private:
  static constexpr std::size_t kVariadic = ~std::size_t{0};

  std::map<std::string, std::vector<std::pair<std::size_t, Handler>>> methods_;  ///< (number of arguments, handler)
  std::set<std::string> waiting_;
  std::set<std::string> slow_;
};

/// Returns the name of the method that a whole message calls, without decoding its arguments; empty: it is no call.
std::string method_of(const std::string& message);

/// Seconds of a steady clock with an arbitrary origin.
double steady_seconds();

template <class T>
T decode_argument(std::span<const msgpack::object> arguments, std::size_t i) {
  T value{};
  try {
    decode(arguments[i], value);
  } catch (const DecodeError& fault) {
    throw DecodeError("argument " + std::to_string(i + 1) + ": " + fault.what());
  }
  return value;
}

template <class Result, class... Arguments, class Function>
void MethodTable::add(const std::string& name, Function function) {
  const auto invoke = [function = std::move(function)]<std::size_t... I>(
      std::index_sequence<I...>, [[maybe_unused]] std::span<const msgpack::object> parameters, Encoder & out,
      double& seconds) {
    std::tuple<std::decay_t<Arguments>...> arguments{decode_argument<std::decay_t<Arguments>>(parameters, I)...};
    const double begin_s = steady_seconds();
    if constexpr (std::is_void_v<Result>) {
      function(std::move(std::get<I>(arguments))...);
      seconds = steady_seconds() - begin_s;
      out.nil();
    } else {
      const Result result = function(std::move(std::get<I>(arguments))...);
      seconds = steady_seconds() - begin_s;
      encode(out, result);
    }
  };
  add_handler(name, sizeof...(Arguments),
              [invoke](std::span<const msgpack::object> parameters, Encoder& out, double& seconds) {
                invoke(std::index_sequence_for<Arguments...>{}, parameters, out, seconds);
              });
}

/// `[1, id, error, nil]`
std::string encode_error(std::uint32_t id, const std::string& error);

}  // namespace tileflight::rpc
