#include "tileflight/survey/preview.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tileflight/base/elapsed_time.h"
#include "tileflight/base/files.h"
#include "tileflight/base/formatted_text.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/order_statistics.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/place/ground_view.h"
#include "tileflight/place/memory_budget.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/place/version.h"
#include "tileflight/report/flight_profile.h"
#include "tileflight/report/frame_pairs.h"
#include "tileflight/scene/scene.h"
#include "tileflight/survey/flight_faults.h"
#include "tileflight/survey/frame_store.h"
#include "tileflight/survey/planned_flight.h"
#include "tileflight/transport/uri.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;

/// The flight, and the place under it.
struct PreviewContext {
  const PreviewSettings& settings;
  PlannedFlight mission;
  place::PlaceReader place;
  std::uintmax_t memory;        ///< limit for tiles
  std::uintmax_t checks_bytes;  ///< of it, taken by the tiles along the path; at most half

  const geometry::Trajectory& frames() const { return mission.frames; }
  std::uintmax_t memory_left() const { return memory - checks_bytes; }
  const geometry::SE3& pose(std::size_t i) const { return mission.frames.poses[i].T_local_camera; }
};

tiles::LoadOptions preview_load_options(const RenderSettings& settings) {
  tiles::LoadOptions load = settings.load;
  load.allow_large_area = settings.error_px.has_value();  // tiles are then selected by what the flight sees
  return load;
}

// ---- Checks

/// Positions along the path, subsampled where that makes no difference.
std::vector<Vec3> subsample_path(const geometry::Trajectory& frames) {
  const double step_m = std::max(0.25, geometry::path_length_m(frames) / 2000);
  std::vector<Vec3> path;
  for (const geometry::StampedPose& pose : frames.poses) {
    const Vec3& p = pose.T_local_camera.translation;
    if (path.empty() || (p - path.back()).norm() >= step_m) path.push_back(p);
  }
  return path;
}

/// Tiles for the checks: resolution as a share of their distance, within a range of the path.
struct DetailLevel {
  double error_share, reach_m;
};

struct SurroundingTiles {
  place::PlacePart part;
  bool is_coarser = false;
};

SurroundingTiles read_surroundings(PreviewContext& flight, const Progress& progress) {
  constexpr std::array<DetailLevel, 5> kDetails{{{0.005, 20e3}, {0.01, 5e3}, {0.02, 2e3}, {0.05, 1e3}, {0.1, 300}}};
  const geometry::SE3& T_local_tileset = flight.place.placement().T_local_tileset;
  Box3 path_box;
  std::vector<tiles::ViewCone> cones;
  for (const Vec3& p : subsample_path(flight.frames())) {
    path_box.extend(p);
    cones.push_back({.position = p});
  }
  for (const DetailLevel& detail : kDetails) {
    for (tiles::ViewCone& cone : cones) cone.pixels_per_rad = 1 / detail.error_share;
    const Vec3 around(detail.reach_m, detail.reach_m, 20e3);
    const tiles::RefinementCriterion wanted =
        place::restrict_to_box(tiles::limit_refinement(tiles::flight_criterion(cones, T_local_tileset, 1.0),
                                                       flight.settings.render.load.error_m),
                               Box3(path_box.min() - around, path_box.max() + around), T_local_tileset);
    if (auto part = flight.place.read(flight.place.select_cut(wanted), false, flight.memory / 2, progress))
      return {std::move(*part), &detail != kDetails.data()};
  }
  throw tiles::MemoryLimitExceeded(flight.place.name(),
                                   "the tiles around the path need more memory than the limit; raise it (--memory)");
}

// ---- Images and their cost

/// An image of the flight, and its cost.
struct SamplePicture {
  std::string name;
  std::size_t frame = 0;
  imaging::RgbImage thumbnail;
  double surface_share = 0.0;
  std::int64_t tiles = 0;
  std::uintmax_t file_bytes = 0, memory_bytes = 0;
  double load_s = 0.0, render_s = 0.0, encode_s = 0.0;
  std::optional<double> error_px;  ///< of its tiles, if the flight's views select them
};

