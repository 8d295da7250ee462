#include <unistd.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stop_token>
#include <thread>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "command.h"
#include "input_options.h"
#include "live_views.h"
#include "serve_session.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/autopilot/ports.h"

namespace tileflight::app {
namespace {

struct ServeOptions {
  RegionOptions region;
  SourceArguments source_arguments;
  simulator::SimulatorOptions simulator;
  rpc::ServerOptions server;
  FoxgloveOptions foxglove;
  Ros2Options ros2;
  SessionOptions session;
  std::string settings, token_file, files, follow = "auto";
  std::vector<std::string> levels;  ///< NAME=SOURCE
  std::vector<std::string> assets;  ///< NAME=FILE
  std::vector<double> start_local;
  double memory_gb = 2.0;
  std::size_t message_mb = 64;
  bool port_given = false;
};

std::string token_of(const std::string& file) {
  std::string token = base::read_text(file);
  while (!token.empty() && (token.back() == '\n' || token.back() == '\r')) token.pop_back();
  if (token.empty())
    throw InputError(file, "contains no token; write one line, e.g. the output of `openssl rand -hex 32`");
  return token;
}

/// Values of an option NAME=VALUE, by their names. `form`: how they are written.
std::map<std::string, std::string> named_values(const std::vector<std::string>& entries, const std::string& option,
                                                const std::string& form) {
  std::map<std::string, std::string> values;
  for (const std::string& entry : entries) {
    const std::size_t equals = entry.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == entry.size())
      throw InputError(option + " '" + entry + "'", "must be " + form);
    if (!values.emplace(entry.substr(0, equals), entry.substr(equals + 1)).second)
      throw InputError(option + " '" + entry + "'", "the name is given twice");
  }
  return values;
}

simulator::SimulatorOptions simulator_options(const ServeOptions& options) {
  using simulator::TileResidency;
  simulator::SimulatorOptions result = options.simulator;
  result.load = load_options(options.region);
  result.load.source = source_options(options.source_arguments);
  if (!options.settings.empty()) {
    result.settings = base::read_text(options.settings);
    result.settings_name = options.settings;
  }
  result.residency = options.follow == "auto"     ? TileResidency::kAuto
                     : options.follow == "region" ? TileResidency::kRegion
                                                  : TileResidency::kFollow;
  result.autopilot_address = options.server.address;
  result.max_memory_bytes = static_cast<std::uintmax_t>(options.memory_gb * 1e9);
  if (!options.files.empty()) result.output_root = options.files;
  for (const auto& [name, file] : named_values(options.assets, "--asset", "NAME=FILE")) result.assets[name] = file;
  const std::vector<double>& start = options.start_local;
  if (!start.empty()) {
    const double up_m = start.size() > 2 ? start[2] : std::numeric_limits<double>::quiet_NaN();
    result.ned_origin_local = geometry::Vec3{start[0], start[1], up_m};
  }
  return result;
}

/// The options on which answers depend, as one would type them: a session can be repeated only with the same.
std::string world_text(const ServeOptions& options) {
  std::ostringstream text;
  text.precision(17);
  const auto numbers = [&text](const char* option, const std::vector<double>& values) {
    if (values.empty()) return;
    text << option;
    for (std::size_t i = 0; i < values.size(); ++i) text << (i == 0 ? ' ' : ',') << values[i];
  };
  text << "--follow " << options.follow << " --memory " << options.memory_gb << " --pixel-error "
       << options.simulator.error_px << " --error " << options.region.error_m;
  if (std::isfinite(options.simulator.max_distance_m)) text << " --view-distance " << options.simulator.max_distance_m;
  numbers(" --center", options.region.center);
  numbers(" --center-local", options.region.center_local);
  numbers(" --size", options.region.size);
  numbers(" --origin", options.region.origin);
  numbers(" --start-local", options.start_local);
  if (options.region.allow_incomplete) text << " --allow-incomplete";
  for (const std::string& file : options.region.region_files)
    text << " --region FILE of SHA-256 " << base::sha256_hex_of_file(file);
  for (const auto& [name, file] : named_values(options.assets, "--asset", "NAME=FILE"))
    text << " --asset " << name << "=FILE of SHA-256 " << base::sha256_hex_of_file(file);
  for (const std::string& level : options.levels) text << " --level " << level.substr(0, level.find('=')) << "=SOURCE";
  if (!options.files.empty()) text << " --files FOLDER";
  return text.str();
}

/// For a level: settings and limits of the command line, but no region, which is of SOURCE.
simulator::SimulatorOptions level_options(simulator::SimulatorOptions options, const std::string& source) {
  tileset::LoadOptions load;
  load.error_m = options.load.error_m;
  load.allow_incomplete = options.load.allow_incomplete;
  load.source = options.load.source;
  options.load = std::move(load);
  options.ned_origin_local.reset();
  options.source = source;
  return options;
}

rpc::ServerOptions server_options(const ServeOptions& options, const simulator::Simulator& simulator) {
  rpc::ServerOptions result = options.server;
  const std::optional<int> of_settings = simulator.settings_port();
  if (!options.port_given && of_settings) result.port = static_cast<std::uint16_t>(*of_settings);
  if (!options.token_file.empty()) result.token = token_of(options.token_file);
  result.token_method = airsim::kAuthenticateMethod;
  result.limits.message.max_bytes = options.message_mb << 20U;
  return result;
}

std::string endpoint(const std::string& address, int port) {
  const bool brackets = address.find(':') != std::string::npos;
  return (brackets ? "[" + address + "]" : address) + ":" + std::to_string(port);
}

/// Settings written for other servers often allow all networks; here only the command line opens the port to them.
void warn_of_settings_address(const rpc::ServerOptions& options, const simulator::Simulator& simulator) {
  const std::optional<std::string> wanted = simulator.settings_address();
  if (!wanted || *wanted == "localhost" || *wanted == options.address) return;
  std::cerr << "tileflight: LocalHostIp in the settings is ignored; set the address with --bind\n";
}

nlohmann::json autopilots_json(const simulator::Simulator& simulator) {
  nlohmann::json list = nlohmann::json::array();
  for (const simulator::AutopilotEndpoint& one : simulator.autopilots()) {
    list.push_back({{"vehicle", one.vehicle},
                    {"protocol", one.protocol},
                    {"address", one.address},
                    {"port", one.port},
                    {"home", {one.home.latitude, one.home.longitude, one.home.altitude, one.home_heading_deg}}});
  }
  return list;
}

/// Which autopilots are waited for, and the home position that they have to be started with.
std::vector<std::string> autopilot_lines(const simulator::Simulator& simulator) {
  std::vector<std::string> lines;
  for (const simulator::AutopilotEndpoint& one : simulator.autopilots()) {
    lines.push_back("vehicle " + one.vehicle + " waits for its autopilot at " + endpoint(one.address, one.port) + " (" +
                    one.protocol + "), home " + base::rounded_text(one.home.latitude, 7) + "," +
                    base::rounded_text(one.home.longitude, 7) + "," + base::rounded_text(one.home.altitude, 2) + "," +
                    base::rounded_text(one.home_heading_deg, 1));
  }
  return lines;
}

/// Prints what users need to connect as soon as the server listens.
void announce(const CommonOptions& common, const rpc::ServerOptions& options, int port,
              const std::optional<FoxgloveView>& foxglove, const std::optional<Ros2View>& ros2,
              const simulator::Simulator& simulator) {
  const std::vector<std::string> vehicles = simulator.vehicles().list_vehicles();
  if (common.json) {
    nlohmann::json line = {{"address", options.address},
                           {"port", port},
                           {"token", !options.token.empty()},
                           {"vehicles", vehicles},
                           {"autopilots", autopilots_json(simulator)},
                           {"mode", simulator.statistics().mode},
                           {"warnings", simulator.warnings()}};
    if (foxglove) line["foxglove_port"] = foxglove->port();
    if (ros2) line["ros2"] = ros2->json();
    std::cout << line.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
  } else if (!common.quiet) {
    for (const std::string& warning : simulator.warnings()) std::cerr << "tileflight: " << warning << "\n";
    std::cout << "listening at " << endpoint(options.address, port) << ", vehicle";
    for (const std::string& vehicle : vehicles) std::cout << " " << vehicle;
    if (foxglove) std::cout << ", viewers at ws://" << endpoint(options.address, foxglove->port());
    if (ros2) std::cout << ", " << ros2->text();
    std::cout << "; press Ctrl-C to stop" << std::endl;
    for (const std::string& line : autopilot_lines(simulator)) std::cout << line << std::endl;
  }
}

void warn_of_other_machines(const rpc::ServerOptions& options) {
  if (rpc::is_loopback(options.address)) return;
  std::cerr << "tileflight: warning: " << options.address << " can be reached from other machines and the protocol "
            << "is not encrypted; "
            << (options.token.empty() ? "anyone who connects can control the vehicles; require a password with --token"
                                      : "the token is sent in plain text")
            << "\n";
}

/// A server runs for days and handles calls in short-lived threads. With glibc's defaults each arena (eight per core)
/// keeps the pages of its peak usage. Two arenas and periodic trimming keep memory close to what is in use. Between
/// trims, pages of images are used again: fresh ones cost a fifth of a small picture.
class SteadyHeap {
 public:
  SteadyHeap() {
#ifdef __GLIBC__
    constexpr int kOwnPages_bytes = 32 << 20, kKept_bytes = 64 << 20;
    mallopt(M_ARENA_MAX, 2);
    mallopt(M_MMAP_THRESHOLD, kOwnPages_bytes);
    mallopt(M_TRIM_THRESHOLD, kKept_bytes);
    thread_ = std::jthread([](const std::stop_token& stop) { give_back(stop); });
#endif
  }

