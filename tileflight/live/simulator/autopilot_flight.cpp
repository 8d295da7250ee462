#include "tileflight/live/simulator/autopilot_flight.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/capture/vehicle/vehicle_flight.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/process.h"
#include "tileflight/live/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using WallClock = std::chrono::steady_clock;
using geometry::Vec3;

constexpr double kSampleEvery_s = 0.009;  // as other vehicles' paths
constexpr double kTimeRounding_s = 1e-9;
/// A vehicle this far above its start has left the ground.
constexpr double kAirborne_m = 0.3;
/// Motors that are given less stand; for so long, until the flight is over.
constexpr double kStandingOutput = 0.02, kStanding_s = 0.5;
/// Time that other processes of a command may take after the command has ended.
constexpr double kAfterCommand_s = 2.0;
constexpr std::size_t kMostLines = 50;
constexpr std::chrono::milliseconds kLook{50};

/// The camera's path, from what the autopilot does; follows the events in the threads of the simulator.
class FlightRecord {
 public:
  explicit FlightRecord(const vehicle::AutopilotPlan& plan) : plan_(plan) {}

  void add(const AutopilotEvent& event) {
    const std::lock_guard lock(mutex_);
    if (!outcome_.empty()) return;
    heard_ = WallClock::now();
    if (event.kind == AutopilotEvent::Kind::kRestart) return restart(event);
    if (event.kind != AutopilotEvent::Kind::kStep) return;
    ++steps_;
    elapsed_s_ += event.step_s;
    const bool over = follow_landing(event) || elapsed_s_ + kTimeRounding_s >= plan_.duration_s;
    if (over || elapsed_s_ - samples_.poses.back().time_s + kTimeRounding_s >= kSampleEvery_s) sample(event);
    if (!over) return;
    outcome_ = standing_s_ >= kStanding_s ? "landed" : "time is over";
    changed_.notify_all();
  }

  /// The simulator's messages during the flight; before its first step there is one that an autopilot is there.
  void say(const std::string& line) {
    const std::lock_guard lock(mutex_);
    if (steps_ == 0 || !outcome_.empty()) return;
    if (lines_.size() < kMostLines) lines_.push_back(line);
    ++said_;
  }

  /// Waits a while; whether the flight is over.
  bool wait() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLook, [&] { return !outcome_.empty(); });
  }
  double silent_s() const {
    const std::lock_guard lock(mutex_);
    return std::chrono::duration<double>(WallClock::now() - heard_).count();
  }
  std::int64_t steps() const {
    const std::lock_guard lock(mutex_);
    return steps_;
  }
  double elapsed_s() const {
    const std::lock_guard lock(mutex_);
    return elapsed_s_;
  }
  AutopilotFlight result() const {
    const std::lock_guard lock(mutex_);
    AutopilotFlight flown{flight_path::path_through_poses(samples_), outcome_, airborne_s_, steps_, {}, lines_};
    if (said_ > lines_.size()) flown.lines.push_back("and " + std::to_string(said_ - lines_.size()) + " lines more");
    return flown;
  }

 private:
  /// An autopilot that starts anew begins the flight anew.
  void restart(const AutopilotEvent& event) {
    samples_.poses.clear();
    elapsed_s_ = standing_s_ = airborne_s_ = 0.0;
    steps_ = 0;
    lines_.clear();
    said_ = 0;
    start_m_ = event.T_local_body.translation;
    sample(event);
  }
  void sample(const AutopilotEvent& event) {
    samples_.poses.push_back({elapsed_s_, vehicle::mounted_camera_pose(event.T_local_body, plan_.mount)});
  }
  bool follow_landing(const AutopilotEvent& event) {
    const bool is_high = event.T_local_body.translation.z() - start_m_.z() > kAirborne_m;
    if (airborne_s_ == 0.0 && is_high && !event.touches) airborne_s_ = elapsed_s_;
    const bool stands = airborne_s_ > 0.0 && event.touches &&
                        std::ranges::all_of(event.outputs, [](double output) { return output < kStandingOutput; });
    standing_s_ = stands ? standing_s_ + event.step_s : 0.0;
    return standing_s_ >= kStanding_s;
  }

  const vehicle::AutopilotPlan& plan_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  geometry::Trajectory samples_;
  Vec3 start_m_ = Vec3::Zero();
  std::string outcome_;
  double elapsed_s_ = 0.0, standing_s_ = 0.0, airborne_s_ = 0.0;
  std::int64_t steps_ = 0;
  std::vector<std::string> lines_;
  std::size_t said_ = 0;
  WallClock::time_point heard_ = WallClock::now();
};