/// The criterion of the tiles that `render` loads for the frames of a group at this screen-space error; nullopt: those
/// of the region. `frame`: for that one only.
tiles::RefinementCriterion criterion_of(const PreviewContext& flight, const std::vector<std::size_t>& group,
                                        const std::optional<double>& error_px, std::optional<std::size_t> frame = {}) {
  const RenderSettings& render = flight.settings.render;
  const tiles::Placement& placement = flight.place.placement();
  if (!error_px) return tiles::region_criterion(placement.region, placement.T_local_tileset, render.load.error_m);
  const std::vector<tiles::ViewCone> all = flight_view_cones(flight.mission);
  const std::size_t per_frame = all.size() / flight.frames().size();
  std::vector<tiles::ViewCone> cones;
  tiles::ViewConeRange part;
  for (const std::size_t i : group) {
    if (i == frame) part = {cones.size(), cones.size() + per_frame};
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(i * per_frame);
    cones.insert(cones.end(), first, first + static_cast<std::ptrdiff_t>(per_frame));
  }
  return tiles::limit_refinement(tiles::flight_criterion(std::move(cones), placement.T_local_tileset, *error_px, part),
                                 render.load.error_m);
}

imaging::RgbImage make_thumbnail(const imaging::RgbImage& image, int width) {
  return image.width > width ? report::downscale(image, width) : image;
}

/// The tiles that the picture's frame shows, as `render` selects them, or coarser ones if they do not fit into memory:
/// `render` would divide the frame. Sets the picture's `error_px`.
place::PlacePart read_tiles_of(PreviewContext& flight, const FrameGroups& groups, SamplePicture& picture,
                               const Progress& progress) {
  constexpr double kCoarsest = 256.0;  // times the error asked for
  const std::vector<std::size_t>& group = groups.frames[groups.group_of_frame[picture.frame]];
  const std::optional<double>& wanted_px = flight.settings.render.error_px;
  for (double coarser = 1.0; coarser <= (wanted_px ? kCoarsest : 1.0); coarser *= 2.0) {
    if (wanted_px) picture.error_px = coarser * *wanted_px;
    const tiles::TileCut cut = flight.place.select_cut(criterion_of(flight, group, picture.error_px, picture.frame));
    if (auto part = flight.place.read(cut, true, flight.memory_left(), progress)) return std::move(*part);
  }
  throw tiles::MemoryLimitExceeded(flight.place.name(),
                                   "the part of the place that frame " + std::to_string(picture.frame) +
                                       " sees needs more memory than the limit: request coarser tiles (--error, "
                                       "--pixel-error) or raise the limit (--memory)");
}

/// Renders an image as `render` would, from the same tiles where they fit into memory.
SamplePicture render_picture(PreviewContext& flight, const std::string& name, std::size_t frame,
                             std::vector<place::MissingTile>& missing, const Progress& progress) {
  SamplePicture picture{.name = name, .frame = frame, .thumbnail = {}};
  auto start = std::chrono::steady_clock::now();
  const FrameGroups groups = group_flight_frames(flight.mission, flight.settings.render);
  place::PlacePart part = read_tiles_of(flight, groups, picture, progress);
  missing.insert(missing.end(), part.missing.begin(), part.missing.end());
  picture.tiles = part.tiles;
  picture.file_bytes = part.file_bytes;
  picture.memory_bytes = part.memory_bytes;
  const geometry::Vec3& anchor = groups.anchors[groups.group_of_frame[frame]];
  const scene::Scene scene(place::with_placeholder(std::move(part.meshes)), anchor);
  scene.build_beam_tree();
  render::FlightRenderOptions options = flight.mission.options;
  options.first_frame = frame;
  options.end_frame = frame + 1;
  options.outputs = {};
  if (const auto& local = flight.place.placement().local_frame) options.origin = local->origin();
  options.frame_filter = [&](std::size_t) {  // called when the renderer is ready to cast its first ray
    if (picture.load_s == 0.0) {
      picture.load_s = base::seconds_since(start);
      start = std::chrono::steady_clock::now();
    }
    return true;
  };
  const render::FrameSink sink = [&](const render::FlightFrame& sensed) {
    picture.render_s = base::seconds_since(start);
    const auto encoding = std::chrono::steady_clock::now();
    imaging::encode_jpeg(sensed.rgb, 95);
    picture.encode_s = base::seconds_since(encoding);
    picture.thumbnail = make_thumbnail(sensed.rgb, flight.settings.picture_width);
    picture.surface_share = sensed.check.view.surface_share();
  };
  render::render_flight(scene, flight.mission.calibration.camera, flight.frames(), flight.mission.pose_at, options,
                        sink);
  return picture;
}

