#include "tileflight/capture/preview/cost_estimate.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

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

}  // namespace tileflight::preview
