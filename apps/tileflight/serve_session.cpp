#include "serve_session.h"

#include <chrono>
#include <utility>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/simulation_clock.h"

namespace tileflight::app {
namespace {

/// Name and version.
std::string program() {
  const std::string text = version_text();
  return text.substr(0, text.find('\n'));
}

std::string counted(std::uint64_t number, const char* what) {
  return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
}

void check_world(const std::string& file, const airsim::SessionHeader& header, const ReplayedWorld& world) {
  if (!world.first.settings.empty() && world.first.settings != header.settings)
    throw InputError(file, "was recorded with other settings; they are in the file, leave --settings out");
  if (world.world != header.world)
    throw InputError(file, "was recorded with other options; repeat it with `" + header.world + "` in place of `" +
                               world.world + "`");
}

std::string place_of(const airsim::SessionDifference& at) {
  const std::string time =
      " at " + base::rounded_text(static_cast<double>(at.tick) * simulator::SimulationClock::kStep_s, 3) + " s";
  if (at.client == 0) return at.what + time;
  return "call " + std::to_string(at.call) + ", " + at.what + " of client " + std::to_string(at.client) + time;
}

void require_same(const std::string& file, const airsim::SessionHeader& header, const airsim::ReplayResult& result) {
  if (result.differences == 0) return;
  const auto& at = *result.first_difference;
  throw InputError(file, counted(result.differences, "answer") + " of " + std::to_string(result.answers_compared) +
                             " differ from the session's, the first: " + place_of(at) +
                             "; is it the place that was recorded (" + header.source + "), and the same program (" +
                             header.program + ")?");
}

}  // namespace

void add_session_options(CLI::App& command, SessionOptions& options) {
  CLI::Option* record = command.add_option(
      "--record", options.record, "new file for all that clients and autopilots do, to repeat it with --replay");
  command
      .add_option("--replay", options.replay,
                  "repeat a session of --record without its clients, as fast as possible, and compare all answers")
      ->check(CLI::ExistingFile)
      ->excludes(record);
}

std::uint64_t session_start_ns(const simulator::SimulatorOptions& options) {
  return simulator::default_start_ns(simulator::read_settings(options.settings, options.settings_name).clock);
}

std::unique_ptr<airsim::SessionRecorder> start_recording(const std::string& file, const std::string& world,
                                                         simulator::SimulatorOptions& first,
                                                         const simulator::SimulatorLog& log) {
  first.clock_start_ns = session_start_ns(first);
  auto recorder = std::make_unique<airsim::SessionRecorder>(
      file, airsim::SessionHeader{program(), first.source, first.settings, world, *first.clock_start_ns}, log);
  first.journal = recorder->journal();
  return recorder;
}

Output replay(const std::string& file, ReplayedWorld world, const simulator::SimulatorLog& log,
              const Progress& progress) {
  const auto begun = std::chrono::steady_clock::now();
  airsim::SessionSummary session = airsim::summarize_session(file);
  check_world(file, session.header, world);
  world.first.settings = session.header.settings;
  world.first.clock_start_ns = session.header.start_ns;
  world.first.repeats_session = true;
  const auto open_level = [&](const std::string& source) {
    simulator::SimulatorOptions options = world.level_options(source);
    options.settings = session.header.settings;
    options.repeats_session = true;
    if (session.level_starts_ns.empty()) throw InputError(file, "has no start of this level");
    options.clock_start_ns = session.level_starts_ns.front();
    session.level_starts_ns.pop_front();
    return std::make_unique<simulator::Simulator>(options, log);
  };
  airsim::Levels levels(std::make_shared<simulator::Simulator>(world.first, log, progress), world.levels, open_level,
                        log);
  const rpc::MethodTable methods = airsim::make_method_table(levels, [] { return rpc::ServerStatistics{}; });
  const airsim::ReplayResult result = airsim::replay_session(file, session.records, levels, methods, progress);
  require_same(file, session.header, result);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  Output output;
  output.json = {{"calls", result.calls},
                 {"answers_compared", result.answers_compared},
                 {"differences", result.differences},
                 {"autopilot_events", result.autopilot_events},
                 {"simulated_s", result.simulated_s},
                 {"seconds", seconds},
                 {"complete", !session.is_cut}};
  output.text = counted(result.calls, "call") + " and " + counted(result.autopilot_events, "event") +
                " of autopilots repeated, " + counted(result.answers_compared, "answer") + " equal, " +
                base::rounded_text(result.simulated_s, 1) + " s simulated in " + base::rounded_text(seconds, 1) + " s";
  if (session.is_cut) output.text += "; the file breaks off, its server was killed";
  return output;
}

}  // namespace tileflight::app
