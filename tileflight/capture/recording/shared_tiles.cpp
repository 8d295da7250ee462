// PartRenderer's images of processes that share the tiles: each traces every image against its part of them.
#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "tileflight/capture/recording/part_renderer.h"
#include "tileflight/capture/render/frame_parts.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::recording {
namespace {

constexpr double kUnknownFileSize = 65536.0;

/// A packed layer of an image in a message to the process that completes it.
void append_layer(std::string& message, std::size_t image, const std::string& layer) {
  base::append_raw(message, static_cast<std::uint64_t>(image));
  base::append_raw(message, static_cast<std::uint64_t>(layer.size()));
  message += layer;
}

/// Calls `work` with each image, and its layer, of such a message.
template <class Work>
void for_each_layer(const std::string& message, const Work& work) {
  const auto number_at = [&](std::size_t at) {
    return base::read_raw<std::uint64_t>(std::as_bytes(std::span(message)), at);
  };
  constexpr std::size_t kHead = 2 * sizeof(std::uint64_t);
  for (std::size_t at = 0; at < message.size();) {
    const std::size_t size = number_at(at + sizeof(std::uint64_t));
    work(static_cast<std::size_t>(number_at(at)), std::string_view(message).substr(at + kHead, size));
    at += kHead + size;
  }
}

}  // namespace

std::size_t PartRenderer::Together::rank_of(std::size_t image) const {
  const auto place = static_cast<std::size_t>(std::ranges::lower_bound(images, image) - images.begin());
  return place % static_cast<std::size_t>(ranks.count());
}

/// Empty: they may be.
std::string PartRenderer::why_tiles_are_not_dealt() const {
  if (!may_divide_images(mission_))
    return "light, a lidar, a range finder or an event camera needs more of the place than a frame shows";
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    if (!render::has_one_ray_per_pixel(mission_.camera(c).options))
      return "a pixel takes several rays (samples, motion blur, chromatic aberration)";
  }
  return "";
}

/// Of the frames that this process would render.
TileUses PartRenderer::uses_of(const FrameAssignment& share) const {
  std::map<std::size_t, std::set<std::size_t>> seen;  // contents by group
  for (const FrameView& view : views_to_load(share)) {
    const std::size_t group = tiles_->groups().group_of_frame[view.frame];
    for (const std::size_t place : tiles_->places_for_view({view.frame, {}, Sight::kPicture}))
      seen[group].insert(tiles_->contents_of_group(group)[place]);
  }
  TileUses uses(tiles_->content_count(), 0);
  for (const auto& [group, contents] : seen) {
    for (const std::size_t content : contents) ++uses[content];
  }
  return uses;
}

/// A file that several contents refer to is read once by each process.
SharingCosts PartRenderer::sharing_costs(const std::vector<TileUses>& by_rank) const {
  SharingCosts costs{.processes = by_rank.size()};
  std::set<std::pair<std::size_t, std::string>> dealt_frames, dealt_tiles;
  for (std::size_t content = 0; content < tiles_->content_count(); ++content) {
    const tileset::CutContent& tile = tiles_->content(content);
    const auto bytes = static_cast<double>(tiles_->file_bytes(tile).value_or(kUnknownFileSize));
    bool is_used = false;
    for (std::size_t rank = 0; rank < by_rank.size(); ++rank) {
      if (by_rank[rank][content] == 0) continue;
      is_used = true;
      costs.scene_bytes += bytes * by_rank[rank][content];
      if (dealt_frames.emplace(rank, tile.uri).second) costs.frames_dealt_bytes += bytes;
    }
    if (is_used && dealt_tiles.emplace(rank_of_content_[content], tile.uri).second) costs.tiles_dealt_bytes += bytes;
  }
  for (std::size_t i = 0; i < images().count(); ++i) {
    const imaging::Camera& camera = camera_of(i).calibration.camera;
    costs.pixels += static_cast<double>(camera.width()) * camera.height();
  }
  return costs;
}