/// Keys of the vehicle for its vision, with a camera of its own.
nlohmann::json vision_keys(const vehicle::VisionPlan& vision) {
  if (vision.source == vehicle::VisionPlan::Source::kNone) return nlohmann::json::object();
  if (vision.source == vehicle::VisionPlan::Source::kTruth) return {{"VisionOdometry", "TruthWithNoise"}};
  const Vec3 place = frd_from_flu(vision.offset_m);
  const nlohmann::json capture = {
      {"ImageType", 0}, {"Width", vision.width}, {"Height", vision.height}, {"FOV_Degrees", vision.fov_deg}};
  const nlohmann::json camera = {{"X", place.x()},
                                 {"Y", place.y()},
                                 {"Z", place.z()},
                                 {"Pitch", vision.pitch_deg},
                                 {"CaptureSettings", nlohmann::json::array({capture})}};
  nlohmann::json keys = {{"VisionOdometry", "FromPictures"},
                         {"VisionCamera", "vision"},
                         {"VisionRate", vision.rate_hz},
                         {"VisionLatency", vision.latency_s},
                         {"Cameras", {{"vision", camera}}}};
  if (vision.source == vehicle::VisionPlan::Source::kPlace) {
    keys["VisionOdometry"] = "FromPlace";
    if (!vision.tiles.empty()) keys["VisionPlace"] = vision.tiles;
  }
  return keys;
}

/// The plan as a settings.json, with a range finder that looks down.
std::string settings_text(const vehicle::AutopilotPlan& plan) {
  nlohmann::json vehicle = {
      {"VehicleType", plan.is_px4 ? "PX4Multirotor" : "ArduCopter"},
      {plan.is_px4 ? "TcpPort" : "ControlPort", plan.port},
      {"Model", plan.hexarotor ? "Hexacopter" : "Generic"},
      {"Yaw", plan.start_heading_deg},
      {"Sensors", {{"Down", {{"SensorType", 5}, {"Enabled", true}, {"Pitch", -90}, {"MaxDistance", 100}}}}}};
  if (plan.is_px4) vehicle.update({{"UseSerial", false}, {"UseTcp", true}, {"LockStep", true}});
  vehicle.update(vision_keys(plan.vision));
  if (!plan.gnss) vehicle["Sensors"]["gps"] = {{"SensorType", 3}, {"Enabled", false}};
  if (plan.thrust_expo) vehicle["ThrustExpo"] = *plan.thrust_expo;
  const Vec3 wind = ned_from_enu(plan.wind_m_s);
  return nlohmann::json{{"StepOnDemand", true},
                        {"Wind", {{"X", wind.x()}, {"Y", wind.y()}, {"Z", wind.z()}}},
                        {"Vehicles", {{"Vehicle", vehicle}}}}
      .dump();
}

std::string replaced(std::string text, const std::string& word, const std::string& value) {
  for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; at += value.size())
    text.replace(at, word.size(), value);
  return text;
}

std::string command_line(const vehicle::AutopilotPlan& plan, const AutopilotEndpoint& at) {
  const std::string home = base::rounded_text(at.home.latitude, 7) + "," + base::rounded_text(at.home.longitude, 7) +
                           "," + base::rounded_text(at.home.altitude, 2) + "," +
                           base::rounded_text(at.home_heading_deg, 1);
  const std::string command = replaced(replaced(plan.command, "{port}", std::to_string(at.port)), "{home}", home);
  return replaced(command, "{address}", at.address);
}

/// Watches an autopilot's flight until it is over.
class FlightWatch {
 public:
  FlightWatch(const vehicle::AutopilotPlan& plan, const AutopilotEndpoint& at, FlightRecord& record)
      : plan_(plan), at_(at), record_(record) {
    if (!plan.command.empty())
      command_.emplace(jobs::Command{
          .words = jobs::shell(command_line(plan, at)), .folder = plan.folder, .log = log_, .log_permissions = 0600});
  }

