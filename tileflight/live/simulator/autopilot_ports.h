#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/live/autopilot/limited_log.h"
#include "tileflight/live/autopilot/lockstep.h"
#include "tileflight/live/autopilot/mavlink.h"
#include "tileflight/live/autopilot/ports.h"
#include "tileflight/live/simulator/lockstep_vehicle.h"

namespace tileflight::simulator {

/// Waits until a port is free. Returns without owning the lock if a stop is requested.
template <class Port>
std::unique_lock<std::mutex> wait_for_port(Port& port, const std::stop_token& stop) {
  std::unique_lock lock(port.in_use, std::try_to_lock);
  while (!lock && !stop.stop_requested()) {
    std::this_thread::sleep_for(kAutopilotPoll);
    lock = std::unique_lock(port.in_use, std::try_to_lock);
  }
  return lock;
}

/// ArduPilot's JSON interface for one vehicle: a thread that takes servo packets from a UDP port, lets the vehicle make
/// the steps that they ask for, and answers with its state. It begins once the port is free.
class ArduPilotPort {
 public:
  using Port = autopilot::SharedPort<autopilot::UdpPort>;

  ArduPilotPort(LockstepVehicle vehicle, std::shared_ptr<Port> port, SimulatorLog log);

  void start();
  /// Ends the thread, after the clock has stopped. May be called twice.
  void stop();
  std::uint16_t port() const { return port_->port.port(); }
  const LockstepVehicle& vehicle() const { return vehicle_; }

 private:
  void run(const std::stop_token& stop);
  bool take(const std::string& datagram);
  bool make_steps(const autopilot::ServoPacket& packet, const autopilot::FrameRequest& request);
  void report_rate(int frame_rate);

  LockstepVehicle vehicle_;
  std::shared_ptr<Port> port_;
  autopilot::LimitedLog log_;
  autopilot::FrameLockstep lockstep_;
  int frame_rate_ = 0;
  std::string answer_;  ///< the last state sent
  std::jthread thread_;
};

/// Pace of the simulation of a vehicle with PX4.
struct Px4Pace {
  bool lockstep = true;              ///< each step waits for PX4's outputs; else it goes by the wall clock
  double speed = 1.0;                ///< simulated seconds in one of the wall clock
  bool as_fast_as_possible = false;  ///< lockstep alone paces it
};

/// PX4's simulator interface for one vehicle: a thread that waits for PX4 at a TCP port, sends it sensors every 4 ms of
/// simulated time, and drives the motors with its answers. In lockstep each step waits for an answer. Time follows the
/// wall clock without lockstep, until PX4 has sent its first outputs, and after a missing answer until PX4 answers
/// twice in a row. The thread begins once the port is free.
class Px4Port {
 public:
  using Port = autopilot::SharedPort<autopilot::TcpPort>;

  Px4Port(LockstepVehicle vehicle, std::shared_ptr<Port> port, const Px4Pace& pace, SimulatorLog log);

  void start();
  /// Ends the thread, after the clock has stopped. May be called twice.
  void stop();
  std::uint16_t port() const { return shared_->port.port(); }
  const LockstepVehicle& vehicle() const { return vehicle_; }

 private:
  using WallClock = std::chrono::steady_clock;

  /// State of one connection.
  struct Session {
    autopilot::MavlinkReader reader;
    autopilot::ControlGate gate{kPx4Step_us};
    std::vector<double> outputs;
    std::uint64_t step = 0;                      ///< number of the sensors sent last
    int answers = 0;                             ///< in a row
    int answers_needed = 1;                      ///< of them, until each step waits for one
    std::optional<WallClock::time_point> heard;  ///< when PX4 sent its last outputs
    std::uint8_t sequence = 0;
    std::uint64_t damaged = 0;  ///< frames reported
    WallClock::time_point due;  ///< when the next step may be made
  };

  void run(const std::stop_token& stop);
  void serve_peer(const std::stop_token& stop);
  std::chrono::milliseconds patience(const Session& session) const;
  bool in_step(const Session& session) const;
  bool is_silent(const Session& session) const;
  bool wait_for_controls(Session& session, const std::stop_token& stop);
  void miss(Session& session);
  bool take(Session& session, const autopilot::MavlinkFrame& received);
  void use_outputs(Session& session, const autopilot::HilActuatorControls& controls);
  void report_damage(Session& session);
  void keep_pace(Session& session) const;
  void log(const std::string& kind, const std::string& text);

  LockstepVehicle vehicle_;
  std::shared_ptr<Port> shared_;
  autopilot::TcpPort& port_;  ///< of shared_
  Px4Pace pace_;
  autopilot::LimitedLog log_;
  std::jthread thread_;
};

}  // namespace tileflight::simulator