bool PartRenderer::deal_out_tiles(jobs::Ranks& ranks, FrameAssignment& share) {
  if (ranks.count() == 1 || settings_.dealt == Dealt::kFrames) return false;
  const std::string why_not = why_tiles_are_not_dealt();
  if (!why_not.empty() && settings_.dealt == Dealt::kTiles)
    throw jobs::CollectiveError("--deal tiles: " + why_not + "; with --deal frames each process renders some");
  if (!why_not.empty()) return false;
  std::string own;
  run_collectively(ranks, [&] { own = to_bytes(uses_of(share)); });
  std::vector<TileUses> by_rank;
  for (const std::string& bytes : ranks.all_gather(own)) by_rank.push_back(uses_from_bytes(bytes));
  std::vector<TileWork> work;
  for (std::size_t content = 0; content < tiles_->content_count(); ++content) {
    double uses = 0.0;
    for (const TileUses& of_rank : by_rank) uses += of_rank[content];
    const auto bytes = static_cast<double>(tiles_->file_bytes(tiles_->content(content)).value_or(kUnknownFileSize));
    // It is read once; each scene takes about as much again for its trees and textures.
    work.push_back({tiles_->center(content), uses > 0.0 ? bytes * (1.0 + uses) : 0.0});
  }
  rank_of_content_ = deal_tiles(work, by_rank.size());
  if (settings_.dealt == Dealt::kAuto && !sharing_costs(by_rank).is_tiles_better()) {
    rank_of_content_.clear();
    return false;
  }
  share.render_together();
  return true;
}

RenderSummary PartRenderer::run_together(jobs::Ranks& ranks, FrameAssignment& share, const CameraFrameSink& sink) {
  RenderSummary summary;
  summary.are_tiles_dealt = true;
  summary.exposure_after.resize(mission_.camera_count());
  std::vector<std::size_t> all;
  for (const FrameView& view : views_to_load(share)) all.push_back(view.frame);
  std::vector<bool> is_own;
  for (const std::size_t rank : rank_of_content_) is_own.push_back(rank == static_cast<std::size_t>(ranks.rank()));
  loader_for(views_to_load(share)).set_own_contents(std::move(is_own));
  const std::size_t most = images_together(ranks);
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t next = 0; next < all.size(); next += most) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(next);
    const std::vector<std::size_t> batch(first, first + static_cast<std::ptrdiff_t>(std::min(most, all.size() - next)));
    for (const std::vector<std::size_t>& of_camera : by_camera(batch))
      render_together(of_camera, ranks, share, sink, summary);
  }
  summary.seconds = base::seconds_since(start);
  run_collectively(ranks, [&] { keep_records(share); });
  loader_.reset();
  return summary;
}

/// As many as the memory of the process that has least allows.
std::size_t PartRenderer::images_together(jobs::Ranks& ranks) const {
  constexpr std::uintmax_t kMemoryPart = 5;
  constexpr std::size_t kMost = 64;
  std::size_t count = kMost;
  const std::string own = std::to_string(max_memory_bytes_ / kMemoryPart / bytes_of_traced_frame());
  for (const std::string& of_rank : ranks.all_gather(own)) count = std::min<std::size_t>(count, std::stoull(of_rank));
  return std::max<std::size_t>(count, 1);
}

/// What this process traces of the images' pictures; of those that it completes at least the sky.
std::vector<FrameView> PartRenderer::views_together(const Together& together, double bytes_for_tiles) const {
  std::vector<FrameView> views;
  const std::vector<ContentRange> layers = divide_into_layers(together.images, bytes_for_tiles);
  for (const ContentRange& layer : layers) {
    for (const std::size_t image : together.images) {
      const FrameView view{image, {}, Sight::kPicture, layer};
      const bool is_sky = layer == layers.front() && together.rank_of(image) == together.own_rank();
      if (is_sky || loader_->needs_contents(view)) views.push_back(view);
    }
  }
  return views;
}

/// Traces the images' views; returns those that this process completes, with the other processes' layers. Those of the
/// others are sent away as soon as they are traced.
PartRenderer::LayeredFrames PartRenderer::compose_together(
    const Together& together, bool has_checks, const std::function<void(const LoadedPart&, LayeredFrames&)>& trace) {
  LayeredFrames frames;
  std::vector<std::string> messages(static_cast<std::size_t>(together.ranks.count()));
  run_collectively(together.ranks, [&] {
    const double for_tiles = bytes_for_tiles(together.images.size());
    std::vector<FrameView> views;
    if (has_checks) views = checks_of(together.images, for_tiles);
    const std::vector<FrameView> pictures = views_together(together, for_tiles);
    views.insert(views.end(), pictures.begin(), pictures.end());
    for_each_view(std::move(views), for_tiles, together.share, [&](const LoadedPart& part) {
      trace(part, frames);
      std::set<std::size_t> later;
      for (std::size_t i = part.end; i < loader_->views().size(); ++i) later.insert(loader_->views()[i].frame);
      for (std::size_t i = part.begin; i < part.end; ++i) {
        const std::size_t image = loader_->views()[i].frame, rank = together.rank_of(image);
        if (rank == together.own_rank() || later.contains(image)) continue;
        append_layer(messages[rank], image, frames[image].packed());
        frames.erase(image);
      }
    });
  });
  const std::vector<std::string> received = together.ranks.exchange(std::move(messages));
  run_collectively(together.ranks, [&] {
    for (const std::string& message : received)
      for_each_layer(message, [&](std::size_t image, std::string_view layer) { frames.at(image).add_packed(layer); });
  });
  return frames;
}

