#include "tileflight/experiment/preview.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <set>
#include <sstream>

#include "tileflight/experiment/flight_faults.h"
#include "tileflight/experiment/ground_view.h"
#include "tileflight/experiment/kept_frames.h"
#include "tileflight/experiment/memory_budget.h"
#include "tileflight/experiment/mission.h"
#include "tileflight/experiment/require_surface.h"
#include "tileflight/experiment/version.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/report/flight_profile.h"
#include "tileflight/report/frame_pairs.h"
#include "tileflight/scene/scene.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// The flight, and the place that it goes over.
struct Previewed {
  const PreviewSettings& settings;
  Mission mission;
  OpenPlace place;
  std::uintmax_t memory;

  const geometry::Trajectory& frames() const { return mission.frames; }
  const geometry::SE3& pose(std::size_t i) const { return mission.frames.poses[i].T_local_camera; }
};

tiles::LoadOptions load_of(const RenderSettings& settings) {
  tiles::LoadOptions load = settings.load;
  load.whole_however_large = settings.error_px.has_value();  // then tiles are chosen by what the flight looks at
  return load;
}

// ---- Checks

/// Where the path comes by, thinned out to where that makes no difference.
std::vector<Vec3> thinned_path(const geometry::Trajectory& frames) {
  const double step_m = std::max(0.25, geometry::path_length_m(frames) / 2000);
  std::vector<Vec3> path;
  for (const geometry::StampedPose& pose : frames.poses) {
    const Vec3& p = pose.T_local_camera.translation;
    if (path.empty() || (p - path.back()).norm() >= step_m) path.push_back(p);
  }
  return path;
}

/// Tiles for the checks: as fine as a share of their distance, within a reach of the path.
struct CheckDetail {
  double error_share, reach_m;
};

struct CheckTiles {
  PlacePart part;
  bool is_coarser = false;
};

CheckTiles read_surroundings(Previewed& flight, const Progress& progress) {
  constexpr std::array<CheckDetail, 5> kDetails{{{0.005, 20e3}, {0.01, 5e3}, {0.02, 2e3}, {0.05, 1e3}, {0.1, 300}}};
  const geometry::SE3& T_local_tileset = flight.place.placement().T_local_tileset;
  Box3 path_box;
  std::vector<tiles::Eye> eyes;
  for (const Vec3& p : thinned_path(flight.frames())) {
    path_box.extend(p);
    eyes.push_back({.position = p});
  }
  for (const CheckDetail& detail : kDetails) {
    for (tiles::Eye& eye : eyes) eye.pixels_per_rad = 1 / detail.error_share;
    const Vec3 around(detail.reach_m, detail.reach_m, 20e3);
    const tiles::Wanted wanted = wanted_within(
        tiles::no_finer_than(tiles::wanted_flight(eyes, T_local_tileset, 1.0), flight.settings.render.load.error_m),
        Box3(path_box.min() - around, path_box.max() + around), T_local_tileset);
    if (auto part = flight.place.read(flight.place.cut(wanted), false, flight.memory, progress))
      return {std::move(*part), &detail != kDetails.data()};
  }
  throw tiles::MemoryExceeded(flight.place.name(),
                              "the tiles around the path need more memory than is allowed; give more (--memory)");
}

// ---- Pictures and what they cost

/// A picture of the flight, and what it took.
struct Picture {
  std::string name;
  std::size_t frame = 0;
  imaging::RgbImage small;
  double surface_share = 0.0;
  std::int64_t tiles = 0;
  std::uintmax_t file_bytes = 0, memory_bytes = 0;
  double load_s = 0.0, render_s = 0.0, encode_s = 0.0;
};

tiles::Wanted wanted_for(const Previewed& flight, const tiles::EyeRange& part) {
  const RenderSettings& render = flight.settings.render;
  const tiles::Placement& placement = flight.place.placement();
  if (!render.error_px) return tiles::wanted_region(placement.region, placement.T_local_tileset, render.load.error_m);
  return tiles::no_finer_than(
      tiles::wanted_flight(eyes_of(flight.mission), placement.T_local_tileset, *render.error_px, part),
      render.load.error_m);
}

