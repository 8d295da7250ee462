#include "tileflight/live/simulator/autopilot_ports.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>
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

/// Handles a datagram. Returns whether it was a servo packet.
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

namespace {

using std::chrono::milliseconds;

/// Maximum time for the answer to the first sensors; after it, time follows the wall clock.
constexpr milliseconds kFirstAnswer{2000};
/// Maximum time that a step waits for its answer. PX4 does not answer all sensors: while its rate controller is off
/// (for instance between modes) it sends outputs every 50 ms, and waits for time to go on while the simulator waits for
/// it.
constexpr milliseconds kMissedAnswer{2000};
/// Interval of steps while PX4 is silent for long, in case it waits for time.
constexpr milliseconds kSilentStep{1000};
/// Answers in a row after which each step waits for one again.
constexpr int kAnswersInStep = 2;
constexpr milliseconds kMaxLagOfPx4{100};
constexpr unsigned kModeArmed = 128;

/// Returns the wall-clock time of a step without an answer, which is long enough to check whether one has come.
milliseconds wall_step(double speed) {
  return std::max(milliseconds(1), milliseconds(std::lround(1e3 * kPx4Step_s / speed)));
}

}  // namespace

Px4Port::Px4Port(LockstepVehicle vehicle, std::shared_ptr<Port> port, const Px4Pace& pace, SimulatorLog log)
    : vehicle_(vehicle), shared_(std::move(port)), port_(shared_->port), pace_(pace), log_(std::move(log)) {}

void Px4Port::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void Px4Port::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void Px4Port::log(const std::string& kind, const std::string& text) {
  log_.line(kind, "vehicle '" + vehicle_.name() + "': " + text);
}

void Px4Port::run(const std::stop_token& stop) {
  const auto in_use = wait_for_port(*shared_, stop);
  while (!stop.stop_requested()) {
    if (!port_.accept(kAutopilotPoll)) continue;
    log("start", "PX4 has connected; the vehicle is at its start");
    serve_peer(stop);
    vehicle_.leave();
    if (!stop.stop_requested()) log("end", "PX4's connection has ended; the vehicle waits for the next");
  }
}

void Px4Port::serve_peer(const std::stop_token& stop) {
  Session session;
  session.outputs.assign(vehicle_.motors(), 0.0);
  session.due = WallClock::now();
  vehicle_.restart();
  while (!stop.stop_requested() && port_.connected()) {
    port_.send(vehicle_.px4_sensors(session.step, session.sequence));
    if (!wait_for_controls(session, stop)) return;
    keep_pace(session);
    if (!vehicle_.step(session.outputs, kPx4Step_s)) return;
    ++session.step;
  }
}

milliseconds Px4Port::patience(const Session& session) const {
  if (in_step(session)) return kMissedAnswer;
  if (session.step == 0) return kFirstAnswer;
  return is_silent(session) ? kSilentStep : wall_step(pace_.speed);
}

bool Px4Port::in_step(const Session& session) const {
  return pace_.lockstep && session.answers >= session.answers_needed;
}

bool Px4Port::is_silent(const Session& session) const {
  return pace_.lockstep && session.heard && WallClock::now() - *session.heard > kAutopilotSilence;
}

/// Returns whether to make the next step: outputs answer the sensors, or time follows the wall clock.
bool Px4Port::wait_for_controls(Session& session, const std::stop_token& stop) {
  if (is_silent(session)) vehicle_.leave();
  const auto end = WallClock::now() + patience(session);
  while (!stop.stop_requested() && port_.connected()) {
    while (const auto received = session.reader.next()) {
      if (take(session, *received)) return true;
    }
    report_damage(session);
    const auto left = std::chrono::ceil<milliseconds>(end - WallClock::now());
    if (left.count() <= 0) {
      miss(session);
      return true;
    }
    session.reader.push(port_.receive(std::min(left, kAutopilotPoll)));
  }
  return false;
}

/// No answer has come to the sensors.
void Px4Port::miss(Session& session) {
  if (in_step(session))
    log("unanswered", "PX4 has not answered the sensors; time goes by the wall clock until it does");
  session.answers = 0;
  if (session.heard) session.answers_needed = kAnswersInStep;
  if (is_silent(session)) log("silence", "PX4 is silent; the vehicle all but stands until it answers");
}

/// Handles a frame. Returns whether it answers the sensors sent last.
bool Px4Port::take(Session& session, const autopilot::MavlinkFrame& received) {
  if (received.message != autopilot::HilActuatorControls::kMessage.number) return false;
  const auto controls = autopilot::decode_payload<autopilot::HilActuatorControls>(received.payload);
  const autopilot::ControlVerdict verdict = session.gate.receive(controls.time_us, px4_stamp_us(session.step));
  switch (verdict) {
    case autopilot::ControlVerdict::kAnswer:
    case autopilot::ControlVerdict::kLate:
      break;
    case autopilot::ControlVerdict::kRepetition:
      return false;
    case autopilot::ControlVerdict::kStale:
      log("stale", "PX4's outputs are stamped before the last ones; they are ignored");
      return false;
    case autopilot::ControlVerdict::kFuture:
      log("future", "PX4's outputs are stamped after the sensors' time; they are ignored");
      return false;
  }
  use_outputs(session, controls);
  if (verdict == autopilot::ControlVerdict::kLate) return false;
  ++session.answers;
  return true;
}

void Px4Port::use_outputs(Session& session, const autopilot::HilActuatorControls& controls) {
  session.heard = WallClock::now();
  const bool armed = (controls.mode & kModeArmed) != 0;
  for (std::size_t i = 0; i < session.outputs.size(); ++i) {
    const double output = armed ? controls.controls[i] : 0.0;
    if (std::isnan(output)) log("NaN", "an output of PX4 is not a number; that motor stops");
    session.outputs[i] = output;
  }
}

void Px4Port::report_damage(Session& session) {
  const std::uint64_t damaged = session.reader.wrong_checksums() + session.reader.noise_bytes();
  if (damaged == session.damaged) return;
  session.damaged = damaged;
  log("damage", "what PX4 sent is damaged: " + std::to_string(session.reader.wrong_checksums()) +
                    " frames with a wrong checksum, " + std::to_string(session.reader.noise_bytes()) +
                    " bytes outside frames");
}

void Px4Port::keep_pace(Session& session) const {
  if (pace_.as_fast_as_possible && pace_.lockstep) return;
  const auto now = WallClock::now();
  session.due = std::max(session.due, now - kMaxLagOfPx4);
  std::this_thread::sleep_until(session.due);
  session.due +=
      std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(kPx4Step_s / pace_.speed));
}

}  // namespace tileflight::simulator
