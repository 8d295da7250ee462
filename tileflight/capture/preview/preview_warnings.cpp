#include "tileflight/capture/preview/preview_warnings.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/recording/frame_store.h"

namespace tileflight::preview {
namespace {

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

/// A line if pictures show coarser tiles than the flight will; empty if not.
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
      base::formatted("%s: coarser tiles, of up to %.3g pixels of error, because of the memory limit (--memory); "
                      "`render` divides such frames, which takes longer than estimated here",
                      names.c_str(), largest_px)};
}

/// A line about a flight that stays beside the place; empty if it does not.
std::vector<std::string> beside_place_warnings(const PreviewedFlight& flight) {
  const double away_m = distance_to_place_m(flight);
  if (!(away_m > 0)) return {};
  return {base::formatted("the flight stays at least %.0f m away from the place: the place spans ", away_m) +
          tileset::describe_extent(place_bounds(flight.place)) +
          " in the local frame; check that --origin (or --center) belongs to the flight file"};
}

}  // namespace

std::vector<std::string> collect_warnings(const PreviewedFlight& flight, const FlightCheck& check,
                                          const std::vector<render::FlightFault>& faults,
                                          const std::vector<SamplePicture>& pictures, bool checked_coarser,
                                          const std::vector<place::MissingTile>& missing) {
  std::vector<std::string> warnings = beside_place_warnings(flight);
  const auto append = [&warnings](const std::vector<std::string>& lines) {
    warnings.insert(warnings.end(), lines.begin(), lines.end());
  };
  for (const render::FlightFault& fault : faults) warnings.push_back(fault_line(fault));
  if (const auto line = initialization_warning(check, flight.settings.check)) warnings.push_back(*line);
  if (checked_coarser)
    warnings.emplace_back("the path was checked against coarser tiles because of the memory limit (--memory)");
  if (const std::size_t cameras = flight.mission.camera_count(); cameras > 1)
    warnings.push_back("pictures, views and tiles are those of the first of " + std::to_string(cameras) + " cameras");
  append(coarser_picture_warnings(flight, pictures));
  append(missing_tile_warnings(missing));
  append(flight.place.warnings());
  return warnings;
}

}  // namespace tileflight::preview