/// Mean light of the images, known to all processes.
std::map<std::size_t, double> PartRenderer::meter_together(const Together& together) {
  const std::size_t number = images()[together.images.front()].camera;
  const PlannedCamera& camera = mission_.camera(number);
  LayeredFrames pictures = compose_together(together, false, [&](const LoadedPart& part, LayeredFrames& frames) {
    const render::LightMeter meter =
        render::make_light_meter(part.scene, camera.calibration.camera, options_for(part, number, together.share));
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const std::size_t image = loader_->views()[i].frame;
      render::TracedLayer layer;
      layer.frame.light = meter.layer(camera.frames.poses[images()[image].frame].T_local_camera, layer.surfaces);
      frames[image].add(std::move(layer), part.mesh_ranks);
    }
  });
  nlohmann::json own = nlohmann::json::array();
  const scene::Scene nothing(place::with_placeholder({}), geometry::Vec3::Zero());
  const render::LightMeter meter = render::make_light_meter(nothing, camera.calibration.camera, options_of(number));
  for (auto& [image, picture] : pictures) own.push_back({image, meter.mean_light(picture.take_frame().light)});
  std::map<std::size_t, double> light;
  for (const std::string& of_rank : together.ranks.all_gather(own.dump())) {
    for (const nlohmann::json& one : nlohmann::json::parse(of_rank)) light[one[0].get<std::size_t>()] = one[1];
  }
  return light;
}

void PartRenderer::render_together(const std::vector<std::size_t>& of_camera, jobs::Ranks& ranks,
                                   FrameAssignment& share, const CameraFrameSink& sink, RenderSummary& summary) {
  const std::size_t number = images()[of_camera.front()].camera;
  const PlannedCamera& camera = mission_.camera(number);
  std::vector<double> gains;
  if (camera.options.formation.auto_exposure.target > 0.0)
    gains = gains_of(of_camera, meter_together({ranks, share, of_camera}), summary);
  Together together{ranks, share, of_camera};
  std::erase_if(together.images, [&](std::size_t image) { return !share.is_assigned(image); });
  if (together.images.empty()) return;
  LayeredFrames frames = compose_together(together, true, [&](const LoadedPart& part, LayeredFrames& traced) {
    ++summary.parts;
    if (is_check(part)) {
      return for_each_check(part,
                            [&](std::size_t image, const render::PathCheck& check) { traced[image].add_check(check); });
    }
    const render::FlightRenderOptions options = options_for(part, together.images, gains, share);
    const render::FrameRenderer renderer(part.scene, camera.calibration.camera, camera.frames, camera.pose_at, options);
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const FrameView& view = loader_->views()[i];
      traced[view.frame].add(renderer.trace_layer(images()[view.frame].frame), part.mesh_ranks);
    }
    summary.tiles.triangles = std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
  });
  run_collectively(ranks, [&] { finish_together(together, gains, std::move(frames), sink); });
  report_progress(progress_, static_cast<std::int64_t>(together.images.back()) + 1,
                  static_cast<std::int64_t>(images().count()), "frames rendered");
}

/// Exposes this process's images and hands them on.
void PartRenderer::finish_together(const Together& together, const std::vector<double>& gains, LayeredFrames frames,
                                   const CameraFrameSink& sink) const {
  const std::size_t number = images()[together.images.front()].camera;
  const PlannedCamera& camera = mission_.camera(number);
  render::FlightRenderOptions options = options_of(number);
  options.exposure_gains = gains;
  options.first_frame = images()[together.images.front()].frame;
  options.end_frame = images()[together.images.back()].frame + 1;
  options.placed = {};
  const scene::Scene nothing(place::with_placeholder({}), geometry::Vec3::Zero());  // developing needs none
  const render::FrameRenderer renderer(nothing, camera.calibration.camera, camera.frames, camera.pose_at, options);
  tbb::parallel_for_each(frames, [&](LayeredFrames::value_type& frame) {
    render::TracedFrame traced = frame.second.take_frame();
    renderer.finish_layers(traced, anchor_of(frame.first).z());
    const render::FlightFrame finished = renderer.develop(std::move(traced));
    sink(number, finished);
    together.share.add(frame.first, finished);
  });
}

}  // namespace tileflight::recording
