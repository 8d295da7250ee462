#include "tileflight/capture/vehicle/autopilot_plan.h"

#include <utility>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::vehicle {
namespace {

using base::StrictSection;

constexpr int kArduPilotPort = 9002, kPx4Port = 4560;
constexpr double kHurricane_m_s = 100.0, kMost_s = 3600.0;

geometry::Vec3 read_three(StrictSection& section, const char* key) {
  const auto numbers = section.numbers(key, 3, 3);
  return numbers ? geometry::Vec3(numbers->at(0), numbers->at(1), numbers->at(2)) : geometry::Vec3(0, 0, 0);
}

double read_limit(StrictSection& section, const char* key, double fallback_s) {
  const double value_s = section.positive_number(key).value_or(fallback_s);
  if (value_s > kMost_s) throw section.error(key, "must be at most 3600 seconds");
  return value_s;
}

int read_port(StrictSection& section, int fallback) {
  const int port = section.integer("port").value_or(fallback);
  if (port < 0 || port > 65535) throw section.error("port", "must be from 0 to 65535 (0: any free one)");
  return port;
}

double read_within(StrictSection& section, const char* key, double fallback, double least, double most) {
  const double value = section.number(key).value_or(fallback);
  if (!(value >= least && value <= most))
    throw section.error(key, "must be from " + base::trimmed_text(least, 3) + " to " + base::trimmed_text(most, 3));
  return value;
}

int read_side(StrictSection& section, const char* key, int fallback) {
  const int side = section.integer(key).value_or(fallback);
  if (side < 64 || side > 4096) throw section.error(key, "must be from 64 to 4096 pixels");
  return side;
}

VisionPlan read_vision(StrictSection section) {
  VisionPlan vision;
  const std::string source = section.choice("source", {"none", "truth", "odometry", "place"}).value_or("none");
  vision.source = source == "truth"      ? VisionPlan::Source::kTruth
                  : source == "odometry" ? VisionPlan::Source::kOdometry
                  : source == "place"    ? VisionPlan::Source::kPlace
                                         : VisionPlan::Source::kNone;
  vision.tiles = section.text("tiles").value_or("");
  if (!vision.tiles.empty() && vision.source != VisionPlan::Source::kPlace)
    throw section.error("tiles", "is of source: place only");
  vision.rate_hz = read_within(section, "rate_hz", vision.rate_hz, 1.0, 125.0);
  vision.latency_s = read_within(section, "latency_s", vision.latency_s, 0.0, 1.0);
  vision.width = read_side(section, "width", vision.width);
  vision.height = read_side(section, "height", vision.height);
  vision.fov_deg = read_within(section, "fov_deg", vision.fov_deg, 1.0, 170.0);
  vision.pitch_deg = read_within(section, "pitch_deg", vision.pitch_deg, -90.0, 90.0);
  vision.offset_m = read_three(section, "offset_m");
  section.require_all_keys_used();
  return vision;
}

std::optional<double> read_expo(StrictSection& section) {
  const auto expo = section.number("thrust_expo");
  if (expo && !(*expo >= 0.0 && *expo <= 1.0)) throw section.error("thrust_expo", "must be from 0 to 1");
  return expo;
}

}  // namespace

AutopilotPlan read_autopilot_plan(StrictSection& section, const std::filesystem::path& file) {
  AutopilotPlan plan;
  const auto kind = section.choice("kind", {"ardupilot", "px4"});
  if (!kind) throw section.error("kind", "is missing; it is ardupilot or px4");
  plan.is_px4 = *kind == "px4";
  plan.command = section.text("command").value_or("");
  plan.folder = file.has_parent_path() ? file.parent_path() : ".";
  // Without a command, where autopilots look by themselves.
  plan.port = read_port(section, !plan.command.empty() ? 0 : plan.is_px4 ? kPx4Port : kArduPilotPort);
  plan.hexarotor = section.choice("model", {"quadrotor", "hexarotor"}).value_or("quadrotor") == "hexarotor";
  plan.thrust_expo = read_expo(section);
  plan.start_m = read_three(section, "start");
  plan.start_heading_deg = section.number("start_heading_deg").value_or(plan.start_heading_deg);
  plan.wind_m_s = read_three(section, "wind_m_s");
  if (!(plan.wind_m_s.norm() <= kHurricane_m_s)) throw section.error("wind_m_s", "must be at most 100 m/s");
  plan.mount = read_mount(section);
  plan.gnss = section.boolean("gnss").value_or(true);
  if (auto vision = section.section("vision")) plan.vision = read_vision(std::move(*vision));
  if (const auto beside = plan.folder / plan.vision.tiles;
      !plan.vision.tiles.empty() && std::filesystem::exists(beside))
    plan.vision.tiles = beside.string();
  if (!plan.is_px4 && (!plan.gnss || plan.vision.source != VisionPlan::Source::kNone))
    throw section.error(plan.gnss ? "vision" : "gnss",
                        "is for px4 only: ArduPilot's JSON interface sends the true state");
  plan.duration_s = read_limit(section, "duration_s", plan.duration_s);
  plan.connect_timeout_s = read_limit(section, "connect_timeout_s", plan.connect_timeout_s);
  plan.silence_s = read_limit(section, "silence_s", plan.silence_s);
  section.require_all_keys_used();
  return plan;
}

}  // namespace tileflight::vehicle
