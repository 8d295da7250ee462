#include "live_views.h"

#include <iostream>
#include <map>
#include <optional>
#include <utility>

#include "tileflight/live/foxglove/server.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/publishing/ros2_control.h"
#include "tileflight/live/ros2/participant.h"

namespace tileflight::app {
namespace {

/// Rate of poses and inertial units for ROS 2's nodes.
constexpr double kRos2PoseRate_hz = 100.0;

foxglove::ServerOptions viewer_options(const FoxgloveOptions& options, const rpc::ServerOptions& server) {
  return {.address = server.address, .port = options.port, .name = "tileflight serve"};
}

}  // namespace

/// The view has the parameters behind the server, and stops before the server goes.
struct FoxgloveView::Parts {
  Parts(publishing::LiveView::CurrentSimulator simulator, const FoxgloveOptions& options, bool may_pause,
        const rpc::ServerOptions& rpc_server, const Log& log)
      : view(std::move(simulator), {.image_rate_hz = options.image_rate_hz, .may_pause = may_pause}, log),
        server(viewer_options(options, rpc_server), view.parameters(), log),
        sink(server) {
    view.start(sink);
  }
  ~Parts() { view.stop(); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  publishing::LiveView view;
  foxglove::Server server;
  publishing::FoxgloveSink sink;
};

FoxgloveView::FoxgloveView(publishing::LiveView::CurrentSimulator simulator, const FoxgloveOptions& options,
                           bool may_pause, const rpc::ServerOptions& server, const Log& log)
    : parts_(std::make_unique<Parts>(std::move(simulator), options, may_pause, server, log)) {}

FoxgloveView::~FoxgloveView() = default;

std::uint16_t FoxgloveView::port() const { return parts_->server.port(); }

void add_foxglove_options(CLI::App& command, FoxgloveOptions& options) {
  CLI::Option* wanted = command.add_flag("--foxglove", options.is_wanted,
                                         "show the simulation live to Foxglove, Lichtblick and other viewers of the "
                                         "Foxglove WebSocket protocol");
  command.add_option("--foxglove-port", options.port, "TCP port for viewers; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->needs(wanted)
      ->capture_default_str();
  command.add_option("--foxglove-rate", options.image_rate_hz, "images and scans per second for viewers, at most")
      ->check(CLI::Range(0.1, publishing::kMaxImageRate_hz))
      ->needs(wanted)
      ->capture_default_str();
}

/// The view stops before the sink goes.
struct Ros2View::Parts {
  Parts(const publishing::LiveView::CurrentSimulator& simulator, const Ros2Options& wanted, bool may_control,
        const Log& log)
      : options(wanted),
        participant(options.participant, log),
        sink(participant),
        view(simulator, {.image_rate_hz = options.image_rate_hz, .pose_rate_hz = kRos2PoseRate_hz}, log) {
    view.start(sink);
    if (may_control) control.emplace(participant, simulator);
  }
  ~Parts() { view.stop(); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  Ros2Options options;
  ros2::Participant participant;
  publishing::Ros2Sink sink;
  publishing::LiveView view;
  std::optional<publishing::Ros2Control> control;
};

Ros2View::Ros2View(publishing::LiveView::CurrentSimulator simulator, const Ros2Options& options, bool may_control,
                   const Log& log)
    : parts_(std::make_unique<Parts>(std::move(simulator), options, may_control, log)) {
  warn_of_ros2_network(options, parts_->participant.network(),
                       may_control ? "can watch and control the vehicles" : "can watch");
}

Ros2View::~Ros2View() = default;

std::string Ros2View::text() const { return ros2_text(parts_->options, parts_->participant.network()); }

nlohmann::json Ros2View::json() const { return ros2_json(parts_->options, parts_->participant.network()); }

CLI::Option* add_ros2_options(CLI::App& command, Ros2Options& options) {
  using ros2::Release;
  CLI::Option* wanted = command.add_flag("--ros2", options.is_wanted, "to ROS 2's nodes (RViz, rosbag2), by DDS");
  command.add_option("--domain", options.participant.domain, "ROS 2 domain (default: ROS_DOMAIN_ID, else 0)")
      ->envname("ROS_DOMAIN_ID")
      ->check(CLI::Range(0U, ros2::kMaxDomain));
  command
      .add_option("--ros2-interface", options.participant.interface_name,
                  "network for ROS 2, e.g. eth0: nodes on other machines can join (default: what CYCLONEDDS_URI says, "
                  "else this machine alone)")
      ->needs(wanted);
  const std::map<std::string, Release> releases{
      {"humble", Release::kHumble}, {"iron", Release::kIronAndLater}, {"jazzy", Release::kIronAndLater}};
  command.add_option("--ros2-release", options.participant.release, "ROS 2 release of the nodes (default: humble)")
      ->transform(CLI::CheckedTransformer(releases))
      ->needs(wanted);
  return wanted;
}

void add_ros2_rate_option(CLI::App& command, CLI::Option& wanted, Ros2Options& options) {
  command.add_option("--ros2-rate", options.image_rate_hz, "images and scans per second for ROS 2, at most")
      ->check(CLI::Range(0.1, publishing::kMaxImageRate_hz))
      ->needs(&wanted)
      ->capture_default_str();
}

nlohmann::json ros2_json(const Ros2Options& options, const std::string& network) {
  return {{"domain", options.participant.domain}, {"network", network}};
}

std::string ros2_text(const Ros2Options& options, const std::string& network) {
  return "ROS 2 domain " + std::to_string(options.participant.domain) + " (" + network + ")";
}

void warn_of_ros2_network(const Ros2Options& options, const std::string& network, const std::string& may) {
  const std::string& name = options.participant.interface_name;
  if (network == "127.0.0.1 alone" || name == "lo" || name == "127.0.0.1") return;
  std::cerr << "tileflight: warning: ROS 2 can be reached from other machines (" << network
            << "), it is not encrypted, and anyone who joins the domain " << may << "\n";
}

}  // namespace tileflight::app
