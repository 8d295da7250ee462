#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/live/autopilot/autopilot_event.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::autopilot {
class SharedPorts;
}

namespace tileflight::simulator {

// Types of another room that appear in this interface.
using autopilot::AutopilotEvent;
using autopilot::AutopilotJournal;

/// Policy for loading tiles.
enum class TileResidency {
  kAuto,    ///< the region if it fits into half of the memory limit, else the visible tiles
  kRegion,  ///< the whole region (or tileset), loaded once
  kFollow,  ///< everything visible to any sensor of any vehicle
};

/// Place, settings and limits of a simulator.
struct SimulatorOptions {
  std::string source;  ///< SOURCE of the command line
  tileset::LoadOptions
      load;              ///< region, geometric error, origin (the settings' origin takes precedence), source options
  std::string settings;  ///< text of a settings.json; empty: none
  std::string settings_name = "settings.json";  ///< used in messages
  TileResidency residency = TileResidency::kAuto;
  double error_px = 1.0;  ///< allowed error of a tile in any image, if tiles follow the sensors
  std::uintmax_t max_memory_bytes = std::uintmax_t{2} << 30;  ///< for decoded tiles
  /// Tiles farther from every sensor are left out, if tiles follow the sensors.
  double max_distance_m = std::numeric_limits<double>::infinity();
  /// Tiles that could not be read are requested again after this time, if tiles follow the sensors.
  std::chrono::milliseconds retry_after{10'000};
  std::string autopilot_address = "127.0.0.1";  ///< address of the autopilots' ports
  bool prefetch = true;                         ///< read tiles ahead in the background; no result depends on it
  /// Root of clients' file names. nullopt: calls that write files are refused.
  std::optional<std::filesystem::path> output_root;
  /// Models that clients may spawn beside the built-in ones, by their names (--asset; the settings may name more).
  std::map<std::string, std::filesystem::path> assets;
  /// Origin of NED in the local frame (east, north, up); a z of NaN: on the surface. Default: on the surface at the
  /// local frame's origin, or if there is none, at the centre of the place.
  std::optional<geometry::Vec3> ned_origin_local;
  /// Ports of autopilots that several worlds use one after another; nullptr: the world opens its own.
  std::shared_ptr<autopilot::SharedPorts> autopilot_ports;
  AutopilotJournal journal;  ///< receives the autopilots' events, for a session that is recorded
  /// Repeats a recorded session: Clock::advance_to() moves the time, and Simulator::apply() replaces the autopilots,
  /// whose ports are not opened.
  bool repeats_session = false;
  std::optional<std::uint64_t> clock_start_ns;  ///< time stamp of the start; nullopt: as the settings have it
};

/// Receives one-line messages about events not visible to a caller (tiles that fail, ignored commands). Called from any
/// thread.
using SimulatorLog = std::function<void(const std::string& line)>;

}  // namespace tileflight::simulator