  void run(const Progress& progress) {
    while (!record_.wait()) {
      const double silent_s = record_.silent_s();
      const auto end = command_ ? command_->exit_status() : std::nullopt;
      const bool begun = record_.steps() > 0;
      if (end && silent_s > kAfterCommand_s)
        fail("`" + plan_.command + "` has ended (" + jobs::describe_exit(*end) + ") " +
             (begun ? "before it had landed" : "without a step"));
      if (!begun && since_start_s() > plan_.connect_timeout_s)
        fail("nobody has flown the vehicle " + text_of(plan_.connect_timeout_s) +
             " after the start (connect_timeout_s)");
      if (begun && silent_s > plan_.silence_s)
        fail("it has been silent for " + text_of(plan_.silence_s) + " (silence_s)");
      report_progress(progress, std::lround(record_.elapsed_s()), std::lround(plan_.duration_s), "an autopilot flies");
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const std::string printed = command_ ? jobs::last_line(log_) : "";
    throw InputError("autopilot at " + at_.address + ":" + std::to_string(at_.port) + " (" + at_.protocol + ")",
                     what + ", " + base::rounded_text(record_.elapsed_s(), 1) + " s after its start" +
                         (printed.empty() ? "" : "; it printed last: " + printed));
  }
  static std::string text_of(double seconds) { return base::trimmed_text(seconds, 3) + " s"; }
  double since_start_s() const { return std::chrono::duration<double>(WallClock::now() - started_).count(); }

  const vehicle::AutopilotPlan& plan_;
  AutopilotEndpoint at_;
  FlightRecord& record_;
  std::filesystem::path log_ =
      base::make_temporary_path(std::filesystem::temp_directory_path() / "tileflight-autopilot.log");
  base::RemovedOnExit log_removal_{log_};
  std::optional<jobs::Process> command_;
  WallClock::time_point started_ = WallClock::now();
};

}  // namespace

AutopilotFlight fly_autopilot(const vehicle::AutopilotPlan& plan, SimulatorOptions options, const Progress& progress) {
  FlightRecord record(plan);
  options.settings = settings_text(plan);
  options.settings_name = "autopilot";
  options.ned_origin_local = Vec3(plan.start_m.x(), plan.start_m.y(), std::numeric_limits<double>::quiet_NaN());
  options.journal = [&record](const AutopilotEvent& event) { record.add(event); };
  Simulator simulator(
      options, [&record](const std::string& line) { record.say(line); }, progress);
  const AutopilotEndpoint at = simulator.autopilots().at(0);
  FlightWatch(plan, at, record).run(progress);
  simulator.stop();
  AutopilotFlight flight = record.result();
  flight.home = at.home;
  return flight;
}

recording::FlownPath render_autopilot_flight(const vehicle::FlightPlan& plan, const recording::RenderSettings& settings,
                                             const Progress& progress) {
  SimulatorOptions options;
  options.source = settings.source;
  options.load = settings.load;
  options.load.uses = {fetch::Use::kAnalyse};
  options.residency = settings.error_px ? TileResidency::kFollow : TileResidency::kRegion;
  options.error_px = settings.error_px.value_or(options.error_px);
  options.max_memory_bytes = settings.max_memory_bytes.value_or(options.max_memory_bytes);
  const AutopilotFlight flown = fly_autopilot(*plan.autopilot, std::move(options), progress);
  nlohmann::json report = {{"outcome", flown.outcome == "landed" ? "finished" : flown.outcome},
                           {"duration_s", flown.path.end_s() - flown.path.start_s()},
                           {"autopilot",
                            {{"kind", plan.autopilot->is_px4 ? "px4" : "ardupilot"},
                             {"steps", flown.steps},
                             {"airborne_s", flown.airborne_s},
                             {"home", {flown.home.latitude, flown.home.longitude, flown.home.altitude}},
                             {"log", flown.lines}}}};
  return {flown.path, vehicle::sample_frames(flown.path, plan), std::move(report), nullptr};
}

}  // namespace tileflight::simulator