imaging::RgbImage small(const imaging::RgbImage& image, int width) {
  return image.width > width ? report::scaled_down(image, width) : image;
}

/// As `render` makes it, from the tiles that it would make it from.
Picture take_picture(Previewed& flight, const std::string& name, std::size_t frame, std::vector<MissingTile>& missing,
                     const Progress& progress) {
  Picture picture{.name = name, .frame = frame, .small = {}};
  auto start = std::chrono::steady_clock::now();
  const std::size_t eyes_a_frame = eyes_of(flight.mission).size() / flight.frames().size();
  const tiles::TileCut cut = flight.place.cut(wanted_for(flight, {frame * eyes_a_frame, (frame + 1) * eyes_a_frame}));
  auto part = flight.place.read(cut, true, flight.memory, progress);
  if (!part) {
    throw tiles::MemoryExceeded(flight.place.name(), "what frame " + std::to_string(frame) +
                                                         " looks at needs more memory than is allowed: ask for coarser "
                                                         "tiles (--error, --pixel-error) or allow more (--memory)");
  }
  missing.insert(missing.end(), part->missing.begin(), part->missing.end());
  picture.tiles = part->tiles;
  picture.file_bytes = part->file_bytes;
  picture.memory_bytes = part->memory_bytes;
  const scene::Scene scene(or_nothing(std::move(part->meshes)), flight.pose(flight.frames().size() / 2).translation);
  scene.prepare_beams();
  sensors::FlightOptions options = flight.mission.options;
  options.first_frame = frame;
  options.end_frame = frame + 1;
  options.outputs = {};
  if (const auto& local = flight.place.placement().local_frame) options.origin = local->origin();
  options.wanted = [&](std::size_t) {  // asked once the camera is ready for its first ray
    if (picture.load_s == 0.0) {
      picture.load_s = seconds_since(start);
      start = std::chrono::steady_clock::now();
    }
    return true;
  };
  const sensors::FrameSink sink = [&](const sensors::SensedFrame& sensed) {
    picture.render_s = seconds_since(start);
    const auto encoding = std::chrono::steady_clock::now();
    imaging::encode_jpeg(sensed.rgb, 95);
    picture.encode_s = seconds_since(encoding);
    picture.small = small(sensed.rgb, flight.settings.picture_width);
    picture.surface_share = sensed.check.view.surface_share;
  };
  sensors::render_flight(scene, flight.mission.calibration.camera, flight.frames(), flight.mission.pose_at, options,
                         sink);
  return picture;
}

std::vector<Picture> take_pictures(Previewed& flight, std::vector<MissingTile>& missing, const Progress& progress) {
  const std::size_t last = flight.frames().size() - 1;
  std::vector<Picture> pictures;
  for (const auto& [name, frame] :
       {std::pair<std::string, std::size_t>("first", 0), {"middle", last / 2}, {"last", last}}) {
    const auto same = std::ranges::find(pictures, frame, &Picture::frame);
    if (same != pictures.end()) {
      Picture again = *same;
      again.name = name;
      pictures.push_back(std::move(again));
    } else {
      pictures.push_back(take_picture(flight, name, frame, missing, progress));
    }
  }
  return pictures;
}

/// Distinct files of the flight's whole cut.
struct CutSize {
  std::size_t tiles = 0, files = 0;
  std::optional<std::uintmax_t> bytes;  ///< nullopt: the source cannot tell
};

CutSize size_of_cut(Previewed& flight) {
  const tiles::TileCut cut = flight.place.cut(wanted_for(flight, {}));
  std::set<std::string> uris;
  for (const tiles::CutContent& content : cut.contents) uris.insert(content.uri);
  CutSize size{cut.contents.size(), uris.size(), std::nullopt};
  if (!flight.place.source().knows_sizes()) return size;
  size.bytes = 0;
  for (const std::string& uri : uris)
    *size.bytes += tiles::is_data_uri(uri) ? 0 : flight.place.source().size(uri).value_or(0);
  return size;
}

