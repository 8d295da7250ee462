#include "tileflight/capture/recording/flight_faults.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>
#include <utility>

#include "tileflight/world/scene/encounters.h"

namespace tileflight::recording {
namespace {

const std::string kPrefix = "warnings.";

/// Upper limit of frame indices; no flight is as long.
constexpr std::size_t kMaxFrames = 10'000'000;

std::optional<std::size_t> parse_frame_number(const std::string& text) {
  std::size_t value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size() || value > kMaxFrames) return std::nullopt;
  return value;
}

std::string fault_description(const std::string& key) {
  if (key == "camera_near_surface") return "a surface is very near to the camera";
  if (key == "no_surface_in_view") return "no surface is in view";
  if (key == "camera_inside_surface") return "the camera is inside or under a surface";
  if (key == "surfaces_seen_from_behind") return "most surfaces are seen from behind";
  if (key == "path_through_surface") return "the path to the next frame goes through a surface";
  if (key == "camera_inside_actor") return "the camera is inside an actor";
  if (key == "path_through_actor") return "on the way to the next frame the camera goes through an actor";
  return "";
}

/// "taxi, Ann and 3 more".
std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, names.size()); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > kMost ? text + " and " + std::to_string(names.size() - kMost) + " more" : text;
}

}  // namespace

std::vector<render::FlightFault> find_actor_faults(const PlannedFlight& mission, std::size_t camera) {
  std::vector<render::FlightFault> faults;
  if (!mission.traffic) return faults;
  const PlannedCamera& taking = mission.camera(camera);
  geometry::Trajectory frames = taking.frames;
  for (geometry::StampedPose& pose : frames.poses) pose.time_s += taking.timeshift_s;  // the actors' clock
  const auto pose_at = [&taking](double time_s) { return taking.pose_at(time_s - taking.timeshift_s); };
  const scene::Encounters met =
      scene::find_encounters(*mission.traffic, frames, taking.pose_at ? render::PoseFunction(pose_at) : nullptr);
  const auto add = [&](const char* key, const std::vector<std::size_t>& frames, const auto& names) {
    if (!frames.empty()) faults.push_back({key, fault_description(key) + " (" + listed(names) + ")", frames});
  };
  add("camera_inside_actor", met.inside, met.inside_of);
  add("path_through_actor", met.through, met.through_what);
  return faults;
}

std::string format_frame_ranges(const std::vector<std::size_t>& frames) {
  std::string text;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::size_t first = frames[i];
    while (i + 1 < frames.size() && frames[i + 1] == frames[i] + 1) ++i;
    text += (text.empty() ? "" : ",") + std::to_string(first);
    if (frames[i] > first) text += "-" + std::to_string(frames[i]);
  }
  return text;
}

std::vector<std::size_t> parse_frame_ranges(const std::string& runs) {
  std::vector<std::size_t> frames;
  std::istringstream parts(runs);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::size_t dash = part.find('-');
    const auto first = parse_frame_number(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : parse_frame_number(part.substr(dash + 1));
    if (!first || !last) continue;
    for (std::size_t i = *first; i <= *last && frames.size() < kMaxFrames; ++i) frames.push_back(i);
  }
  return frames;
}

std::map<std::string, std::string> faults_to_metadata(const std::vector<render::FlightFault>& faults) {
  std::map<std::string, std::string> about;
  for (const render::FlightFault& fault : faults) about[kPrefix + fault.key] = format_frame_ranges(fault.frames);
  return about;
}

std::vector<render::FlightFault> faults_from_metadata(const std::map<std::string, std::string>& about) {
  std::vector<render::FlightFault> faults;
  for (const auto& [name, runs] : about) {
    if (!name.starts_with(kPrefix)) continue;
    const std::string key = name.substr(kPrefix.size()), words = fault_description(key);
    std::vector<std::size_t> frames = parse_frame_ranges(runs);
    if (!words.empty() && !frames.empty()) faults.push_back({key, words, std::move(frames)});
  }
  return faults;
}

}  // namespace tileflight::recording
