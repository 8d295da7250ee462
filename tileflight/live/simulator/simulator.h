#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/cameras.h"
#include "tileflight/live/simulator/clock.h"
#include "tileflight/live/simulator/detections.h"
#include "tileflight/live/simulator/environment.h"
#include "tileflight/live/simulator/flight.h"
#include "tileflight/live/simulator/labels.h"
#include "tileflight/live/simulator/objects.h"
#include "tileflight/live/simulator/place.h"
#include "tileflight/live/simulator/recording.h"
#include "tileflight/live/simulator/sensors.h"
#include "tileflight/live/simulator/simulator_options.h"
#include "tileflight/live/simulator/vehicles.h"
#include "tileflight/live/simulator/viewer.h"

namespace tileflight::simulator {

struct World;

/// The world behind AirSim's interface. Its parts hold one method for each call, with the call's arguments in the same
/// order and its name without the prefix: simGetImages is cameras().get_images(), tfLidarScan sensors().lidar_scan().
/// All methods are thread-safe. They throw InputError or std::runtime_error with a one-line message on failure.
class Simulator {
 public:
  /// Reads settings and tileset and starts the clock. Throws InputError.
  explicit Simulator(const SimulatorOptions& options, SimulatorLog log = {}, const Progress& progress = {});
  /// Simulates a place given as meshes (local frame, east, north, up); `options.source` is ignored.
  Simulator(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log = {});
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  Vehicles& vehicles() { return vehicles_; }
  const Vehicles& vehicles() const { return vehicles_; }
  Flight& flight() { return flight_; }
  Sensors& sensors() { return sensors_; }
  Cameras& cameras() { return cameras_; }
  Detections& detections() { return detections_; }
  Objects& objects() { return objects_; }
  Labels& labels() { return labels_; }
  Place& place() { return place_; }
  Environment& environment() { return environment_; }
  Recording& recording() { return recording_; }
  Clock& clock() { return clock_; }
  Viewer& viewer() { return viewer_; }
  const Viewer& viewer() const { return viewer_; }

  /// Cancels all tasks and unblocks all waiting calls; moving calls then return false.
  void stop();
  /// The port in the settings (ApiServerPort), if given.
  std::optional<int> settings_port() const;
  /// The address in the settings (LocalHostIp), if given.
  std::optional<std::string> settings_address() const;
  /// Warnings about settings and place for the user, one line each.
  std::vector<std::string> warnings() const;
  /// Ports at which autopilots are expected.
  std::vector<AutopilotEndpoint> autopilots() const;

  bool ping() const;                            ///< true
  int get_server_version() const;               ///< 1
  int get_min_required_client_version() const;  ///< 1
  /// Returns the text of the settings as given; without settings, default_settings_text().
  std::string get_settings_string() const;
  /// Puts all vehicles back to their start and all cameras to their settings. Spawned objects and labels stay.
  void reset();
  Statistics statistics() const;
  bool run_console_command(const std::string& command);  ///< false: there is no console
  void print_log_message(const std::string& message, const std::string& parameter, int severity);
  /// Accepts a call that changes nothing that a client reads (simPlot..., light, controller gains), so that scripts run
  /// on. The log warns of each call once. `name`: the call's name in AirSim's interface.
  void accept_without_effect(const std::string& name);
  /// Throws std::runtime_error that states why this AirSim call is not supported.
  [[noreturn]] void refuse(const std::string& name) const;

  /// Exclusive access to the world for one call of a recorded session: simulation time stands still and other turns
  /// wait until it is destroyed, or until the call waits for the simulation (which ends the turn). For one thread.
  class Turn {
   public:
    /// Waits for the turn.
    explicit Turn(Simulator& simulator);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    std::int64_t tick() const { return tick_; }  ///< steps that the clock had made when it began

   private:
    Simulator& simulator_;
    std::int64_t tick_ = 0;
  };
  /// With SimulatorOptions::repeats_session: repeats an action of an autopilot at the present step. Returns the message
  /// that is sent to the autopilot (kSensors; empty otherwise). Throws InputError for a vehicle without an autopilot.
  std::string apply(const AutopilotEvent& event);

 private:
  std::unique_ptr<World> world_;
  Vehicles vehicles_{*world_};
  Flight flight_{*world_};
  Sensors sensors_{*world_};
  Cameras cameras_{*world_};
  Detections detections_{*world_};
  Objects objects_{*world_};
  Labels labels_{*world_};
  Place place_{*world_};
  Environment environment_{*world_};
  Recording recording_{*world_};
  Clock clock_{*world_};
  Viewer viewer_{*world_};
};

}  // namespace tileflight::simulator