/// Of what the pictures took, as the whole flight will take it.
json cost_of(Previewed& flight, const std::vector<Picture>& pictures) {
  const CutSize size = size_of_cut(flight);
  double tiles = 0, memory = 0, load_s = 0, render_s = 0, encode_s = 0;
  for (const Picture& p : pictures) {
    tiles += static_cast<double>(p.tiles);
    memory += static_cast<double>(p.memory_bytes);
    load_s += p.load_s;
    render_s += p.render_s / static_cast<double>(pictures.size());
    encode_s += p.encode_s / static_cast<double>(pictures.size());
  }
  const double per_tile = tiles > 0 ? static_cast<double>(size.tiles) / tiles : 0.0;
  const double frames = static_cast<double>(flight.frames().size());
  const int threads = tbb::this_task_arena::max_concurrency();
  const double memory_all = memory * per_tile, parts = std::ceil(memory_all / static_cast<double>(flight.memory));
  // A flight in parts reads what two of them see twice.
  const double loading_s = load_s * per_tile * (parts > 1 ? 1.3 : 1.0);
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

std::vector<double> along_path(const geometry::Trajectory& frames) {
  std::vector<double> along_m;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Vec3& here = frames.poses[i].T_local_camera.translation;
    along_m.push_back(i == 0 ? 0.0 : along_m.back() + (here - frames.poses[i - 1].T_local_camera.translation).norm());
  }
  return along_m;
}

std::vector<bool> troubled(const FlightCheck& check) {
  std::vector<bool> out;
  for (const sensors::FrameCheck& frame : check.frames) out.push_back(frame.around.inside || frame.path_is_blocked);
  return out;
}

double finite_or_nan(double value) { return std::isfinite(value) ? value : std::nan(""); }

report::FlightProfile profile_of(const Previewed& flight, const FlightCheck& check, const std::string& title) {
  report::FlightProfile profile{.title = title,
                                .notes = {},
                                .along_m = along_path(flight.frames()),
                                .time_s = {},
                                .up_m = {},
                                .above_ground_m = {},
                                .clearance_m = {},
                                .troubled = troubled(check),
                                .near_m = flight.settings.check.near_m,
                                .reach_m = flight.settings.check.reach_m};
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    profile.time_s.push_back(flight.frames().poses[i].time_s - flight.frames().poses[0].time_s);
    profile.up_m.push_back(flight.pose(i).translation.z());
    profile.above_ground_m.push_back(finite_or_nan(check.frames[i].around.above_ground_m));
    profile.clearance_m.push_back(finite_or_nan(check.frames[i].around.clearance_m));
  }
  return profile;
}

std::string csv_number(double value) {
  if (!std::isfinite(value)) return "";
  std::ostringstream text;
  text << std::setprecision(9) << value;
  return text.str();
}

/// Empty where a value is not known, or a surface too far to be looked for.
std::string profile_csv(const Previewed& flight, const FlightCheck& check, const report::FlightProfile& profile) {
  std::ostringstream csv;
  csv << "frame,time_s,way_m,east_m,north_m,up_m,above_ground_m,clearance_m,surface_share,flow_share,inside,"
         "path_blocked\n";
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    const Vec3& at = flight.pose(i).translation;
    const sensors::FrameCheck& frame = check.frames[i];
    csv << i;
    for (const double value :
         {flight.frames().poses[i].time_s, profile.along_m[i], at.x(), at.y(), at.z(), profile.above_ground_m[i],
          profile.clearance_m[i], check.views[i].surface_share, check.views[i].flow_share})
      csv << ',' << csv_number(value);
    csv << ',' << (frame.around.inside ? 1 : 0) << ',' << (frame.path_is_blocked ? 1 : 0) << '\n';
  }
  return csv.str();
}

double median_of_finite(std::vector<double> values, double otherwise) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return otherwise;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

report::MapFlight map_flight(const Previewed& flight, const scene::Scene& scene, const FlightCheck& check,
                             const std::vector<Picture>& pictures, double reach_m) {
  report::MapFlight map;
  for (std::size_t i = 0; i < flight.frames().size(); ++i) {
    const geometry::SE3& pose = flight.pose(i);
    map.positions.push_back(pose.translation);
    map.headings.emplace_back((pose.rotation * Vec3::UnitZ()).head<2>());
    if (check.frames[i].around.inside || check.frames[i].path_is_blocked) map.troubled.push_back(i);
  }
  for (const Picture& p : pictures) {
    map.views.push_back({p.name, flight.pose(p.frame).translation,
                         footprint(scene, flight.mission.calibration.camera, flight.pose(p.frame), reach_m)});
  }
  return map;
}

