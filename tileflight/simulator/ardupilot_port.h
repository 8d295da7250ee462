#pragma once

#include <stop_token>
#include <string>
#include <thread>

#include "tileflight/autopilot/frame_lockstep.h"
#include "tileflight/autopilot/limited_log.h"
#include "tileflight/autopilot/udp_port.h"
#include "tileflight/simulator/lockstep_vehicle.h"

namespace tileflight::simulator {

/// ArduPilot's JSON interface for one vehicle: a thread that takes servo packets from a UDP port, lets the vehicle make
/// the steps that they ask for, and answers with its state.
class ArduPilotPort {
 public:
  /// Listens. Throws InputError if it cannot.
  ArduPilotPort(LockstepVehicle vehicle, const std::string& address, int port, SimulatorLog log);

  void start();
  /// After the clock has stopped. May be called twice.
  void stop();
  std::uint16_t port() const { return port_.port(); }
  const LockstepVehicle& vehicle() const { return vehicle_; }

 private:
  void run(const std::stop_token& stop);
  bool take(const std::string& datagram);
  bool make_steps(const autopilot::ServoPacket& packet, const autopilot::FrameRequest& request);
  void report_rate(int frame_rate);

  LockstepVehicle vehicle_;
  autopilot::UdpPort port_;
  autopilot::LimitedLog log_;
  autopilot::FrameLockstep lockstep_;
  int frame_rate_ = 0;
  std::string answer_;  ///< the last state sent
  std::jthread thread_;
};

}  // namespace tileflight::simulator
