#include "tileflight/capture/recording/flight_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/tiles/tileset/region_reader.h"

namespace tileflight::recording {
namespace {

using geometry::Vec3;
using nlohmann::json;
using tileset::BoundingSphere;

constexpr double kSlack_m = 1.0;  // beyond what is looked for around a camera

/// The view cones of each image.
std::vector<std::vector<tileset::ViewCone>> image_view_cones(const PlannedFlight& mission, const ImageOrder& images) {
  std::vector<std::vector<tileset::ViewCone>> by_image(images.count());
  for (std::size_t camera = 0; camera < mission.camera_count(); ++camera) {
    const std::vector<tileset::ViewCone> all = flight_view_cones(mission, camera);
    const std::size_t frames = mission.camera(camera).frames.size();
    for (std::size_t frame = 0; frame < frames; ++frame) {
      const auto per_frame = static_cast<std::ptrdiff_t>(all.size() / frames);
      const auto first = all.begin() + static_cast<std::ptrdiff_t>(frame) * per_frame;
      by_image[images.number_of(camera, frame)].assign(first, first + per_frame);
    }
  }
  return by_image;
}

FrameGroups group_by_body(const PlannedFlight& mission, const ImageOrder& images, const RenderSettings& settings) {
  std::vector<Vec3> positions;
  for (std::size_t i = 0; i < images.count(); ++i)
    positions.push_back(body_position(mission.camera(images[i].camera), images[i].frame));
  return group_images(positions, mission, settings);
}

tileset::LoadOptions load_options_of(const std::vector<std::vector<tileset::ViewCone>>& cones,
                                     const RenderSettings& settings) {
  tileset::LoadOptions load = settings.load;
  load.uses = {fetch::Use::kAnalyse};
  if (!settings.error_px) return load;
  load.flight = {{}, *settings.error_px};
  for (const std::vector<tileset::ViewCone>& of_image : cones)
    load.flight->view_cones.insert(load.flight->view_cones.end(), of_image.begin(), of_image.end());
  return load;
}

std::unique_ptr<fetch::TileSource> open_permitted(const std::string& source, const tileset::LoadOptions& load) {
  std::unique_ptr<fetch::TileSource> opened = fetch::open_source(source, load.source);
  for (const fetch::Use use : load.uses)
    fetch::require_permitted(opened->terms(), use, load.source.terms_accepted, fetch::redact_source(source));
  return opened;
}

/// Whether the vertical line down from a point meets the sphere.
bool is_below(const BoundingSphere& sphere, const Vec3& point) {
  return (sphere.center - point).head<2>().norm() <= sphere.radius_m &&
         sphere.center.z() - sphere.radius_m <= point.z();
}

double distance_to_segment_m(const Vec3& point, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double length2 = along.squaredNorm();
  const double at = length2 > 0.0 ? std::clamp((point - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (point - a - at * along).norm();
}

}  // namespace

FlightTiles::FlightTiles(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress)
    : mission_(mission),
      images_(mission),
      cones_(image_view_cones(mission, images_)),
      load_(load_options_of(cones_, settings)),
      error_px_(settings.error_px),
      name_(fetch::redact_source(settings.source)),
      source_(open_permitted(settings.source, load_)),
      tree_(*source_),
      groups_(group_by_body(mission, images_, settings)) {
  report_progress(progress, 0, 0, "reading the tileset");
  tileset::require_supported_extensions(tree_.tileset(tree_.root()), name_);
  placement_ = tileset::resolve_placement(tree_, load_, name_);
  select_groups(progress);
  if (tileset::widen_to_contents(*source_, tree_, contents_to_try(), placement_.T_local_tileset))
    select_groups(progress);
  tileset::require_contents(cut_, tree_, placement_, load_, name_);
  lacks_textures_ = tileset::lacks_textures(*source_, tree_, cut_.contents, placement_.T_local_tileset);
  first_warnings_ = source_->warnings();
  if (lacks_textures_) first_warnings_.emplace_back(tileset::kNoTextures);
  if (!load_.allow_incomplete && !cut_.failures.empty()) throw tileset::incomplete_region(cut_.failures.front());
  records_.resize(content_count());
}

void FlightTiles::select_groups(const Progress& progress) {
  cut_ = {};
  spheres_.clear();
  contents_of_group_.clear();
  numbers_.clear();
  for (std::size_t group = 0; group < groups_.count(); ++group) {
    report_progress(progress, static_cast<std::int64_t>(group), static_cast<std::int64_t>(groups_.count()),
                    "selecting tiles");
    add_group(group);
  }
  if (groups_.count() > 1) cut_.hash = base::sha256_hex(cut_.hash);
}

/// Returns the contents whose volumes are checked: those selected, or, if nothing is, the coarsest below and above the
/// flight, whose volumes may state wrong heights.
std::vector<tileset::CutContent> FlightTiles::contents_to_try() {
  constexpr double kAround_m = 500.0, kAnyError = std::numeric_limits<double>::infinity();
  if (!cut_.contents.empty() || !error_px_) return cut_.contents;
  geometry::Box3 flown;
  for (const std::vector<tileset::ViewCone>& cones : cones_) {
    for (const tileset::ViewCone& cone : cones) flown.extend(cone.position);
  }
  const Vec3 size = flown.sizes() + Vec3::Constant(2 * kAround_m);
  try {
    return tileset::select_cut(tree_,
                               tileset::region_criterion(tileset::column_of({.center = flown.center(), .size = size}),
                                                         placement_.T_local_tileset, kAnyError))
        .contents;
  } catch (const tileset::TreeTooLarge&) {
    return {};
  }
}

tileset::TileCut FlightTiles::select_group(std::size_t group, double error_px) {
  tileset::LoadOptions load = load_;
  if (load.flight) {
    load.flight->error_px = error_px;
    load.flight->view_cones.clear();
    for (const std::size_t image : groups_.frames[group])
      load.flight->view_cones.insert(load.flight->view_cones.end(), cones_[image].begin(), cones_[image].end());
  }
  return tileset::select_cut(tree_, tileset::request_criterion(placement_, load));
}

void FlightTiles::add_group(std::size_t group) {
  tileset::TileCut cut = select_group(group, error_px_.value_or(0.0));
  std::vector<std::size_t>& contents = contents_of_group_.emplace_back();
  for (const tileset::CutContent& content : cut.contents) contents.push_back(number_of(content));
  base::add_distinct(cut.failures, cut_.failures);
  cut_.geometric_error_max_m = std::max(cut_.geometric_error_max_m, cut.geometric_error_max_m);
  cut_.hash += groups_.count() > 1 ? cut.hash + "\n" : cut.hash;
}

std::size_t FlightTiles::number_of(const tileset::CutContent& content) {
  const auto [known, is_new] = numbers_.emplace(std::pair(content.node, content.content), cut_.contents.size());
  if (is_new) {
    cut_.contents.push_back(content);
    spheres_.push_back(sphere_of(content));
  }
  return known->second;
}

BoundingSphere FlightTiles::sphere_of(const tileset::CutContent& content) const {
  const tileset::BoundingVolume volume =
      tree_.content_volume(content.node, content.content).value_or(tree_.volume(content.node));
  const geometry::Box3 box = tileset::local_bounding_box(volume, placement_.T_local_tileset);
  return {box.center(), box.sizes().norm() / 2};
}

std::optional<std::uintmax_t> FlightTiles::file_bytes(const tileset::CutContent& content) const {
  return fetch::is_data_uri(content.uri) ? std::nullopt : source_->size(content.uri);
}

std::function<bool(const BoundingSphere&)> FlightTiles::needs_of(std::size_t image) const {
  return [path = needs_of_path(image), seen = tileset::flight_criterion(cones_[image], geometry::SE3(), 0.0)](
             const BoundingSphere& sphere) { return seen.intersects(sphere) || path(sphere); };
}

/// Surfaces that may lie below the camera, around it, or near its way to the next frame.
std::function<bool(const BoundingSphere&)> FlightTiles::needs_of_path(std::size_t image) const {
  const PlannedCamera& camera = camera_of(image);
  const std::size_t frame = images_[image].frame;
  const Vec3& here = camera.frames.poses[frame].T_local_camera.translation;
  std::vector<Vec3> way{here};
  if (frame + 1 < camera.frames.size()) way = render::path_to_next_frame(camera.frames, frame, camera.pose_at);
  const double around_m = std::max(camera.options.clearance_m, kInsideReach_m) + kSlack_m;
  double way_m = 0.0;  // farthest from here
  for (const Vec3& point : way) way_m = std::max(way_m, (point - here).norm());
  return [here, way, around_m, way_m](const BoundingSphere& sphere) {
    if (is_below(sphere, here)) return true;
    const double distance_m = (sphere.center - here).norm() - sphere.radius_m;
    if (distance_m <= around_m || distance_m > way_m + kSlack_m) return distance_m <= around_m;
    for (std::size_t i = 0; i + 1 < way.size(); ++i) {
      if (distance_to_segment_m(sphere.center, way[i], way[i + 1]) <= sphere.radius_m + kSlack_m) return true;
    }
    return false;
  };
}

std::vector<std::size_t> FlightTiles::places_for_frame(std::size_t image) const {
  const auto needs = needs_of(image);
  const std::vector<std::size_t>& contents = contents_of_group_[groups_.group_of_frame[image]];
  std::vector<std::size_t> places;
  for (std::size_t place = 0; place < contents.size(); ++place) {
    if (needs(spheres_[contents[place]])) places.push_back(place);
  }
  return places;
}

std::vector<tileset::CutContent> FlightTiles::contents_for_frame(std::size_t image, double error_px) {
  tileset::TileCut cut = select_group(groups_.group_of_frame[image], error_px);
  const auto needs = needs_of(image);
  std::erase_if(cut.contents, [&](const tileset::CutContent& content) { return !needs(sphere_of(content)); });
  return std::move(cut.contents);
}

std::vector<tileset::LoadedContent> FlightTiles::read(const std::vector<std::size_t>& contents) {
  tileset::TileCut part;
  for (const std::size_t content : contents) part.contents.push_back(cut_.contents[content]);
  read_count_ += static_cast<std::int64_t>(contents.size());
  std::vector<tileset::LoadedContent> loaded =
      tileset::read_cut(*source_, tree_, part, placement_.T_local_tileset, load_.textures);
  for (std::size_t i = 0; i < contents.size(); ++i) {
    if (!loaded[i].failure.empty() && !load_.allow_incomplete) throw tileset::incomplete_region(loaded[i].failure);
    if (records_[contents[i]]) continue;
    records_[contents[i]] = tileset::make_record(loaded[i]);
    new_records_.push_back(contents[i]);
  }
  return loaded;
}

void FlightTiles::read_rest() {
  constexpr std::size_t kAtOnce = 16;
  std::vector<std::size_t> rest;
  const auto read_all = [&] {
    if (!rest.empty()) read(rest);
    rest.clear();
  };
  for (std::size_t content = 0; content < records_.size(); ++content) {
    if (!records_[content]) rest.push_back(content);
    if (rest.size() == kAtOnce) read_all();
  }
  read_all();
}

json FlightTiles::take_new_records() {
  json records;
  for (const std::size_t content : new_records_)
    records[std::to_string(content)] = tileset::to_json(*records_[content]);
  new_records_.clear();
  return records;
}

void FlightTiles::add_records(const json& records) {
  try {
    for (const auto& [number, record] : records.items()) {
      const std::size_t content = std::stoul(number);
      if (content < records_.size() && !records_[content])
        records_[content] = tileset::content_record_from_json(record);
    }
  } catch (const std::exception&) {  // damaged: only its attribution is lost
  }
}

tileset::LoadedTiles FlightTiles::summary() const {
  return tileset::summarize(placement_, cut_, records_, first_warnings_, tree_, *source_);
}

}  // namespace tileflight::recording
