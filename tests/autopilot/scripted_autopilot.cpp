// scripted_autopilot ardupilot|px4|px4-vision PORT END AT_S NORTH,EAST,DOWN…
//
// Flies the points by ArduPilot's JSON interface or PX4's simulator interface, from the vehicle's start, and lands.
// px4-vision: by its inertial unit, barometer and ODOMETRY, whatever else it is told; it prints its own path and the
// true one, `seconds, true north, east, down, its own, messages of vision`, five times a second.
// END: `lands`, or what it does at AT_S seconds: `dies` (with a last word and exit status 3), `hangs`, `stammers` (of
// ArduPilot: sends a packet that is none, and flies on). After landing it goes on, as a real one does, until it is not
// answered any more.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/live/autopilot/test_ardupilot_client.h"
#include "tileflight/live/autopilot/test_px4_client.h"
#include "tileflight/live/autopilot/test_vision_autopilot.h"

namespace {

namespace support = tileflight::autopilot::test_support;
using tileflight::geometry::Vec3;

/// Returns unless it ends here.
void end_at(const std::string& end, double at_s, double now_s) {
  if (end == "lands" || end == "stammers" || now_s < at_s) return;
  std::cerr << "battery\nbattery empty at " << at_s << " s" << std::endl;
  if (end == "dies") std::exit(3);
  std::this_thread::sleep_for(std::chrono::hours(1));
}

void fly_ardupilot(std::uint16_t port, std::vector<Vec3> points, const std::string& end, double at_s) {
  constexpr int kRate = 400;
  const support::UdpClient client(port);
  support::ScriptedAutopilot autopilot(tileflight::vehicle::make_airframe(tileflight::vehicle::AirframeKind::kQuadX),
                                       std::move(points), 0.65);
  support::Observation seen;
  bool stammers = end == "stammers";
  for (std::uint32_t frame = 0;; ++frame) {
    end_at(end, at_s, seen.time_s);
    if (stammers && seen.time_s >= at_s) {
      client.send("no packet");
      stammers = false;
    }
    const auto pwm = support::pulses(autopilot.outputs(seen, 1.0 / kRate));
    const std::string line = client.ask(support::servo_datagram(kRate, frame, pwm));
    if (line.empty()) return;
    seen = support::parse_state(line);
  }
}

void fly_px4(std::uint16_t port, std::vector<Vec3> points, const std::string& end, double at_s) {
  support::ScriptedPx4 px4(port, std::move(points));
  while (px4.round()) end_at(end, at_s, px4.time_s());
}

void fly_by_vision(std::uint16_t port, std::vector<Vec3> points, const std::string& end, double at_s) {
  support::VisionPx4 px4(port, std::move(points));
  for (double next_s = 0.0; px4.round(); end_at(end, at_s, px4.time_s())) {
    if (px4.time_s() < next_s) continue;
    next_s += 0.2;
    const Vec3& own = px4.estimator().observation().position_m;
    const Vec3& true_m = px4.truth().position_m;
    std::printf("%.2f, %.3f, %.3f, %.3f, %.3f, %.3f, %.3f, %zu\n", px4.time_s(), true_m.x(), true_m.y(), true_m.z(),
                own.x(), own.y(), own.z(), px4.ears().odometries.size());
    std::fflush(stdout);
  }
}

}  // namespace

int main(int count, char** words) {
  if (count < 6) return 2;
  const std::string kind = words[1], end = words[3];
  const auto port = static_cast<std::uint16_t>(std::stoi(words[2]));
  std::vector<Vec3> points;
  for (int i = 5; i < count; ++i) {
    Vec3 point;
    if (std::sscanf(words[i], "%lf,%lf,%lf", &point.x(), &point.y(), &point.z()) != 3) return 2;
    points.push_back(point);
  }
  const double at_s = std::stod(words[4]);
  if (kind == "px4-vision") {
    fly_by_vision(port, points, end, at_s);
    return 0;
  }
  kind == "px4" ? fly_px4(port, points, end, at_s) : fly_ardupilot(port, points, end, at_s);
  return 0;
}
