#include "tileflight/live/simulator/ardupilot_port.h"

#include <chrono>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::simulator {
namespace {

std::vector<double> motor_outputs(const autopilot::ServoPacket& packet, std::size_t motors) {
  std::vector<double> outputs;
  for (std::size_t i = 0; i < motors; ++i) outputs.push_back(autopilot::servo_output(packet.pwm[i]));
  return outputs;
}

}  // namespace

ArduPilotPort::ArduPilotPort(LockstepVehicle vehicle, std::shared_ptr<Port> port, SimulatorLog log)
    : vehicle_(vehicle), port_(std::move(port)), log_(std::move(log)) {}

void ArduPilotPort::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void ArduPilotPort::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void ArduPilotPort::run(const std::stop_token& stop) {
  using WallClock = std::chrono::steady_clock;
  const auto in_use = wait_for_port(*port_, stop);
  std::optional<WallClock::time_point> heard;  // while it is connected
  while (!stop.stop_requested()) {
    const auto datagram = port_->port.receive(kAutopilotPoll);
    if (datagram && take(*datagram)) heard = WallClock::now();
    if (!heard || WallClock::now() < *heard + kAutopilotSilence) continue;
    heard.reset();
    log_.line("silence", "vehicle '" + vehicle_.name() + "': ArduPilot is silent; the vehicle waits for it");
    vehicle_.leave();
  }
}

/// Whether it was a servo packet.
bool ArduPilotPort::take(const std::string& datagram) {
  autopilot::ServoPacket packet;
  try {
    packet = autopilot::read_servo_packet(datagram);
  } catch (const InputError& error) {
    log_.line("malformed", "vehicle '" + vehicle_.name() + "': " + error.what());
    return false;
  }
  const autopilot::FrameRequest request = lockstep_.receive(packet.frame_count, packet.frame_rate);
  if (request.restarted) {
    log_.line("start", "vehicle '" + vehicle_.name() + "': ArduPilot has started; the vehicle is at its start");
    vehicle_.restart();
  }
  report_rate(packet.frame_rate);
  if (make_steps(packet, request)) port_->port.answer(answer_);
  return true;
}

/// False: the simulator stops.
bool ArduPilotPort::make_steps(const autopilot::ServoPacket& packet, const autopilot::FrameRequest& request) {
  const std::vector<double> outputs = motor_outputs(packet, vehicle_.motors());
  for (int i = 0; i < request.steps; ++i) {
    if (!vehicle_.step(outputs, request.step_s)) return false;
  }
  if (request.steps > 0) answer_ = autopilot::state_line(vehicle_.ardupilot_state());
  return true;
}

void ArduPilotPort::report_rate(int frame_rate) {
  if (frame_rate == frame_rate_) return;
  frame_rate_ = frame_rate;
  log_.line("rate", "vehicle '" + vehicle_.name() + "': " + std::to_string(frame_rate) + " steps a second");
}

}  // namespace tileflight::simulator