std::vector<SamplePicture> render_pictures(PreviewContext& flight, std::vector<place::MissingTile>& missing,
                                           const Progress& progress) {
  const std::size_t last = flight.frames().size() - 1;
  std::vector<SamplePicture> pictures;
  for (const auto& [name, frame] :
       {std::pair<std::string, std::size_t>("first", 0), {"middle", last / 2}, {"last", last}}) {
    const auto same = std::ranges::find(pictures, frame, &SamplePicture::frame);
    if (same != pictures.end()) {
      SamplePicture again = *same;
      again.name = name;
      pictures.push_back(std::move(again));
    } else {
      pictures.push_back(render_picture(flight, name, frame, missing, progress));
    }
  }
  return pictures;
}

/// Number and size of the distinct files in the cuts of all groups.
struct CutSize {
  std::size_t tiles = 0, files = 0;
  std::optional<std::uintmax_t> bytes;  ///< nullopt: unknown to the source
};

CutSize measure_cut(PreviewContext& flight) {
  std::set<std::string> uris;
  std::set<std::pair<tiles::NodeId, std::size_t>> contents;
  for (const std::vector<std::size_t>& group : group_flight_frames(flight.mission, flight.settings.render).frames) {
    const auto wanted = criterion_of(flight, group, flight.settings.render.error_px);
    for (const tiles::CutContent& content : flight.place.select_cut(wanted).contents) {
      uris.insert(content.uri);
      contents.emplace(content.node, content.content);
    }
  }
  CutSize size{contents.size(), uris.size(), std::nullopt};
  if (!flight.place.source().knows_sizes()) return size;
  size.bytes = 0;
  for (const std::string& uri : uris)
    *size.bytes += transport::is_data_uri(uri) ? 0 : flight.place.source().size(uri).value_or(0);
  return size;
}

/// Extrapolates the images' cost to the whole flight.
json estimate_cost(PreviewContext& flight, const std::vector<SamplePicture>& pictures) {
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

// ---- Figures

std::vector<double> distances_along_path(const geometry::Trajectory& frames) {
  std::vector<double> along_m;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Vec3& here = frames.poses[i].T_local_camera.translation;
    along_m.push_back(i == 0 ? 0.0 : along_m.back() + (here - frames.poses[i - 1].T_local_camera.translation).norm());
  }
  return along_m;
}

std::vector<bool> find_blocked_frames(const FlightCheck& check) {
  std::vector<bool> out;
  for (const render::FrameCheck& frame : check.frames)
    out.push_back(frame.surroundings.inside || frame.path_is_blocked);
  return out;
}

double finite_or_nan(double value) { return std::isfinite(value) ? value : std::nan(""); }

report::FlightProfile make_profile(const PreviewContext& flight, const FlightCheck& check, const std::string& title) {
  report::FlightProfile profile{.title = title,
                                .notes = {},
                                .distance_flown_m = distances_along_path(flight.frames()),
                                .time_s = {},
                                .up_m = {},
                                .above_ground_m = {},
                                .clearance_m = {},
                                .in_collision = find_blocked_frames(check),
                                .min_clearance_m = flight.settings.check.min_clearance_m,
                                .max_clearance_m = flight.settings.check.max_clearance_m};
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    profile.time_s.push_back(flight.frames().poses[i].time_s - flight.frames().poses[0].time_s);
    profile.up_m.push_back(flight.pose(i).translation.z());
    profile.above_ground_m.push_back(finite_or_nan(check.frames[i].surroundings.above_ground_m));
    profile.clearance_m.push_back(finite_or_nan(check.frames[i].surroundings.clearance_m));
  }
  return profile;
}

std::string csv_number(double value) {
  if (!std::isfinite(value)) return "";
  std::ostringstream text;
  text << std::setprecision(9) << value;
  return text.str();
}

