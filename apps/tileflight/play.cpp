#include <algorithm>
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "input_options.h"
#include "live_views.h"
#include "stop_signals.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/publishing/dataset_player.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/rpc/server.h"

namespace tileflight::app {
namespace {

struct PlayCommandOptions {
  std::string dataset, place;
  std::vector<std::string> cameras;  ///< names of a rig's, or a calibration
  std::string camera_id;
  SourceArguments source_arguments;
  publishing::PlayOptions play;
  foxglove::ServerOptions server{.port = 8765, .name = "tileflight play"};
  bool foxglove = false;
  Ros2Options ros2;
};

/// Ctrl-C before the playing began.
struct Interrupted : std::exception {};

Progress stoppable(const Progress& progress, const std::stop_token& stop) {
  return [&progress, stop](std::int64_t done, std::int64_t total, std::string_view what) {
    if (stop.stop_requested()) throw Interrupted();
    if (progress) progress(done, total, what);
  };
}

/// All cameras, with the chosen ones in `play`; or the dataset's only (or first) one with another calibration.
dataset::Rig read_played(const PlayCommandOptions& options, publishing::PlayOptions& play) {
  const std::vector<std::string> names = dataset::rig_camera_names(options.dataset);
  const auto is_name = [&names](const std::string& word) { return std::ranges::find(names, word) != names.end(); };
  if (options.cameras.size() == 1 && !is_name(options.cameras.front()))
    return dataset::rig_of(dataset::read_dataset(
        options.dataset, {.calibration = options.cameras.front(), .camera_id = options.camera_id}));
  for (const std::string& word : options.cameras) {
    if (!is_name(word))
      throw InputError(options.dataset,
                       "has no camera " + word + (names.empty() ? "" : ", only " + base::joined(names)));
  }
  play.cameras = options.cameras;
  return dataset::read_rig(options.dataset);
}

/// Number of images that are played, and warnings about them.
struct PlayedFrames {
  std::size_t count = 0;
  std::vector<std::string> warnings;
};

PlayedFrames frames_of(const dataset::Rig& rig, const std::vector<std::string>& chosen) {
  PlayedFrames frames;
  for (const dataset::RigCamera& camera : rig.cameras) {
    const bool is_played = chosen.empty() || std::ranges::find(chosen, camera.name) != chosen.end();
    if (is_played) frames.count += camera.dataset.frames.size();
    base::add_distinct(camera.dataset.warnings, frames.warnings);
  }
  return frames;
}

std::optional<publishing::PlaceGlb> place_of(const PlayCommandOptions& options, const dataset::Dataset& dataset,
                                             const Progress& progress) {
  if (options.place.empty()) return std::nullopt;
  return publishing::read_place_glb(options.place, source_options(options.source_arguments), dataset, progress);
}

/// Who is played to: Foxglove's viewers, ROS 2's nodes, or both.
class Audience {
 public:
  using Log = std::function<void(const std::string& line)>;

  Audience(const PlayCommandOptions& options, foxglove::ParameterAccess parameters, const Log& log) {
    if (options.foxglove) {
      server_.emplace(options.server, std::move(parameters), log);
      viewers_.emplace(*server_);
      sinks_.push_back(&*viewers_);
    }
    if (options.ros2.is_wanted) {
      participant_.emplace(options.ros2.participant, log);
      warn_of_ros2_network(options.ros2, participant_->network(), "can watch");
      nodes_.emplace(*participant_);
      sinks_.push_back(&*nodes_);
    }
    all_.emplace(sinks_);
  }

  publishing::MessageSink& sink() { return *all_; }
  std::optional<int> port() const { return server_ ? std::optional<int>(server_->port()) : std::nullopt; }
  std::optional<std::string> ros2_network() const {
    return participant_ ? std::optional(participant_->network()) : std::nullopt;
  }
  void wait_until_sent() const {
    constexpr std::chrono::seconds kLastMessages{5};
    if (server_) server_->wait_until_sent(kLastMessages);
    if (nodes_) nodes_->wait_until_acknowledged(kLastMessages);
  }
  std::uint64_t dropped() const { return server_ ? server_->statistics().messages_dropped : 0; }

