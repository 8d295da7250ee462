#pragma once

#include <cstddef>
#include <string>
#include <tuple>
#include <utility>

#include "tileflight/rpc/method_table.h"
#include "tileflight/simulator/simulator.h"

namespace tileflight::server {

/// The last argument of calls about cameras: whether the camera is external, or, of clients of API version 4, the name
/// of an annotation layer, which there are none of here.
struct External {
  bool value = false;
};

/// Calls methods of a simulator. Another class of the same shape may stand in for it.
class SimulatorCaller {
 public:
  explicit SimulatorCaller(simulator::Simulator& simulator) : simulator_(&simulator) {}

  template <auto Method, class Result, class... Arguments>
  Result call(Arguments&&... arguments) const {
    return (simulator_->*Method)(std::forward<Arguments>(arguments)...);
  }

 private:
  simulator::Simulator* simulator_;
};

/// The types of a method of the simulator.
template <class Method>
struct Signature;
template <class R, class... A>
struct Signature<R (simulator::Simulator::*)(A...)> {
  using Result = R;
  using Arguments = std::tuple<std::decay_t<A>...>;
};
template <class R, class... A>
struct Signature<R (simulator::Simulator::*)(A...) const> : Signature<R (simulator::Simulator::*)(A...)> {};

/// Puts methods of the simulator into a table, their arguments and results as their types say.
template <class Caller>
class Binder {
 public:
  Binder(rpc::MethodTable& table, Caller caller) : table_(table), caller_(std::move(caller)) {}

  /// The method, under its name on the wire.
  template <auto Method>
  void add(const std::string& name) {
    using Types = Signature<decltype(Method)>;
    add<Method, Types>(name, std::make_index_sequence<std::tuple_size_v<typename Types::Arguments>>{});
  }

  /// A method whose last argument says whether the camera is external; it may be left out.
  template <auto Method>
  void add_of_camera(const std::string& name) {
    using Types = Signature<decltype(Method)>;
    add_of_camera<Method, Types>(name, std::make_index_sequence<std::tuple_size_v<typename Types::Arguments> - 1>{});
  }

  /// Answered with nothing, whatever the arguments.
  void accept(const std::string& name) {
    table_.add_any(name, [caller = caller_, name](std::span<const msgpack::object>, rpc::Encoder& out, double&) {
      caller.template call<&simulator::Simulator::accept_without_effect, void>(name);
      out.nil();
    });
  }

  /// Answered with the simulator's word on why it is not served, whatever the arguments.
  void refuse(const std::string& name) {
    table_.add_any(name, [caller = caller_, name](std::span<const msgpack::object>, rpc::Encoder& out, double&) {
      caller.template call<&simulator::Simulator::refuse, void>(name);
      out.nil();
    });
  }

  rpc::MethodTable& table() { return table_; }
  const Caller& caller() const { return caller_; }

 private:
  template <auto Method, class Types, std::size_t... I>
  void add(const std::string& name, std::index_sequence<I...>) {
    using Result = typename Types::Result;
    using Arguments = typename Types::Arguments;
    table_.template add<Result, std::tuple_element_t<I, Arguments>...>(
        name, [caller = caller_](const std::tuple_element_t<I, Arguments>&... arguments) {
          return caller.template call<Method, Result>(arguments...);
        });
  }

  template <auto Method, class Types, std::size_t... I>
  void add_of_camera(const std::string& name, std::index_sequence<I...>) {
    using Result = typename Types::Result;
    using Arguments = typename Types::Arguments;
    table_.template add<Result, std::tuple_element_t<I, Arguments>..., External>(
        name, [caller = caller_](const std::tuple_element_t<I, Arguments>&... arguments, External external) {
          return caller.template call<Method, Result>(arguments..., external.value);
        });
    table_.template add<Result, std::tuple_element_t<I, Arguments>...>(
        name, [caller = caller_](const std::tuple_element_t<I, Arguments>&... arguments) {
          return caller.template call<Method, Result>(arguments..., false);
        });
  }

  rpc::MethodTable& table_;
  Caller caller_;
};

/// rpc::decode() for External.
inline void decode(const msgpack::object& value, External& result) {
  if (value.type == msgpack::type::STR || value.type == msgpack::type::BIN) {
    result.value = false;
  } else {
    rpc::decode(value, result.value);
  }
}

}  // namespace tileflight::server