/// Fields are empty if a value is unknown, or a surface is beyond the search range.
std::string profile_csv(const PreviewContext& flight, const FlightCheck& check, const report::FlightProfile& profile) {
  std::ostringstream csv;
  csv << "frame,time_s,way_m,east_m,north_m,up_m,above_ground_m,clearance_m,surface_share,flow_share,inside,"
         "path_blocked\n";
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    const Vec3& at = flight.pose(i).translation;
    const render::FrameCheck& frame = check.frames[i];
    csv << i;
    for (const double value :
         {flight.frames().poses[i].time_s, profile.distance_flown_m[i], at.x(), at.y(), at.z(),
          profile.above_ground_m[i], profile.clearance_m[i], check.views[i].surface_share, check.views[i].flow_share})
      csv << ',' << csv_number(value);
    csv << ',' << (frame.surroundings.inside ? 1 : 0) << ',' << (frame.path_is_blocked ? 1 : 0) << '\n';
  }
  return csv.str();
}

double median_of_finite(std::vector<double> values, double fallback) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return fallback;
  return base::upper_median(std::move(values));
}

report::FlightOverlay map_flight(const PreviewContext& flight, const scene::Scene& scene, const FlightCheck& check,
                                 const std::vector<SamplePicture>& pictures, double reach_m) {
  report::FlightOverlay map;
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    const geometry::SE3& pose = flight.pose(i);
    map.positions.push_back(pose.translation);
    map.headings.emplace_back((pose.rotation * Vec3::UnitZ()).head<2>());
    if (check.frames[i].surroundings.inside || check.frames[i].path_is_blocked) map.colliding_frames.push_back(i);
  }
  for (const SamplePicture& p : pictures) {
    map.views.push_back({p.name, flight.pose(p.frame).translation,
                         footprint(scene, flight.mission.calibration.camera, flight.pose(p.frame), reach_m)});
  }
  return map;
}

/// Bounds of the path and of what its images see.
Box3 map_bounds(const report::FlightOverlay& map, double least_m) {
  Box3 box;
  for (const Vec3& p : map.positions) box.extend(p);
  for (const report::ViewFootprint& view : map.views) {
    for (const Vec2& p : view.footprint) box.extend(Vec3(p.x(), p.y(), view.position.z()));
  }
  const Vec3 short_m = (Vec3::Constant(least_m) - box.sizes()).cwiseMax(0.0);
  return {box.min() - short_m / 2, box.max() + short_m / 2};
}

// ---- Everything together

/// Minimum, median and maximum of the finite values; null if there are none.
json min_median_max(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return nullptr;
  std::sort(values.begin(), values.end());
  return {{"min", values.front()}, {"median", values[values.size() / 2]}, {"max", values.back()}};
}

json nearest_surface(const FlightCheck& check, const geometry::Trajectory& frames) {
  const auto clearance = [](const render::FrameCheck& f) { return f.surroundings.clearance_m; };
  const auto nearest = std::ranges::min_element(check.frames, {}, clearance);
  if (nearest == check.frames.end() || !std::isfinite(clearance(*nearest))) return nullptr;
  const auto i = static_cast<std::size_t>(nearest - check.frames.begin());
  return {{"distance", clearance(*nearest)}, {"frame", i}, {"time_s", frames.poses[i].time_s}};
}

json views_json(const FlightCheck& check) {
  std::vector<double> shares, flows;
  for (const ViewCheck& view : check.views) {
    shares.push_back(view.surface_share);
    flows.push_back(view.flow_share);
  }
  return {{"surface_share", min_median_max(shares)}, {"flow_share", min_median_max(flows)}};
}

