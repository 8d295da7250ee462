#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "tileflight/live/rpc/server.h"
#include "tileflight/live/publishing/live_view.h"

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

}  // namespace tileflight::app