/// About the path and what its pictures see.
Box3 box_of(const report::MapFlight& map, double least_m) {
  Box3 box;
  for (const Vec3& p : map.positions) box.extend(p);
  for (const report::MapView& view : map.views) {
    for (const Vec2& p : view.footprint) box.extend(Vec3(p.x(), p.y(), view.position.z()));
  }
  const Vec3 short_m = (Vec3::Constant(least_m) - box.sizes()).cwiseMax(0.0);
  return {box.min() - short_m / 2, box.max() + short_m / 2};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : "; ") + name;
  return text;
}

template <class... Numbers>
std::string format(const char* pattern, Numbers... numbers) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, numbers...);
  return text;
}

// ---- All of it

/// Least, median and greatest of what is finite; null where nothing is.
json spread(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return nullptr;
  std::sort(values.begin(), values.end());
  return {{"min", values.front()}, {"median", values[values.size() / 2]}, {"max", values.back()}};
}

json nearest_surface(const FlightCheck& check, const geometry::Trajectory& frames) {
  const auto clearance = [](const sensors::FrameCheck& f) { return f.around.clearance_m; };
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
  return {{"surface_share", spread(shares)}, {"flow_share", spread(flows)}};
}

json pictures_json(const Previewed& flight, const std::vector<Picture>& pictures) {
  json out = json::array();
  for (const Picture& p : pictures) {
    out.push_back({{"file", p.name + ".jpg"},
                   {"frame", p.frame},
                   {"time_s", flight.frames().poses[p.frame].time_s},
                   {"surface_share", p.surface_share},
                   {"tiles", p.tiles},
                   {"seconds", {{"load", p.load_s}, {"render", p.render_s}, {"encode", p.encode_s}}}});
  }
  return out;
}

json flight_json(const Previewed& flight) {
  const imaging::Camera& camera = flight.mission.calibration.camera;
  const auto& poses = flight.frames().poses;
  return {{"source", flight.place.name()},
          {"flight", flight.settings.render.flight.flight.string()},
          {"frames", poses.size()},
          {"duration_s", poses.back().time_s - poses.front().time_s},
          {"path_length", geometry::path_length_m(flight.frames())},
          {"camera", {{"resolution", {camera.width(), camera.height()}}, {"fov_deg", camera.horizontal_fov_deg()}}}};
}

std::string fault_line(const sensors::FlightFault& fault) {
  return (fault.frames.size() == 1 ? "frame " : "frames ") + frame_ranges(fault.frames) + ": " + fault.what;
}

/// The whole tileset's extent in the local frame.
Box3 bounds_of(const OpenPlace& place) {
  return tiles::bounds_local(place.tree().volume(place.tree().root()), place.placement().T_local_tileset);
}

/// How far the flight is from all of the place; 0 where it comes over it.
double distance_to_place_m(const Previewed& flight) {
  const Box3 place = bounds_of(flight.place);
  double nearest_m = INFINITY;
  for (const geometry::StampedPose& pose : flight.frames().poses) {
    const Vec3 p = pose.T_local_camera.translation;
    const Vec2 off = (place.min() - p).cwiseMax(p - place.max()).cwiseMax(0.0).head<2>();
    nearest_m = std::min(nearest_m, off.norm());
  }
  return nearest_m;
}

/// The first of them; what is missing is missing for every part that wants it.
std::vector<std::string> missing_lines(std::vector<MissingTile> missing) {
  std::set<std::string> distinct;
  for (const MissingTile& tile : missing) distinct.insert(tile.failure);
  std::vector<std::string> lines;
  if (distinct.empty()) return lines;
  lines.push_back("missing or broken: " + *distinct.begin() +
                  (distinct.size() > 1 ? " and " + std::to_string(distinct.size() - 1) + " more" : "") +
                  "; render goes on without only by --allow-incomplete");
  return lines;
}

