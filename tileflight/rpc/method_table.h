#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/rpc/codec.h"
#include "tileflight/rpc/request.h"

namespace tileflight::rpc {

/// What became of a call: the bytes of the answer (`[1, id, error, result]`) and what to keep record of.
struct Answer {
  std::string bytes;
  bool failed = false;
  std::string error;     ///< empty unless failed
  double seconds = 0.0;  ///< that the method itself took, without decoding and encoding
};

/// The methods that clients may call, by name and number of arguments. A name may be there with several numbers, each
/// a method of its own: clients of different versions send more or fewer.
class MethodTable {
 public:
  /// Reads the arguments (as many as it was added with), does the work, writes the result. Adds the seconds of the
  /// work. Throws std::exception for what cannot be done; what it wrote until then is dropped.
  using Handler = std::function<void(std::span<const msgpack::object>, Encoder&, double& seconds)>;

  void add_handler(const std::string& name, std::size_t arguments, Handler handler);
  /// A method that is called whatever the number of arguments.
  void add_any(const std::string& name, Handler handler) { add_handler(name, kAnyNumber, std::move(handler)); }

  /// A function of any types that codec.h knows; an argument that is not of its type is refused by its number.
  template <class Result, class... Arguments, class Function>
  void add(const std::string& name, Function function);

  /// Never throws for what a client sent: errors are answers, worded at their beginning as the servers that AirSim's
  /// clients know word them. May be called by several threads at once.
  Answer call(const Request& request) const;

  bool contains(const std::string& name) const { return methods_.contains(name); }
  std::vector<std::string> names() const;

 private:
  static constexpr std::size_t kAnyNumber = ~std::size_t{0};

  std::map<std::string, std::vector<std::pair<std::size_t, Handler>>> methods_;  ///< the expected number first
};

/// Seconds of a steady clock, from any start.
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
      std::index_sequence<I...>, [[maybe_unused]] std::span<const msgpack::object> given, Encoder & out,
      double& seconds) {
    std::tuple<std::decay_t<Arguments>...> arguments{decode_argument<std::decay_t<Arguments>>(given, I)...};
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
              [invoke](std::span<const msgpack::object> given, Encoder& out, double& seconds) {
                invoke(std::index_sequence_for<Arguments...>{}, given, out, seconds);
              });
}

/// `[1, id, error, nil]`
std::string encode_error(std::uint32_t id, const std::string& error);

}  // namespace tileflight::rpc
