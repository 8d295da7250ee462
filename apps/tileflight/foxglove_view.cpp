#include "foxglove_view.h"

#include <utility>

#include "tileflight/live/foxglove/server.h"
#include "tileflight/live/publishing/message_sink.h"

namespace tileflight::app {
namespace {

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
  command.add_option("--foxglove-rate", options.image_rate_hz, "pictures and scans per second for viewers, at most")
      ->check(CLI::Range(0.1, publishing::kMaxImageRate_hz))
      ->needs(wanted)
      ->capture_default_str();
}

}  // namespace tileflight::app