std::vector<std::string> warnings_of(const Previewed& flight, const FlightCheck& check,
                                     const std::vector<sensors::FlightFault>& faults) {
  std::vector<std::string> warnings;
  const double away_m = distance_to_place_m(flight);
  if (away_m > 0) {
    warnings.push_back(format("the flight comes no nearer to the place than %.0f m: the place spans ", away_m) +
                       tiles::extent_text(bounds_of(flight.place)) +
                       " of the local frame; is --origin (or --center) that of the flight file?");
  }
  for (const sensors::FlightFault& fault : faults) warnings.push_back(fault_line(fault));
  if (const auto line = start_warning(check, flight.settings.check)) warnings.push_back(*line);
  return warnings;
}

void append(std::vector<std::string> lines, std::vector<std::string>& warnings) {
  warnings.insert(warnings.end(), lines.begin(), lines.end());
}

/// What the files are made of.
struct Drawn {
  imaging::RgbImage map, profile;
  std::string profile_csv;
};

Drawn draw(Previewed& flight, const scene::Scene& scene, const FlightCheck& check, const std::vector<Picture>& pictures,
           std::vector<MissingTile>& missing, const Progress& progress) {
  report::FlightProfile profile =
      profile_of(flight, check, short_name(flight.settings.render.source) + ": flight profile");
  const json nearest = nearest_surface(check, flight.frames());
  profile.notes.push_back(
      format("%zu frames, %.1f s, %.1f m", flight.frames().size(), profile.time_s.back(), profile.along_m.back()) +
      (nearest.is_null() ? std::string()
                         : format("; nearest surface at frame %zu: %.2f m", nearest["frame"].get<std::size_t>(),
                                  nearest["distance"].get<double>())));
  const double above_m = median_of_finite(profile.above_ground_m, 20.0);
  Box3 path;
  for (const geometry::StampedPose& pose : flight.frames().poses) path.extend(pose.T_local_camera.translation);
  const double longer_m = std::max(path.sizes().x(), path.sizes().y());
  const report::MapFlight map =
      map_flight(flight, scene, check, pictures, std::max({4 * above_m, 0.75 * longer_m, 30.0}));
  const sensors::GroundGrid grid = grid_over(box_of(map, std::max(10.0, above_m)), flight.settings.map_pixels);
  const GroundView view = look_down(
      flight.place, grid, {.error_m = grid.pixel_m, .top_down = {}, .max_memory_bytes = flight.memory}, progress);
  missing.insert(missing.end(), view.missing.begin(), view.missing.end());
  const imaging::Camera& camera = flight.mission.calibration.camera;
  report::PlaceMap figure{.title = short_name(flight.settings.render.source) + ": " +
                                   flight.settings.render.flight.flight.filename().string(),
                          .notes = {profile.notes[0] + format("; %d x %d pixels, %.0f° wide", camera.width(),
                                                              camera.height(), camera.horizontal_fov_deg())},
                          .attribution = joined(flight.place.attribution()),
                          .ground = picture_of(view),
                          .frame = flight.place.placement().local_frame,
                          .outlines = missing_outlines(view),
                          .flight = map};
  return {drawn(figure), drawn(profile), profile_csv(flight, check, profile)};
}

json faults_json(const std::vector<sensors::FlightFault>& faults) {
  json out = json::object();
  for (const sensors::FlightFault& fault : faults) out[fault.key] = fault.frames;
  return out;
}

json describe(Previewed& flight, const FlightCheck& check, const std::vector<Picture>& pictures,
              const std::vector<sensors::FlightFault>& faults, const std::vector<std::string>& warnings) {
  std::vector<double> above_ground, clearance;
  for (const sensors::FrameCheck& frame : check.frames) {
    above_ground.push_back(frame.around.above_ground_m);
    clearance.push_back(frame.around.clearance_m);
  }
  json out = flight_json(flight);
  out["height_above_ground"] = spread(above_ground);
  out["clearance"] = spread(clearance);
  out["nearest_surface"] = nearest_surface(check, flight.frames());
  out["view"] = views_json(check);
  out["start"] = nullptr;
  if (check.start) {
    out["start"] = {{"parallax_deg", check.start->parallax_rad * 180 / M_PI},
                    {"needed_deg", flight.settings.check.least_start_parallax_rad * 180 / M_PI},
                    {"at_frame", check.start->at_frame}};
  }
  out["pictures"] = pictures_json(flight, pictures);
  out["cost"] = cost_of(flight, pictures);
  out["faults"] = faults_json(faults);
  out["warnings"] = warnings;
  out["attribution"] = flight.place.attribution();
  out["version"] = version();
  return out;
}

}  // namespace