json pictures_json(const PreviewContext& flight, const std::vector<SamplePicture>& pictures) {
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

json flight_json(const PreviewContext& flight) {
  const imaging::Camera& camera = flight.mission.calibration.camera;
  const auto& poses = flight.frames().poses;
  return {{"source", flight.place.name()},
          {"flight", flight.settings.render.flight.flight.string()},
          {"frames", poses.size()},
          {"duration_s", poses.back().time_s - poses.front().time_s},
          {"path_length", geometry::path_length_m(flight.frames())},
          {"camera", {{"resolution", {camera.width(), camera.height()}}, {"fov_deg", camera.horizontal_fov_deg()}}}};
}

std::string fault_line(const render::FlightFault& fault) {
  return (fault.frames.size() == 1 ? "frame " : "frames ") + describe_frame_ranges(fault.frames) + ": " + fault.what;
}

/// The whole tileset's extent in the local frame.
Box3 place_bounds(const place::PlaceReader& place) {
  return tiles::local_bounding_box(place.tree().volume(place.tree().root()), place.placement().T_local_tileset);
}

/// Distance of the flight from the place's bounds; 0 if it passes over them.
double distance_to_place_m(const PreviewContext& flight) {
  const Box3 place = place_bounds(flight.place);
  double nearest_m = INFINITY;
  for (const geometry::StampedPose& pose : flight.frames().poses) {
    const Vec3 p = pose.T_local_camera.translation;
    const Vec2 off = (place.min() - p).cwiseMax(p - place.max()).cwiseMax(0.0).head<2>();
    nearest_m = std::min(nearest_m, off.norm());
  }
  return nearest_m;
}

/// The first warnings, without duplicates: a missing tile is reported by every part that needs it.
std::vector<std::string> missing_tile_warnings(std::vector<place::MissingTile> missing) {
  std::set<std::string> distinct;
  for (const place::MissingTile& tile : missing) distinct.insert(tile.failure);
  std::vector<std::string> lines;
  if (distinct.empty()) return lines;
  lines.push_back("missing or broken: " + *distinct.begin() +
                  (distinct.size() > 1 ? " and " + std::to_string(distinct.size() - 1) + " more" : "") +
                  "; `render` fails unless --allow-incomplete is given");
  return lines;
}

std::vector<std::string> collect_warnings(const PreviewContext& flight, const FlightCheck& check,
                                          const std::vector<render::FlightFault>& faults) {
  std::vector<std::string> warnings;
  const double away_m = distance_to_place_m(flight);
  if (away_m > 0) {
    warnings.push_back(
        base::formatted("the flight stays at least %.0f m away from the place: the place spans ", away_m) +
        tiles::describe_extent(place_bounds(flight.place)) +
        " in the local frame; check that --origin (or --center) belongs to the flight file");
  }
  for (const render::FlightFault& fault : faults) warnings.push_back(fault_line(fault));
  if (const auto line = initialization_warning(check, flight.settings.check)) warnings.push_back(*line);
  return warnings;
}

void append(std::vector<std::string> lines, std::vector<std::string>& warnings) {
  warnings.insert(warnings.end(), lines.begin(), lines.end());
}

/// A line if pictures show coarser tiles than the flight will; empty if not.
std::vector<std::string> coarser_picture_warnings(const PreviewContext& flight,
                                                  const std::vector<SamplePicture>& pictures) {
  double largest_px = 0.0;
  std::string names;
  for (const SamplePicture& p : pictures) {
    if (!p.error_px || !(*p.error_px > *flight.settings.render.error_px)) continue;
    names += (names.empty() ? "" : ", ") + p.name + ".jpg";
    largest_px = std::max(largest_px, *p.error_px);
  }
  if (names.empty()) return {};
  return {
      base::formatted("%s: coarser tiles, of up to %.3g pixels of error, because of the memory limit (--memory); "
                      "`render` divides such frames, which takes longer than estimated here",
                      names.c_str(), largest_px)};
}

/// Data from which the files are written.
struct PreviewFigures {
  imaging::RgbImage map, profile;
  std::string profile_csv;
};

PreviewFigures draw_figures(PreviewContext& flight, const scene::Scene& scene, const FlightCheck& check,
                            const std::vector<SamplePicture>& pictures, std::vector<place::MissingTile>& missing,
                            const Progress& progress) {
  report::FlightProfile profile =
      make_profile(flight, check, place::source_display_name(flight.settings.render.source) + ": flight profile");
  const json nearest = nearest_surface(check, flight.frames());
  profile.notes.push_back(
      base::formatted("%zu frames, %.1f s, %.1f m", flight.frames().size(), profile.time_s.back(),
                      profile.distance_flown_m.back()) +
      (nearest.is_null() ? std::string()
                         : base::formatted("; nearest surface at frame %zu: %.2f m",
                                           nearest["frame"].get<std::size_t>(), nearest["distance"].get<double>())));
  const double above_m = median_of_finite(profile.above_ground_m, 20.0);
  Box3 path;
  for (const geometry::StampedPose& pose : flight.frames().poses) path.extend(pose.T_local_camera.translation);
  const double longer_m = std::max(path.sizes().x(), path.sizes().y());
  const report::FlightOverlay map =
      map_flight(flight, scene, check, pictures, std::max({4 * above_m, 0.75 * longer_m, 30.0}));
  const render::GroundGrid grid =
      place::fit_ground_grid(map_bounds(map, std::max(10.0, above_m)), flight.settings.map_pixels);
  const place::GroundView view = place::render_ground_view(
      flight.place, grid, {.error_m = grid.pixel_m, .top_down = {}, .max_memory_bytes = flight.memory_left()},
      progress);
  missing.insert(missing.end(), view.missing.begin(), view.missing.end());
  const imaging::Camera& camera = flight.mission.calibration.camera;
  report::PlaceMap figure{.title = place::source_display_name(flight.settings.render.source) + ": " +
                                   flight.settings.render.flight.flight.filename().string(),
                          .notes = {profile.notes[0] + base::formatted("; %d x %d pixels, %.0f° wide", camera.width(),
                                                                       camera.height(), camera.horizontal_fov_deg())},
                          .attribution = base::joined(flight.place.attribution(), "; "),
                          .ground = place::to_ground_picture(view),
                          .frame = flight.place.placement().local_frame,
                          .outlines = place::missing_outlines(view),
                          .flight = map};
  return {draw_to_image(figure), draw_to_image(profile), profile_csv(flight, check, profile)};
}

json faults_json(const std::vector<render::FlightFault>& faults) {
  json out = json::object();
  for (const render::FlightFault& fault : faults) out[fault.key] = fault.frames;
  return out;
}

json describe(PreviewContext& flight, const FlightCheck& check, const std::vector<SamplePicture>& pictures,
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
  out["version"] = place::version();
  return out;
}

}  // namespace

