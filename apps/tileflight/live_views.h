#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/live/publishing/live_view.h"
#include "tileflight/live/ros2/participant.h"
#include "tileflight/live/rpc/server.h"

namespace tileflight::app {

/// `serve --foxglove`.
struct FoxgloveOptions {
  bool is_wanted = false;
  std::uint16_t port = 8765;  ///< Foxglove's default
  double image_rate_hz = 10.0;
};

void add_foxglove_options(CLI::App& command, FoxgloveOptions& options);

/// The simulator as viewers of Foxglove's protocol see it, at the same address as `server`. With a token for clients,
/// which viewers do not have, and in a recorded session they may only watch.
class FoxgloveView {
 public:
  using Log = std::function<void(const std::string& line)>;

  /// `may_pause`: whether viewers may pause the simulation. Throws InputError if the port cannot be used.
  FoxgloveView(publishing::LiveView::CurrentSimulator simulator, const FoxgloveOptions& options, bool may_pause,
               const rpc::ServerOptions& server, const Log& log);
  ~FoxgloveView();
  FoxgloveView(const FoxgloveView&) = delete;
  FoxgloveView& operator=(const FoxgloveView&) = delete;

  std::uint16_t port() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// `--ros2` of `serve` and `play`.
struct Ros2Options {
  bool is_wanted = false;
  ros2::ParticipantOptions participant;
  double image_rate_hz = 20.0;  ///< of `serve`
};

/// Adds --ros2 and what only goes with it, apart from the rate.
CLI::Option* add_ros2_options(CLI::App& command, Ros2Options& options);
void add_ros2_rate_option(CLI::App& command, CLI::Option& wanted, Ros2Options& options);

/// Describes domain and network for `--json`.
nlohmann::json ros2_json(const Ros2Options& options, const std::string& network);
/// "ROS 2 domain 0 (127.0.0.1 alone)"
std::string ros2_text(const Ros2Options& options, const std::string& network);
/// Warns on stderr if others may join from other machines; `may`: what anyone may do then.
void warn_of_ros2_network(const Ros2Options& options, const std::string& network, const std::string& may);

/// The simulator as nodes of ROS 2 see it.
class Ros2View {
 public:
  using Log = std::function<void(const std::string& line)>;

  /// `may_control`: nodes may fly and reset vehicles, else they only watch. Throws InputError if the domain cannot be
  /// joined.
  Ros2View(publishing::LiveView::CurrentSimulator simulator, const Ros2Options& options, bool may_control,
           const Log& log);
  ~Ros2View();
  Ros2View(const Ros2View&) = delete;
  Ros2View& operator=(const Ros2View&) = delete;

  std::string text() const;     ///< as ros2_text()
  nlohmann::json json() const;  ///< as ros2_json()

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace tileflight::app
