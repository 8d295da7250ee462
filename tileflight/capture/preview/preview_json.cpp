#include "tileflight/capture/preview/preview_json.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/program.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::preview {

namespace {

using nlohmann::json;

/// Number and size of the distinct files in the cuts of all groups.
struct CutSize {
  std::size_t tiles = 0, files = 0;
  std::optional<std::uintmax_t> bytes;  ///< nullopt: unknown to the source
};

CutSize measure_cut(PreviewedFlight& flight) {
  std::set<std::string> uris;
  std::set<std::pair<tileset::NodeId, std::size_t>> contents;
  for (const std::vector<std::size_t>& group :
       recording::group_flight_frames(flight.mission, flight.settings.render).frames) {
    const auto wanted = criterion_of(flight, group, flight.settings.render.error_px);
    for (const tileset::CutContent& content : flight.place.select_cut(wanted).contents) {
      uris.insert(content.uri);
      contents.emplace(content.node, content.content);
    }
  }
  CutSize size{contents.size(), uris.size(), std::nullopt};
  if (!flight.place.source().knows_sizes()) return size;
  size.bytes = 0;
  for (const std::string& uri : uris)
    *size.bytes += fetch::is_data_uri(uri) ? 0 : flight.place.source().size(uri).value_or(0);
  return size;
}

}  // namespace

/// Extrapolates the images' cost to the whole flight.
json estimate_cost(PreviewedFlight& flight, const std::vector<SamplePicture>& pictures) {
  const CutSize size = measure_cut(flight);
  double tiles = 0, memory = 0, load_s = 0, render_s = 0, encode_s = 0;
  for (const SamplePicture& p : pictures) {
    tiles += static_cast<double>(p.tiles);
    memory += static_cast<double>(p.memory_bytes);
    load_s += p.load_s;
    render_s += p.render_s / static_cast<double>(pictures.size());
    encode_s += p.encode_s / static_cast<double>(pictures.size());
  }
  const double per_tile = tiles > 0 ? static_cast<double>(size.tiles) / tiles : 0.0;
  const auto frames = static_cast<double>(flight.mission.image_count());
  const int threads = tbb::this_task_arena::max_concurrency();
  const double memory_all = memory * per_tile, parts = std::ceil(memory_all / static_cast<double>(flight.memory));
  const double loading_s = load_s * per_tile;
  const double rendering_s = frames * std::max(render_s, (render_s * (threads - 1) + encode_s) / threads);
  const imaging::Camera& camera = flight.mission.calibration.camera;
  return {{"frames", flight.frames().size()},
          {"pixels", frames * camera.width() * camera.height()},
          {"tiles", size.tiles},
          {"files", size.files},
          {"bytes", size.bytes ? json(*size.bytes) : json()},
          {"memory_bytes", std::round(std::min(memory_all, static_cast<double>(flight.memory)))},
          {"memory_bytes_whole", std::round(memory_all)},
          {"parts", std::max(1.0, parts)},
          {"threads", threads},
          {"seconds", {{"load", loading_s}, {"render", rendering_s}, {"total", loading_s + rendering_s}}},
          {"frames_per_second", rendering_s > 0 ? frames / rendering_s : 0.0}};
}

using nlohmann::json;

std::string preview_text(const json& found, const fs::path& out) {
  const auto about = [](double seconds) {
    if (seconds < 90) return base::formatted("%.0f s", std::max(1.0, seconds));
    return seconds < 5400 ? base::formatted("%.0f min", seconds / 60) : base::formatted("%.1f h", seconds / 3600);
  };
  std::string text =
      out.string() + ": " + std::to_string(found["frames"].get<int>()) + " frames in " +
      base::formatted("%.1f s over %.1f m", found["duration_s"].get<double>(), found["path_length"].get<double>());
  const auto range = [&](const char* key, const char* words) {
    if (found[key].is_null()) return;
    text += base::formatted("\n%s: %.1f to %.1f m", words, found[key]["min"].get<double>(),
                            found[key]["max"].get<double>());
  };
  range("height_above_ground", "height above the surface below");
  if (const json& nearest = found["nearest_surface"]; !nearest.is_null())
    text += base::formatted("; nearest surface %.2f m at frame %d", nearest["distance"].get<double>(),
                            nearest["frame"].get<int>());
  const json& cost = found["cost"];
  text += base::formatted("\nrendering: %.3g million pixels from %d tiles", cost["pixels"].get<double>() / 1e6,
                          cost["tiles"].get<int>());
  if (!cost["bytes"].is_null()) text += base::formatted(" (%.1f MB)", cost["bytes"].get<double>() / 1e6);
  text += base::formatted(", about %.2f GB of memory and about ", cost["memory_bytes"].get<double>() / 1e9) +
          about(cost["seconds"]["total"]) + base::formatted(" with %d threads\n", cost["threads"].get<int>());
  for (const auto& warning : found["warnings"]) text += "warning: " + warning.get<std::string>() + "\n";
  if (found["warnings"].empty()) text += "no problems found\n";
  return text;
}