json preview(const PreviewSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  if (fs::exists(out) && !replace) throw InputError(out.string(), "exists already; --force replaces it");
  PreviewContext flight{
      settings, plan_flight(settings.render, progress),
      place::PlaceReader(settings.render.source, preview_load_options(settings.render), transport::Use::kAnalyse),
      settings.render.max_memory_bytes.value_or(place::default_memory_bytes()), 0};
  if (flight.frames().empty()) throw InputError(settings.render.flight.flight.string(), "has no frames");
  std::vector<place::MissingTile> missing;
  SurroundingTiles around = read_surroundings(flight, progress);
  flight.checks_bytes = around.part.memory_bytes;
  std::move(around.part.missing.begin(), around.part.missing.end(), std::back_inserter(missing));
  const scene::Scene scene(place::with_placeholder(std::move(around.part.meshes)), flight.pose(0).translation);
  const FlightCheck check = check_flight(scene, flight.mission, settings.check, progress);
  const std::vector<SamplePicture> pictures = render_pictures(flight, missing, progress);
  const PreviewFigures figures = draw_figures(flight, scene, check, pictures, missing, progress);

  const std::vector<render::FlightFault> faults = find_faults(check, settings.check);
  std::vector<std::string> warnings = collect_warnings(flight, check, faults);
  if (around.is_coarser)
    warnings.emplace_back("the path was checked against coarser tiles because of the memory limit (--memory)");
  if (const std::size_t cameras = flight.mission.camera_count(); cameras > 1)
    warnings.push_back("pictures, views and tiles are those of the first of " + std::to_string(cameras) + " cameras");
  append(coarser_picture_warnings(flight, pictures), warnings);
  append(missing_tile_warnings(missing), warnings);
  append(flight.place.warnings(), warnings);
  const json found = describe(flight, check, pictures, faults, warnings);
  base::write_folder(out, replace, [&](const fs::path& temporary) {
    imaging::write_rgb(temporary / "map.png", figures.map);
    imaging::write_rgb(temporary / "profile.png", figures.profile);
    base::write_file(temporary / "profile.csv", figures.profile_csv);
    for (const SamplePicture& p : pictures) imaging::write_rgb(temporary / (p.name + ".jpg"), p.thumbnail, 88);
    base::write_file(temporary / "preview.json", found.dump(2) + "\n");
  });
  return found;
}

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

}  // namespace tileflight::survey
