#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "command.h"
#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/airsim/session.h"

namespace tileflight::app {

/// `serve --record` and `serve --replay`.
struct SessionOptions {
  std::string record, replay;  ///< files; empty: neither
};

void add_session_options(CLI::App& command, SessionOptions& options);

/// Opens the place of a level, with the options of the command line for it.
using LevelOptions = std::function<simulator::SimulatorOptions(const std::string& source)>;

/// Sets up the recording of the session in these worlds. `world`: the options that choose tiles and start.
/// Throws InputError.
std::unique_ptr<airsim::SessionRecorder> start_recording(const std::string& file, const std::string& world,
                                                         simulator::SimulatorOptions& first,
                                                         const simulator::SimulatorLog& log);
/// Time stamp of the clock's start of a place that is opened now.
std::uint64_t session_start_ns(const simulator::SimulatorOptions& options);

/// The world in which a session is repeated.
struct ReplayedWorld {
  simulator::SimulatorOptions first;          ///< without settings: those of the session
  std::map<std::string, std::string> levels;  ///< sources by name
  LevelOptions level_options;
  std::string world;  ///< the options that choose tiles and start
};

/// Repeats a session. Throws InputError if it was of another world, or its answers differ.
Output replay(const std::string& file, ReplayedWorld world, const simulator::SimulatorLog& log,
              const Progress& progress);

}  // namespace tileflight::app
