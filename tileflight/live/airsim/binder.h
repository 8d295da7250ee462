#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/rpc/method_table.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

/// The last argument of camera calls: whether the camera is external, or, for clients of API version 4, the name of an
/// annotation layer.
struct ExternalFlag {
  bool value = false;
  std::string annotation_name;
};

/// Part, result and argument types of a method of the simulator or of one of its parts.
template <class Method>
struct Signature;
template <class P, class R, class... A>
struct Signature<R (P::*)(A...)> {
  using Part = P;
  using Result = R;
  using Arguments = std::tuple<std::decay_t<A>...>;
};
template <class P, class R, class... A>
struct Signature<R (P::*)(A...) const> : Signature<R (P::*)(A...)> {};

/// The part of a simulator that has this type, or the simulator itself.
template <class Part>
Part& part_of(simulator::Simulator& world) {
  if constexpr (std::is_same_v<Part, simulator::Simulator>) {
    return world;
  } else if constexpr (std::is_same_v<Part, simulator::Vehicles>) {
    return world.vehicles();
  } else if constexpr (std::is_same_v<Part, simulator::Flight>) {
    return world.flight();
  } else if constexpr (std::is_same_v<Part, simulator::Sensors>) {
    return world.sensors();
  } else if constexpr (std::is_same_v<Part, simulator::Cameras>) {
    return world.cameras();
  } else if constexpr (std::is_same_v<Part, simulator::Detections>) {
    return world.detections();
  } else if constexpr (std::is_same_v<Part, simulator::Objects>) {
    return world.objects();
  } else if constexpr (std::is_same_v<Part, simulator::Labels>) {
    return world.labels();
  } else if constexpr (std::is_same_v<Part, simulator::Place>) {
    return world.place();
  } else if constexpr (std::is_same_v<Part, simulator::Environment>) {
    return world.environment();
  } else if constexpr (std::is_same_v<Part, simulator::Recording>) {
    return world.recording();
  } else {
    static_assert(std::is_same_v<Part, simulator::Clock>);
    return world.clock();
  }
}

/// Calls methods of the simulator that is served. Templates accept another class with the same interface instead.
class SimulatorCaller {
 public:
  explicit SimulatorCaller(Levels& levels) : levels_(&levels) {}

  template <auto Method, class Result, class... Arguments>
  Result call(Arguments&&... arguments) const {
    const std::shared_ptr<simulator::Simulator> simulator = levels_->current();
    return (part_of<typename Signature<decltype(Method)>::Part>(*simulator).*
            Method)(std::forward<Arguments>(arguments)...);
  }

  bool load_level(const std::string& name) const { return levels_->load(name); }

 private:
  Levels* levels_;
};

/// Registers simulator methods in a table; arguments and results are converted by their types.
template <class Caller>
class MethodBinder {
 public:
  MethodBinder(rpc::MethodTable& table, Caller caller) : table_(table), caller_(std::move(caller)) {}

  /// Registers a method under its RPC name.
  template <auto Method>
  void add(const std::string& name) {
    using Types = Signature<decltype(Method)>;
    add<Method, Types>(name, std::make_index_sequence<std::tuple_size_v<typename Types::Arguments>>{});
  }

  /// Registers a method whose calls wait for the vehicle or the clock.
  template <auto Method>
  void add_waiting(const std::string& name) {
    add<Method>(name);
    table_.mark_waiting(name);
  }

  /// Registers a method whose last argument states whether the camera is external; clients may omit it.
  template <auto Method>
  void add_camera_method(const std::string& name) {
    using Types = Signature<decltype(Method)>;
    add_camera_method<Method, Types>(name,
                                     std::make_index_sequence<std::tuple_size_v<typename Types::Arguments> - 1>{});
  }

  /// Registers a method that accepts any arguments and returns nothing.
  void accept(const std::string& name) {
    table_.add_variadic(name, [caller = caller_, name](std::span<const msgpack::object>, rpc::Encoder& out, double&) {
      caller.template call<&simulator::Simulator::accept_without_effect, void>(name);
      out.nil();
    });
  }

  /// Registers a method that accepts any arguments and returns an answer that tells that nothing has changed.
  template <class Answer>
  void accept(const std::string& name, const Answer& answer) {
    table_.add_variadic(name,
                        [caller = caller_, name, answer](std::span<const msgpack::object>, rpc::Encoder& out, double&) {
                          caller.template call<&simulator::Simulator::accept_without_effect, void>(name);
                          rpc::encode(out, answer);
                        });
  }

  /// Registers a method that always fails with the simulator's reason why it is not supported.
  void refuse(const std::string& name) {
    table_.add_variadic(name, [caller = caller_, name](std::span<const msgpack::object>, rpc::Encoder& out, double&) {
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
  void add_camera_method(const std::string& name, std::index_sequence<I...>) {
    using Result = typename Types::Result;
    using Arguments = typename Types::Arguments;
    table_.template add<Result, std::tuple_element_t<I, Arguments>..., ExternalFlag>(
        name, [caller = caller_](const std::tuple_element_t<I, Arguments>&... arguments, const ExternalFlag& external) {
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

/// rpc::decode() for ExternalFlag.
inline void decode(const msgpack::object& value, ExternalFlag& result) {
  if (value.type == msgpack::type::STR || value.type == msgpack::type::BIN) {
    rpc::decode(value, result.annotation_name);
  } else {
    rpc::decode(value, result.value);
  }
}

}  // namespace tileflight::airsim
