#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "source_options.h"
#include "stop_signals.h"
#include "tileflight/rpc/server.h"
#include "tileflight/streaming/dataset_player.h"

namespace tileflight::app {
namespace {

struct PlayCommandOptions {
  std::string dataset, place;
  dataset::CameraChoice camera;
  SourceArguments source_arguments;
  streaming::PlayOptions play;
  foxglove::ServerOptions server{.port = 8765, .name = "tileflight play"};
  bool foxglove = false;
};

/// Ctrl-C before the playing began.
struct Interrupted : std::exception {};

Progress stoppable(const Progress& progress, const std::stop_token& stop) {
  return [&progress, stop](std::int64_t done, std::int64_t total, std::string_view what) {
    if (stop.stop_requested()) throw Interrupted();
    if (progress) progress(done, total, what);
  };
}

std::optional<streaming::PlaceGlb> place_of(const PlayCommandOptions& options, const dataset::Dataset& dataset,
                                            const Progress& progress) {
  if (options.place.empty()) return std::nullopt;
  return streaming::read_place_glb(options.place, source_options(options.source_arguments), dataset, progress);
}

/// Prints what users need to connect as soon as the server listens.
void announce_player(const CommonOptions& common, const PlayCommandOptions& options,
                     const streaming::DatasetPlayer& player, const dataset::Dataset& dataset, int port) {
  if (common.json) {
    const nlohmann::json line = {{"address", options.server.address}, {"port", port},
                                 {"topics", player.topics()},         {"frames", dataset.frames.size()},
                                 {"seconds", player.duration_s()},    {"warnings", dataset.warnings}};
    std::cout << line.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
  } else if (!common.quiet) {
    for (const std::string& warning : dataset.warnings) std::cerr << "tileflight: " << warning << "\n";
    std::cout << "listening at ws://" << options.server.address << ":" << port << ", " << player.topics().size()
              << " topics of " << player.duration_s() << " s; plays when a viewer subscribes; press Ctrl-C to stop"
              << std::endl;
  }
}

void warn_of_watchers(const foxglove::ServerOptions& options) {
  if (rpc::is_loopback(options.address)) return;
  std::cerr
      << "tileflight: warning: " << options.address
      << " can be reached from other machines, the protocol is not encrypted, and anyone who connects can watch\n";
}

Output play(const PlayCommandOptions& options, const CommonOptions& common, const Progress& progress) try {
  constexpr std::chrono::seconds kLastMessages{5};
  const StopSignals signals;
  const dataset::Dataset dataset = dataset::read_dataset(options.dataset, options.camera);
  streaming::DatasetPlayer player(dataset, options.play);
  const auto place = place_of(options, dataset, stoppable(progress, signals.token()));
  warn_of_watchers(options.server);
  foxglove::Server server(options.server, player.parameters(), [quiet = common.quiet](const std::string& line) {
    if (!quiet) std::cerr << ("tileflight: " + line + "\n");
  });
  player.open(server, place);
  announce_player(common, options, player, dataset, server.port());
  const std::uint64_t sent = player.play(server, signals.token());
  if (!signals.token().stop_requested()) server.wait_until_sent(kLastMessages);
  if (common.json) return {};
  const std::uint64_t dropped = server.statistics().messages_dropped;
  return {{}, std::to_string(sent) + " messages, " + std::to_string(dropped) + " dropped for slow viewers\n"};
} catch (const Interrupted&) {
  return {};
}

void add_player_options(CLI::App& command, PlayCommandOptions& options) {
  command
      .add_flag("--foxglove", options.foxglove,
                "to Foxglove, Lichtblick and other viewers of the Foxglove WebSocket protocol")
      ->required();
  command.add_option("--port", options.server.port, "TCP port; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command.add_option("--bind", options.server.address, "address to listen on (0.0.0.0: other machines can connect)")
      ->capture_default_str();
  command.add_option("--rate", options.play.rate, "recorded seconds per second")
      ->check(CLI::Range(0.001, streaming::kMaxPlayRate))
      ->capture_default_str();
  command.add_flag("--loop", options.play.loop, "begin again at the end");
  command.add_flag("--paused", options.play.is_paused, "begin when a viewer sets the parameter `paused` to false");
  command.add_option("--place", options.place,
                     "show this place, too: a truth folder, or a tileset (any SOURCE), read around the path");
  command.add_option("--camera", options.camera.calibration,
                     "calibration instead of the dataset's: Kalibr, OpenCV, COLMAP, DSO or VSLAM-LAB");
  command.add_option("--camera-id", options.camera.camera_id, "camera to use if the calibration holds several");
}

}  // namespace

void add_play(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<PlayCommandOptions>();
  CLI::App* command = app.add_subcommand("play", "a dataset live, to viewers");
  command->footer("Example:\n  tileflight play dataset --foxglove --place truth --loop");
  command->add_option("DATASET", options->dataset, "dataset folder")->required();
  add_player_options(*command, *options);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.is_server = true;
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return play(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