json preview(const PreviewSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  if (fs::exists(out) && !replace) throw InputError(out.string(), "exists already; --force replaces it");
  Previewed flight{settings, plan_mission(settings.render, progress),
                   OpenPlace(settings.render.source, load_of(settings.render), tiles::Use::kAnalyse),
                   settings.render.max_memory_bytes.value_or(default_memory_bytes())};
  if (flight.frames().empty()) throw InputError(settings.render.flight.flight.string(), "has no frame");
  std::vector<MissingTile> missing;
  CheckTiles around = read_surroundings(flight, progress);
  std::move(around.part.missing.begin(), around.part.missing.end(), std::back_inserter(missing));
  const scene::Scene scene(or_nothing(std::move(around.part.meshes)), flight.pose(0).translation);
  const FlightCheck check = check_flight(scene, flight.mission, settings.check, progress);
  const std::vector<Picture> pictures = take_pictures(flight, missing, progress);
  const Drawn figures = draw(flight, scene, check, pictures, missing, progress);

  const std::vector<sensors::FlightFault> faults = faults_of(check, settings.check);
  std::vector<std::string> warnings = warnings_of(flight, check, faults);
  if (around.is_coarser)
    warnings.emplace_back("the path was checked against coarser tiles: memory wants it (--memory)");
  append(missing_lines(missing), warnings);
  append(flight.place.warnings(), warnings);
  const json found = describe(flight, check, pictures, faults, warnings);
  geometry::write_folder(out, replace, [&](const fs::path& temporary) {
    imaging::write_rgb(temporary / "map.png", figures.map);
    imaging::write_rgb(temporary / "profile.png", figures.profile);
    geometry::write_file(temporary / "profile.csv", figures.profile_csv);
    for (const Picture& p : pictures) imaging::write_rgb(temporary / (p.name + ".jpg"), p.small, 88);
    geometry::write_file(temporary / "preview.json", found.dump(2) + "\n");
  });
  return found;
}

std::string preview_text(const json& found, const fs::path& out) {
  const auto about = [](double seconds) {
    if (seconds < 90) return format("%.0f s", std::max(1.0, seconds));
    return seconds < 5400 ? format("%.0f min", seconds / 60) : format("%.1f h", seconds / 3600);
  };
  std::string text =
      out.string() + ": " + std::to_string(found["frames"].get<int>()) + " frames in " +
      format("%.1f s over %.1f m", found["duration_s"].get<double>(), found["path_length"].get<double>());
  const auto range = [&](const char* key, const char* words) {
    if (found[key].is_null()) return;
    text += format("\n%s: %.1f to %.1f m", words, found[key]["min"].get<double>(), found[key]["max"].get<double>());
  };
  range("height_above_ground", "height above the surface below");
  if (const json& nearest = found["nearest_surface"]; !nearest.is_null())
    text +=
        format("; nearest surface %.2f m at frame %d", nearest["distance"].get<double>(), nearest["frame"].get<int>());
  const json& cost = found["cost"];
  text += format("\nrendering: %.3g million pixels from %d tiles", cost["pixels"].get<double>() / 1e6,
                 cost["tiles"].get<int>());
  if (!cost["bytes"].is_null()) text += format(" (%.1f MB)", cost["bytes"].get<double>() / 1e6);
  text += format(", about %.2f GB of memory and about ", cost["memory_bytes"].get<double>() / 1e9) +
          about(cost["seconds"]["total"]) + format(" with %d threads\n", cost["threads"].get<int>());
  for (const auto& warning : found["warnings"]) text += "warning: " + warning.get<std::string>() + "\n";
  if (found["warnings"].empty()) text += "nothing speaks against it\n";
  return text;
}

}  // namespace tileflight::experiment