namespace {

using nlohmann::json;

/// Minimum, median and maximum of the finite values; null if there are none.
json min_median_max(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return nullptr;
  std::sort(values.begin(), values.end());
  return {{"min", values.front()}, {"median", values[values.size() / 2]}, {"max", values.back()}};
}

json views_json(const FlightCheck& check) {
  std::vector<double> shares, flows;
  for (const ViewCheck& view : check.views) {
    shares.push_back(view.surface_share);
    flows.push_back(view.flow_share);
  }
  return {{"surface_share", min_median_max(shares)}, {"flow_share", min_median_max(flows)}};
}

json pictures_json(const PreviewedFlight& flight, const std::vector<SamplePicture>& pictures) {
  json out = json::array();
  for (const SamplePicture& p : pictures) {
    out.push_back({{"file", p.name + ".jpg"},
                   {"frame", p.frame},
                   {"time_s", flight.frames().poses[p.frame].time_s},
                   {"surface_share", p.surface_share},
                   {"tiles", p.tiles},
                   {"pixel_error", p.error_px ? json(*p.error_px) : json()},
                   {"seconds", {{"load", p.load_s}, {"render", p.render_s}, {"encode", p.encode_s}}}});
  }
  return out;
}

json flight_json(const PreviewedFlight& flight) {
  const imaging::Camera& camera = flight.mission.calibration.camera;
  const auto& poses = flight.frames().poses;
  return {{"source", flight.place.name()},
          {"flight", flight.settings.render.flight.flight.string()},
          {"frames", poses.size()},
          {"duration_s", poses.back().time_s - poses.front().time_s},
          {"path_length", geometry::path_length_m(flight.frames())},
          {"camera", {{"resolution", {camera.width(), camera.height()}}, {"fov_deg", camera.horizontal_fov_deg()}}}};
}

json faults_json(const std::vector<render::FlightFault>& faults) {
  json out = json::object();
  for (const render::FlightFault& fault : faults) out[fault.key] = fault.frames;
  return out;
}

}  // namespace

json nearest_surface(const FlightCheck& check, const geometry::Trajectory& frames) {
  const auto clearance = [](const render::FrameCheck& f) { return f.surroundings.clearance_m; };
  const auto nearest = std::ranges::min_element(check.frames, {}, clearance);
  if (nearest == check.frames.end() || !std::isfinite(clearance(*nearest))) return nullptr;
  const auto i = static_cast<std::size_t>(nearest - check.frames.begin());
  return {{"distance", clearance(*nearest)}, {"frame", i}, {"time_s", frames.poses[i].time_s}};
}

json preview_json(PreviewedFlight& flight, const FlightCheck& check, const std::vector<SamplePicture>& pictures,
                  const std::vector<render::FlightFault>& faults, const std::vector<std::string>& warnings) {
  std::vector<double> above_ground, clearance;
  for (const render::FrameCheck& frame : check.frames) {
    above_ground.push_back(frame.surroundings.above_ground_m);
    clearance.push_back(frame.surroundings.clearance_m);
  }
  json out = flight_json(flight);
  out["height_above_ground"] = min_median_max(above_ground);
  out["clearance"] = min_median_max(clearance);
  out["nearest_surface"] = nearest_surface(check, flight.frames());
  out["view"] = views_json(check);
  out["start"] = nullptr;
  if (check.initialization) {
    out["start"] = {{"parallax_deg", check.initialization->parallax_rad * 180 / M_PI},
                    {"needed_deg", flight.settings.check.min_initialization_parallax_rad * 180 / M_PI},
                    {"at_frame", check.initialization->at_frame}};
  }
  out["pictures"] = pictures_json(flight, pictures);
  out["cost"] = estimate_cost(flight, pictures);
  out["faults"] = faults_json(faults);
  out["warnings"] = warnings;
  out["attribution"] = flight.place.attribution();
  out["version"] = base::version();
  return out;
}

}  // namespace tileflight::preview
