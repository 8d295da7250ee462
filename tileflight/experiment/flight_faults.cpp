#include "tileflight/experiment/flight_faults.h"

#include <charconv>
#include <optional>
#include <sstream>
#include <utility>

namespace tileflight::experiment {
namespace {

const std::string kPrefix = "warnings.";

/// More than any flight has.
constexpr std::size_t kMostFrames = 10'000'000;

std::optional<std::size_t> number(const std::string& text) {
  std::size_t value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size() || value > kMostFrames) return std::nullopt;
  return value;
}

std::string words_of(const std::string& key) {
  if (key == "camera_near_surface") return "a surface is very near to the camera";
  if (key == "no_surface_in_view") return "no surface is in view";
  if (key == "camera_inside_surface") return "the camera is inside or under a surface";
  if (key == "surfaces_seen_from_behind") return "most surfaces are seen from behind";
  if (key == "path_through_surface") return "the path to the next frame goes through a surface";
  return "";
}

}  // namespace

std::string frame_runs(const std::vector<std::size_t>& frames) {
  std::string text;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::size_t first = frames[i];
    while (i + 1 < frames.size() && frames[i + 1] == frames[i] + 1) ++i;
    text += (text.empty() ? "" : ",") + std::to_string(first);
    if (frames[i] > first) text += "-" + std::to_string(frames[i]);
  }
  return text;
}

std::vector<std::size_t> frames_of_runs(const std::string& runs) {
  std::vector<std::size_t> frames;
  std::istringstream parts(runs);
  for (std::string part; std::getline(parts, part, ',');) {
    const std::size_t dash = part.find('-');
    const auto first = number(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : number(part.substr(dash + 1));
    if (!first || !last) continue;
    for (std::size_t i = *first; i <= *last && frames.size() < kMostFrames; ++i) frames.push_back(i);
  }
  return frames;
}

std::map<std::string, std::string> described_faults(const std::vector<sensors::FlightFault>& faults) {
  std::map<std::string, std::string> about;
  for (const sensors::FlightFault& fault : faults) about[kPrefix + fault.key] = frame_runs(fault.frames);
  return about;
}

std::vector<sensors::FlightFault> recorded_faults(const std::map<std::string, std::string>& about) {
  std::vector<sensors::FlightFault> faults;
  for (const auto& [name, runs] : about) {
    if (!name.starts_with(kPrefix)) continue;
    const std::string key = name.substr(kPrefix.size()), words = words_of(key);
    std::vector<std::size_t> frames = frames_of_runs(runs);
    if (!words.empty() && !frames.empty()) faults.push_back({key, words, std::move(frames)});
  }
  return faults;
}

}  // namespace tileflight::experiment