 private:
  std::optional<foxglove::Server> server_;
  std::optional<ros2::Participant> participant_;
  std::optional<publishing::FoxgloveSink> viewers_;
  std::optional<publishing::Ros2Sink> nodes_;
  std::vector<publishing::MessageSink*> sinks_;
  std::optional<publishing::SeveralSinks> all_;
};

/// Prints what users need to connect as soon as the server listens.
void announce_player(const CommonOptions& common, const PlayCommandOptions& options,
                     const publishing::DatasetPlayer& player, const PlayedFrames& frames, const Audience& audience) {
  const std::optional<int> port = audience.port();
  const std::optional<std::string> network = audience.ros2_network();
  if (common.json) {
    nlohmann::json line = {{"topics", player.topics()},
                           {"frames", frames.count},
                           {"seconds", player.duration_s()},
                           {"notes", player.notes()},
                           {"warnings", frames.warnings}};
    if (port) line["address"] = options.server.address;
    if (port) line["port"] = *port;
    if (network) line["ros2"] = ros2_json(options.ros2, *network);
    std::cout << line.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
  } else if (!common.quiet) {
    for (const std::string& warning : frames.warnings) std::cerr << "tileflight: " << warning << "\n";
    for (const std::string& note : player.notes()) std::cerr << "note: " << note << "\n";
    if (port) std::cout << "listening at ws://" << options.server.address << ":" << *port << ", ";
    if (network) std::cout << ros2_text(options.ros2, *network) << ", ";
    std::cout << player.topics().size() << " topics of " << player.duration_s()
              << " s; plays when a viewer subscribes; press Ctrl-C to stop" << std::endl;
  }
}

void warn_of_watchers(const foxglove::ServerOptions& options) {
  if (rpc::is_loopback(options.address)) return;
  std::cerr
      << "tileflight: warning: " << options.address
      << " can be reached from other machines, the protocol is not encrypted, and anyone who connects can watch\n";
}

Output play(const PlayCommandOptions& options, const CommonOptions& common, const Progress& progress) try {
  const StopSignals signals;
  publishing::PlayOptions settings = options.play;
  const dataset::Rig rig = read_played(options, settings);
  publishing::DatasetPlayer player(rig, settings);
  const auto place = place_of(options, rig.cameras.front().dataset, stoppable(progress, signals.token()));
  if (options.foxglove) warn_of_watchers(options.server);
  Audience audience(options, player.parameters(), [quiet = common.quiet](const std::string& line) {
    if (!quiet) std::cerr << ("tileflight: " + line + "\n");
  });
  player.open(audience.sink(), place);
  announce_player(common, options, player, frames_of(rig, settings.cameras), audience);
  const std::uint64_t sent = player.play(audience.sink(), signals.token());
  if (!signals.token().stop_requested()) audience.wait_until_sent();
  if (common.json) return {};
  return {{},
          std::to_string(sent) + " messages, " + std::to_string(audience.dropped()) + " dropped for slow viewers\n"};
} catch (const Interrupted&) {
  return {};
}

void add_player_options(CLI::App& command, PlayCommandOptions& options) {
  command.add_flag("--foxglove", options.foxglove,
                   "to Foxglove, Lichtblick and other viewers of the Foxglove WebSocket protocol");
  add_ros2_options(command, options.ros2);
  command.add_option("--port", options.server.port, "TCP port; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command.add_option("--bind", options.server.address, "address to listen on (0.0.0.0: other machines can connect)")
      ->capture_default_str();
  command.add_option("--rate", options.play.rate, "recorded seconds per second")
      ->check(CLI::Range(0.001, publishing::kMaxPlayRate))
      ->capture_default_str();
  command.add_flag("--loop", options.play.loop, "begin again at the end");
  command.add_flag("--paused", options.play.is_paused, "begin when a viewer sets the parameter `paused` to false")
      ->needs("--foxglove");
  command.add_option("--epoch", options.play.epoch_s, kEpochHelp);
  command.add_option("--place", options.place,
                     "show this place, too: a truth folder, or a tileset (any SOURCE), read around the path");
  command
      .add_option("--camera", options.cameras,
                  "of a rig's cameras those of these names (default: all); or a calibration instead of the "
                  "dataset's: Kalibr, OpenCV, COLMAP, DSO or VSLAM-LAB")
      ->allow_extra_args(false);
  command.add_option("--camera-id", options.camera_id, "camera to use if the calibration holds several");
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
    if (!options->foxglove && !options->ros2.is_wanted) throw CLI::RequiredError("--foxglove or --ros2");
    selection.is_server = true;
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return play(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