 private:
#ifdef __GLIBC__
  static void give_back(const std::stop_token& stop) {
    constexpr std::chrono::seconds kEvery{20};
    std::mutex mutex;
    std::condition_variable_any wake;
    std::unique_lock lock(mutex);
    while (!stop.stop_requested()) {
      wake.wait_for(lock, stop, kEvery, [] { return false; });
      malloc_trim(0);
    }
  }
#endif
  std::jthread thread_;
};

Output serve(const ServeOptions& options, const CommonOptions& common, const Progress& progress) {
  const SteadyHeap heap;
  const auto log = [quiet = common.quiet](const std::string& line) {
    if (!quiet) std::cerr << ("tileflight: " + line + "\n");
  };
  const std::map<std::string, std::string> sources = named_values(options.levels, "--level", "NAME=SOURCE");
  simulator::SimulatorOptions first = simulator_options(options);
  first.autopilot_ports = std::make_shared<autopilot::SharedPorts>();
  const auto options_of_level = [&first](const std::string& source) { return level_options(first, source); };
  if (!options.session.replay.empty())
    return replay(options.session.replay, {first, sources, options_of_level, world_text(options)}, log, progress);
  std::unique_ptr<airsim::SessionRecorder> recorder;
  if (!options.session.record.empty())
    recorder = start_recording(options.session.record, world_text(options), first, log);
  const auto open_level = [&](const std::string& source) {
    simulator::SimulatorOptions of_level = options_of_level(source);
    if (recorder) {
      of_level.clock_start_ns = session_start_ns(of_level);
      recorder->begin_level(*of_level.clock_start_ns);
    }
    auto level = std::make_unique<simulator::Simulator>(of_level, log);
    for (const std::string& line : autopilot_lines(*level)) log(line);
    return level;
  };
  airsim::Levels levels(std::make_shared<simulator::Simulator>(first, log, progress), sources, open_level, log);
  if (isatty(STDERR_FILENO) == 1) std::cerr << "\r\033[K";  // clear the progress line
  std::unique_ptr<rpc::Server> server;
  const rpc::ServerOptions settings = server_options(options, *levels.current());
  rpc::Server::Caller caller;
  if (recorder) {
    caller = [&](const rpc::MethodTable& methods, std::uint64_t client, const rpc::Request& request) {
      return recorder->call(levels, methods, client, request);
    };
  }
  server = std::make_unique<rpc::Server>(airsim::make_method_table(levels, [&server] { return server->statistics(); }),
                                         settings, log, caller);
  server->stop_at_signals();
  warn_of_other_machines(settings);
  if (!common.quiet) warn_of_settings_address(settings, *levels.current());
  // Viewers and nodes have no token, and what they order is not recorded.
  const bool may_control = settings.token.empty() && recorder == nullptr;
  std::optional<FoxgloveView> foxglove;
  if (options.foxglove.is_wanted)
    foxglove.emplace([&levels] { return levels.current(); }, options.foxglove, may_control, settings, log);
  std::optional<Ros2View> ros2;
  if (options.ros2.is_wanted) ros2.emplace([&levels] { return levels.current(); }, options.ros2, may_control, log);
  announce(common, settings, server->port(), foxglove, ros2, *levels.current());
  server->run();
  if (recorder) recorder->finish(levels);
  levels.stop();
  return {};
}

void add_server_options(CLI::App& command, const std::shared_ptr<ServeOptions>& options) {
  options->server.port = 41451;
  command.add_option("--port", options->server.port, "TCP port; 0: any free one (default: the settings', else 41451)")
      ->check(CLI::Range(0, 65535))
      ->each([options](const std::string&) { options->port_given = true; });
  command
      .add_option("--bind", options->server.address,
                  "address to listen on (0.0.0.0: other machines can connect, see --token)")
      ->capture_default_str();
  CLI::Option* token = command.add_option("--token", options->server.token, "token that a client must send first");
  command
      .add_option("--token-file", options->token_file,
                  "file that holds the token; unlike --token, other users cannot see it")
      ->check(CLI::ExistingFile)
      ->excludes(token);
  command.add_option("--max-message", options->message_mb, "maximum size of a message from a client, MB")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
}

void add_world_options(CLI::App& command, ServeOptions& options) {
  command.add_option("--settings", options.settings, "AirSim's settings.json: mode, vehicles, cameras, sensors")
      ->check(CLI::ExistingFile);
  command
      .add_option("--follow", options.follow,
                  "tiles to keep in memory: those of the region, or those the sensors can see (auto: the region if it "
                  "fits into half of --memory)")
      ->check(CLI::IsMember({"auto", "region", "sensors"}));
  command
      .add_option("--pixel-error", options.simulator.error_px,
                  "screen-space error of tiles loaded for the sensors, pixels")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--memory", options.memory_gb, "memory limit for decoded tiles, GB")
      ->check(CLI::Range(0.001, 100000.0))
      ->capture_default_str();
  command
      .add_option("--view-distance", options.simulator.max_distance_m,
                  "with tiles that follow the sensors, leave out those farther away, metres (default: all above the "
                  "horizon)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--level", options.levels,
                  "NAME=SOURCE of a place that simLoadLevel(NAME) may load; may be given several times")
      ->allow_extra_args(false);
  command
      .add_option("--asset", options.assets,
                  "NAME=FILE of a model (.glb, .gltf, .obj, .ply) that simSpawnObject may spawn as NAME; may be given "
                  "several times")
      ->allow_extra_args(false);
  command.add_option("--files", options.files, "folder that clients may write files into (default: none)");
  command
      .add_option("--start-local", options.start_local,
                  "X,Y[,Z] of the vehicles' origin in the local frame, metres (default: on the surface at the centre)")
      ->delimiter(',')
      ->expected(2, 3);
}

}  // namespace

void add_serve(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<ServeOptions>();
  CLI::App* command = app.add_subcommand("serve", "a simulator server that AirSim clients talk to");
  command->footer("Example:\n  tileflight serve place/twin/tileset.json --settings settings.json --port 41451");
  command->add_option("SOURCE", options->simulator.source, kSourceHelp)->required();
  add_world_options(*command, *options);
  add_server_options(*command, options);
  add_foxglove_options(*command, options->foxglove);
  add_ros2_rate_option(*command, *add_ros2_options(*command, options->ros2), options->ros2);
  add_session_options(*command, options->session);
  add_region_options(*command, options->region);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.is_server = options->session.replay.empty();
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return serve(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
