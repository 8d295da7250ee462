#pragma once

#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "tileflight/live/autopilot/limited_log.h"
#include "tileflight/live/autopilot/lockstep.h"
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
  /// After the clock has stopped. May be called twice.
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

}  // namespace tileflight::simulator
