#include "tileflight/capture/preview/preview.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tileflight/capture/preview/ground_view.h"
#include "tileflight/capture/preview/preview_json.h"
#include "tileflight/capture/preview/sample_pictures.h"
#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/drawing/flight_profile.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/world/place/place_reader.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

namespace fs = std::filesystem;
namespace {

/// Data from which the files are written.
struct PreviewFigures {
  imaging::RgbImage map, profile;
  std::string profile_csv;  ///< fields are empty where a value is unknown, or a surface beyond the search range
};

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;

std::string fault_line(const render::FlightFault& fault) {
  return (fault.frames.size() == 1 ? "frame " : "frames ") + recording::describe_frame_ranges(fault.frames) + ": " +
         fault.what;
}

/// The whole tileset's extent in the local frame.
Box3 place_bounds(const place::PlaceReader& place) {
  return tileset::local_bounding_box(place.tree().volume(place.tree().root()), place.placement().T_local_tileset);
}

/// Distance of the flight from the place's bounds; 0 if it passes over them.
double distance_to_place_m(const PreviewedFlight& flight) {
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
std::vector<std::string> missing_tile_warnings(const std::vector<place::MissingTile>& missing) {
  std::set<std::string> distinct;
  for (const place::MissingTile& tile : missing) distinct.insert(tile.failure);
  std::vector<std::string> lines;
  if (distinct.empty()) return lines;
  lines.push_back("missing or broken: " + *distinct.begin() +
                  (distinct.size() > 1 ? " and " + std::to_string(distinct.size() - 1) + " more" : "") +
                  "; `render` fails unless --allow-incomplete is given");
  return lines;
}

/// Warns if images show coarser tiles than the flight needs; empty if not.
std::vector<std::string> coarser_picture_warnings(const PreviewedFlight& flight,
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
      base::formatted("%s: coarser tiles, of up to %.3g pixels of error, because of the memory limit; `render` refuses "
                      "frames that do not fit: raise the limit (--memory) or request coarser tiles (--pixel-error)",
                      names.c_str(), largest_px)};
}

/// Warns about a flight that stays beside the place and hardly sees it; empty if it does not. A flight around a tower
/// stays beside it, too.
std::vector<std::string> beside_place_warnings(const PreviewedFlight& flight, const FlightCheck& check) {
  const double away_m = distance_to_place_m(flight);
  const auto sees_place = [&](const ViewCheck& view) {
    return view.surface_share >= flight.settings.check.min_surface_share;
  };
  if (!(away_m > 0) || std::ranges::any_of(check.views, sees_place)) return {};
  return {base::formatted("the flight stays at least %.0f m away from the place: the place spans ", away_m) +
          tileset::describe_extent(place_bounds(flight.place)) +
          " in the local frame; check that --origin (or --center) belongs to the flight file"};
}

/// Collects the warnings of a preview: a flight beside the place, its `faults`, too little parallax at the start,
/// coarser tiles than the flight's (`checked_coarser`: those of the checks), tiles that could not be read (`missing`,
/// each named once), and the warnings of the place's reader.
std::vector<std::string> collect_warnings(const PreviewedFlight& flight, const FlightCheck& check,
                                          const std::vector<render::FlightFault>& faults,
                                          const std::vector<SamplePicture>& pictures, bool checked_coarser,
                                          const std::vector<place::MissingTile>& missing) {
  std::vector<std::string> warnings = beside_place_warnings(flight, check);
  const auto append = [&warnings](const std::vector<std::string>& lines) {
    warnings.insert(warnings.end(), lines.begin(), lines.end());
  };
  for (const render::FlightFault& fault : faults) warnings.push_back(fault_line(fault));
  if (const auto line = initialization_warning(check, flight.settings.check)) warnings.push_back(*line);
  if (checked_coarser)
    warnings.emplace_back("the path was checked against coarser tiles because of the memory limit (--memory)");
  if (const std::size_t cameras = flight.mission.camera_count(); cameras > 1)
    warnings.push_back("images, views and tiles are those of the first of " + std::to_string(cameras) + " cameras");
  if (flight.lacks_textures) warnings.emplace_back(tileset::kNoTextures);
  append(flight.mission.notes);
  append(coarser_picture_warnings(flight, pictures));
  append(missing_tile_warnings(missing));
  append(flight.place.warnings());
  return warnings;
}

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;

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

drawing::FlightProfile make_profile(const PreviewedFlight& flight, const FlightCheck& check, const std::string& title) {
  drawing::FlightProfile profile{.title = title,
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
std::string profile_csv(const PreviewedFlight& flight, const FlightCheck& check,
                        const drawing::FlightProfile& profile) {
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

drawing::FlightOverlay map_flight(const PreviewedFlight& flight, const scene::Scene& scene, const FlightCheck& check,
                                  const std::vector<SamplePicture>& pictures, double reach_m) {
  drawing::FlightOverlay map;
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
Box3 map_bounds(const drawing::FlightOverlay& map, double least_m) {
  Box3 box;
  for (const Vec3& p : map.positions) box.extend(p);
  for (const drawing::ViewFootprint& view : map.views) {
    for (const Vec2& p : view.footprint) box.extend(Vec3(p.x(), p.y(), view.position.z()));
  }
  const Vec3 short_m = (Vec3::Constant(least_m) - box.sizes()).cwiseMax(0.0);
  return {box.min() - short_m / 2, box.max() + short_m / 2};
}

/// Draws the path over the place, and heights along it. `scene`: the tiles of the checks. Tiles of the map that could
/// not be read are appended to `missing`.
PreviewFigures draw_figures(PreviewedFlight& flight, const scene::Scene& scene, const FlightCheck& check,
                            const std::vector<SamplePicture>& pictures, std::vector<place::MissingTile>& missing,
                            const Progress& progress) {
  drawing::FlightProfile profile =
      make_profile(flight, check, place::source_display_name(flight.settings.render.source) + ": flight profile");
  const nlohmann::json nearest = nearest_surface(check, flight.frames());
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
  const drawing::FlightOverlay map =
      map_flight(flight, scene, check, pictures, std::max({4 * above_m, 0.75 * longer_m, 30.0}));
  const render::GroundGrid grid =
      preview::fit_ground_grid(map_bounds(map, std::max(10.0, above_m)), flight.settings.map_pixels);
  const preview::GroundView view = preview::render_ground_view(
      flight.place, grid, {.error_m = grid.pixel_m, .top_down = {}, .max_memory_bytes = flight.memory_left()},
      progress);
  missing.insert(missing.end(), view.missing.begin(), view.missing.end());
  const imaging::Camera& camera = flight.mission.calibration.camera;
  drawing::PlaceMap figure{.title = place::source_display_name(flight.settings.render.source) + ": " +
                                    flight.settings.render.flight.flight.filename().string(),
                           .notes = {profile.notes[0] + base::formatted("; %d x %d pixels, %.0f° wide", camera.width(),
                                                                        camera.height(), camera.horizontal_fov_deg())},
                           .attribution = base::joined(flight.place.attribution(), "; "),
                           .ground = preview::to_ground_picture(view),
                           .frame = flight.place.placement().local_frame,
                           .outlines = preview::missing_outlines(view),
                           .flight = map};
  return {draw_to_image(figure), draw_to_image(profile), profile_csv(flight, check, profile)};
}

using nlohmann::json;

tileset::LoadOptions preview_load_options(const recording::RenderSettings& settings) {
  tileset::LoadOptions load = settings.load;
  load.allow_large_area = settings.error_px.has_value();  // tiles are then selected by what the flight sees
  return load;
}

}  // namespace

json preview_flight(const PreviewSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  if (fs::exists(out) && !replace) throw InputError(out.string(), "exists already; --force replaces it");
  PreviewedFlight flight{
      settings, recording::plan_flight(settings.render, progress),
      place::PlaceReader(settings.render.source, preview_load_options(settings.render), fetch::Use::kAnalyse),
      settings.render.max_memory_bytes.value_or(base::default_memory_bytes()), 0};
  if (flight.frames().empty()) throw InputError(settings.render.flight.flight.string(), "has no frames");
  std::vector<place::MissingTile> missing;
  look_at_place(flight);
  SurroundingTiles around = read_surroundings(flight, progress);
  flight.checks_bytes = around.part.memory_bytes;
  std::move(around.part.missing.begin(), around.part.missing.end(), std::back_inserter(missing));
  const scene::Scene scene(place::with_placeholder(std::move(around.part.meshes)), flight.pose(0).translation);
  const FlightCheck check = check_flight(scene, flight.mission, settings.check, progress);
  const std::vector<SamplePicture> pictures = render_pictures(flight, missing, progress);
  const PreviewFigures figures = draw_figures(flight, scene, check, pictures, missing, progress);

  const std::vector<render::FlightFault> faults = find_faults(check, settings.check);
  const std::vector<std::string> warnings =
      collect_warnings(flight, check, faults, pictures, around.is_coarser, missing);
  const json found = preview_json(flight, check, pictures, faults, warnings);
  base::write_folder(out, replace, [&](const fs::path& temporary) {
    imaging::write_rgb(temporary / "map.png", figures.map);
    imaging::write_rgb(temporary / "profile.png", figures.profile);
    base::write_file(temporary / "profile.csv", figures.profile_csv);
    for (const SamplePicture& p : pictures) imaging::write_rgb(temporary / (p.name + ".jpg"), p.thumbnail, 88);
    base::write_file(temporary / "preview.json", found.dump(2) + "\n");
  });
  return found;
}

}  // namespace tileflight::preview
