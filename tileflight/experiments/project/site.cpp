#include "tileflight/experiments/project/site.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/capture/ingest/telemetry_positions.h"
#include "tileflight/capture/preview/ground_view.h"
#include "tileflight/capture/preview/inspect_map.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/drawing/place_map.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::project {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr int kViewSide_px = 900;
constexpr double kBoundsSteps = 128.0;     // tiles for the bounds of a place: this share of its extent
constexpr double kFarthestView_m = 150.0;  // what is farther away shows little to a map
constexpr double kNearestView_m = 25.0;
constexpr double kBelowGround_m = -3.0;  // lower than a receiver's errors explain

/// Holds a height reference of the log with the positions that it gives.
struct Reference {
  std::string word;  ///< "ellipsoid", "sea-level" or "takeoff"
  std::vector<dataset::GpsFix> fixes;
  std::optional<double> takeoff_height_m;
  std::vector<double> above_ground_m;  ///< NaN where the place has no surface
};

/// Holds the height reference that a log states or suggests.
struct StatedReference {
  std::string word;
  std::string why;
  Certainty certainty = Certainty::kLikely;
};

/// Returns nullopt if the log says nothing about it. Heights above the ellipsoid are concluded from tags; those above
/// sea level are assumed where there are no tags.
std::optional<StatedReference> stated_reference(const flight_logs::Telemetry& telemetry) {
  if (telemetry.height_datum == flight_logs::HeightDatum::kUnknown) return std::nullopt;
  const bool is_ellipsoid = telemetry.height_datum == flight_logs::HeightDatum::kEllipsoid;
  const std::string& note = telemetry.height_datum_note;
  return StatedReference{is_ellipsoid ? "ellipsoid" : "sea-level",
                         note.empty() ? "the log or its format states it" : note,
                         note.empty() || is_ellipsoid ? Certainty::kLikely : Certainty::kGuess};
}

/// Returns the positions by a height reference; nullopt if the log has no such heights.
std::optional<Reference> reference_of(const Recording& recording, const std::string& word,
                                      std::optional<double> takeoff_height_m = {}) {
  ingest::IngestedFlightConfig flight;
  flight.telemetry = recording.telemetry_source;
  flight.telemetry_height = word;
  flight.takeoff_height_m = takeoff_height_m;
  std::vector<std::string> ignored;
  try {
    return Reference{word, ingest::to_gps_fixes(recording.telemetry, flight, ignored), takeoff_height_m, {}};
  } catch (const InputError&) {
    return std::nullopt;
  }
}

/// Returns the median height of the surface in a square about a position, by the view from above; NaN if there is none.
double ground_around_m(const preview::GroundView& view, const Vec3& position, double radius_m) {
  const geometry::Vec2 pixel = view.grid.pixel_at(position);
  const int radius = static_cast<int>(radius_m / view.grid.pixel_m);
  const int middle_x = static_cast<int>(std::lround(pixel.x())), middle_y = static_cast<int>(std::lround(pixel.y()));
  std::vector<double> heights_m;
  for (int y = std::max(0, middle_y - radius); y <= std::min(view.grid.height - 1, middle_y + radius); ++y)
    for (int x = std::max(0, middle_x - radius); x <= std::min(view.grid.width - 1, middle_x + radius); ++x)
      if (std::isfinite(view.image.height_m(x, y))) heights_m.push_back(view.image.height_m(x, y));
  return heights_m.empty() ? std::numeric_limits<double>::quiet_NaN() : base::median(heights_m);
}

/// Returns the height of the ground below a position; at a hole in the surface, the ground nearby. NaN where the place
/// has no surface.
double ground_below_m(const preview::GroundView& view, const Vec3& position) {
  for (const double radius_m : {0.0, 2.0, 5.0, 10.0, 20.0}) {
    const double height_m = ground_around_m(view, position, radius_m);
    if (std::isfinite(height_m)) return height_m;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

void measure_heights(const preview::GroundView& view, const geometry::LocalFrame& frame, Reference& reference) {
  for (const Vec3& position : ingest::to_local_positions(reference.fixes, frame))
    reference.above_ground_m.push_back(position.z() - ground_below_m(view, position));
}

std::vector<double> known(const std::vector<double>& values) {
  std::vector<double> result;
  std::ranges::copy_if(values, std::back_inserter(result), [](double value) { return std::isfinite(value); });
  return result;
}

/// Returns the ground's height above the ellipsoid at the first position that is on the ground by the log's own heights
/// above take-off.
std::optional<double> takeoff_ground_m(const Recording& recording, const preview::GroundView& view,
                                       const geometry::LocalFrame& frame) {
  constexpr double kOnGround_m = 2.0;
  for (const flight_logs::TelemetryFix& fix : recording.telemetry.fixes) {
    if (!fix.height_above_takeoff_m || std::abs(*fix.height_above_takeoff_m) > kOnGround_m) continue;
    Vec3 position = frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, frame.origin().height});
    position.z() = ground_below_m(view, position);
    if (!std::isfinite(position.z())) return std::nullopt;
    return frame.geodetic_from_local(position).height.m - *fix.height_above_takeoff_m;
  }
  return std::nullopt;
}

std::string heights_text(const Reference& reference) {
  const std::vector<double> heights_m = known(reference.above_ground_m);
  if (heights_m.empty()) return "outside the place";
  const auto [low, high] = std::ranges::minmax_element(heights_m);
  return base::formatted("%.1f to %.1f m above the surface", *low, *high);
}

/// Tells whether the flight, by this reference, begins on the ground and rises from it.
bool rises_from_ground(const Reference& reference) {
  constexpr double kOnGround_m = 5.0, kRises_m = 8.0;
  const std::vector<double> heights_m = known(reference.above_ground_m);
  return !heights_m.empty() &&
         std::abs(heights_m.front())<kOnGround_m&& * std::ranges::max_element(heights_m) - heights_m.front()> kRises_m;
}

bool stays_above_ground(const Reference& reference) {
  const std::vector<double> heights_m = known(reference.above_ground_m);
  return !heights_m.empty() && *std::ranges::min_element(heights_m) > kBelowGround_m;
}

/// Holds a reference and says why it was chosen.
struct ChosenReference {
  const Reference* reference = nullptr;
  std::string why;
  Certainty certainty = Certainty::kLikely;
};

/// Chooses among the references that the log allows; there is at least one.
ChosenReference choose_among(const std::vector<Reference>& all, const flight_logs::Telemetry& telemetry) {
  const auto find = [&](const std::string& word) -> const Reference* {
    const auto found = std::ranges::find(all, word, &Reference::word);
    return found == all.end() ? nullptr : &*found;
  };
  if (const auto stated = stated_reference(telemetry)) {
    if (const Reference* reference = find(stated->word)) return {reference, stated->why, stated->certainty};
  }
  if (const Reference* takeoff = find("takeoff"))
    return {takeoff, "the log has heights above the take-off point, which lies on the place's ground"};
  const auto count = std::ranges::count_if(all, rises_from_ground);
  if (count == 1)
    return {&*std::ranges::find_if(all, rises_from_ground), "by it, the flight begins on the ground of the place"};
  const auto above = std::ranges::find_if(all, stays_above_ground);
  return {above == all.end() ? &all.front() : &*above,
          "the log does not state what its heights are above, and receivers' are mostly above sea level",
          Certainty::kGuess};
}

/// Returns all references that the log allows, with heights above the ground.
std::vector<Reference> possible_references(const Recording& recording, const preview::GroundView& view,
                                           const geometry::LocalFrame& frame) {
  std::vector<Reference> all;
  for (const char* word : {"sea-level", "ellipsoid"})
    if (auto reference = reference_of(recording, word)) all.push_back(std::move(*reference));
  if (const std::optional<double> takeoff_m = takeoff_ground_m(recording, view, frame))
    if (auto reference = reference_of(recording, "takeoff", takeoff_m)) all.push_back(std::move(*reference));
  if (all.empty())
    throw InputError(recording.telemetry_source.string(),
                     "states no absolute heights, and its take-off point lies outside the place: give telemetry_height "
                     "and takeoff_height in the experiment");
  for (Reference& reference : all) measure_heights(view, frame, reference);
  return all;
}

/// Chooses the height reference, says why, and warns of one that puts the flight below the ground.
Reference choose_reference(const Recording& recording, const preview::GroundView& view,
                           const geometry::LocalFrame& frame, Site& site) {
  const std::vector<Reference> all = possible_references(recording, view, frame);
  const ChosenReference chosen = choose_among(all, recording.telemetry);
  const Reference& best = *chosen.reference;
  std::string why = chosen.why + ": " + heights_text(best);
  for (const Reference& other : all)
    if (&other != &best) why += "; " + other.word + ": " + heights_text(other);
  if (const std::vector<double> heights_m = known(best.above_ground_m); !heights_m.empty() && !stays_above_ground(best))
    site.warnings.push_back(
        base::formatted("by its log the flight goes %.1f m below the surface of the place: check the height reference "
                        "(telemetry_height), the place's own heights, and whether both are of one site",
                        -*std::ranges::min_element(heights_m)));
  site.choices.push_back({"real.ingest", "telemetry_height", best.word, why, chosen.certainty});
  if (best.takeoff_height_m)
    site.choices.push_back({"real.ingest", "takeoff_height", base::trimmed_text(*best.takeoff_height_m, 2),
                            "the place's surface at the take-off point, above the ellipsoid", Certainty::kLikely});
  return best;
}

std::vector<TrackSample> track_of(const Reference& reference) {
  std::vector<TrackSample> track;
  for (std::size_t i = 0; i < reference.fixes.size(); ++i) {
    const double height_m = reference.above_ground_m[i];
    track.push_back({reference.fixes[i].time_s, std::isfinite(height_m) ? height_m : 0.0, std::isfinite(height_m)});
  }
  return track;
}

/// Returns how far beside a position the camera sees the ground usefully: to the side of its image, tilted by a
/// gimbal's usual angles, at most four heights.
double view_reach_m(const imaging::Camera& camera, double height_m) {
  constexpr double kUsualTilt_rad = 0.6, kMostHeights = 4.0;
  const double angle_rad = std::min(1.3, 0.5 * camera.horizontal_fov_deg() * M_PI / 180.0 + kUsualTilt_rad);
  const double reach_m = height_m * std::min(kMostHeights, std::tan(angle_rad));
  return std::clamp(reach_m, kNearestView_m, kFarthestView_m);
}

Box3 heights_within(const preview::GroundView& view, Box3 box) {
  Box3 surface;
  for (int y = 0; y < view.grid.height; ++y) {
    for (int x = 0; x < view.grid.width; ++x) {
      const float height_m = view.image.height_m(x, y);
      const render::GroundGrid pixel = view.grid.crop(x, y, 1, 1);
      const Vec3 middle(pixel.west_m + pixel.pixel_m / 2, pixel.north_m - pixel.pixel_m / 2, height_m);
      if (!std::isfinite(height_m) || middle.x() < box.min().x() || middle.x() > box.max().x() ||
          middle.y() < box.min().y() || middle.y() > box.max().y())
        continue;
      surface.extend(Vec3(pixel.west_m, pixel.south_m(), height_m));
      surface.extend(Vec3(pixel.east_m(), pixel.north_m, height_m));
    }
  }
  return surface;
}

std::string coordinates(const Vec3& v, int decimals) {
  return "[" + base::trimmed_text(v.x(), decimals) + ", " + base::trimmed_text(v.y(), decimals) + ", " +
         base::trimmed_text(v.z(), decimals) + "]";
}

std::string geodetic_text(const geometry::Geodetic& place) {
  return "[" + base::trimmed_text(place.latitude_deg, 7) + ", " + base::trimmed_text(place.longitude_deg, 7) + ", " +
         base::trimmed_text(place.height.m, 2) + "]";
}

/// Adds the region's keys. `is_on_earth`: the tileset is georeferenced.
void add_region(const Box3& box, double voxel_m, const std::string& reason, Certainty certainty,
                const place::PlaceReader& place, Site& site) {
  const bool is_on_earth = place.is_georeferenced();
  const std::string center = is_on_earth
                                 ? geodetic_text(place.placement().local_frame->geodetic_from_local(box.center()))
                                 : coordinates(box.center(), 2);
  site.choices.push_back({"place", is_on_earth ? "center" : "center_local", center, reason, certainty});
  site.choices.push_back(
      {"place", "size", coordinates(box.sizes(), 1), "east, north and up, metres: what is scored", certainty});
  site.choices.push_back({"truth", "voxel", base::trimmed_text(voxel_m, 3),
                          "about 250 voxels along the longer side, at most the published 1 m", Certainty::kLikely});
}

/// Draws the view with region and flight.
imaging::RgbImage draw_map(const std::string& source, const place::PlaceReader& place, const preview::GroundView& view,
                           const Box3& region, const std::vector<Vec3>& flight) {
  drawing::PlaceMap map{.title = place::source_display_name(source),
                        .notes = {"dashed: the region that is scored" +
                                  std::string(flight.empty() ? "" : "; line: the positions of the log")},
                        .attribution = base::joined(place.attribution(), "; "),
                        .ground = preview::to_ground_picture(view),
                        .frame = place.placement().local_frame,
                        .outlines = preview::missing_outlines(view),
                        .flight = std::nullopt};
  const Vec3 &low = region.min(), &high = region.max();
  map.outlines.push_back({drawing::MapOutline::Kind::kProposedRegion,
                          {{low.x(), low.y()}, {high.x(), low.y()}, {high.x(), high.y()}, {low.x(), high.y()}}});
  if (!flight.empty())
    map.flight = {flight, std::vector<geometry::Vec2>(flight.size(), geometry::Vec2::Zero()), {}, {}};
  return draw_to_image(map);
}

preview::GroundView view_box(place::PlaceReader& place, const Box3& box, const Progress& progress) {
  const render::GroundGrid grid = preview::fit_ground_grid(box, kViewSide_px);
  preview::GroundViewOptions options;
  options.error_m = grid.pixel_m;
  options.max_memory_bytes = base::default_memory_bytes();
  return preview::render_ground_view(place, grid, options, progress);
}

/// Chooses the region that `inspect --map` proposes for the whole place.
void choose_whole_place(const SiteOptions& options, const std::string& why, Certainty certainty, Site& site,
                        const Progress& progress) {
  tileset::LoadOptions load{.allow_large_area = true, .origin = options.origin, .source = options.source_options};
  place::PlaceReader place(options.source, load, fetch::Use::kAnalyse);
  const Vec3 extent = place.placement().region.box().sizes();
  const Box3 surface = preview::surface_bounds(place, std::max(extent.x(), extent.y()) / kBoundsSteps,
                                               base::default_memory_bytes(), progress);
  if (surface.isEmpty()) throw InputError(place.name(), "contains no surface that could be flown over");
  const preview::GroundView view = view_box(place, surface, progress);
  const auto proposed = preview::propose_region(view.grid, view.image.height_m);
  if (!proposed) throw InputError(place.name(), "contains no surface that is seen from above");
  const Box3 box(proposed->center - proposed->size / 2, proposed->center + proposed->size / 2);
  add_region(box, proposed->voxel_m,
             why + base::formatted("; this part holds %.0f %% of its surface", 100 * proposed->surface_share),
             certainty, place, site);
  if (options.origin)
    site.choices.push_back({"place", "origin", geodetic_text(*options.origin), "it was given", Certainty::kCertain});
  site.map = draw_map(options.source, place, view, box, {});
}

Box3 bounds_of(const std::vector<Vec3>& positions) {
  Box3 box;
  for (const Vec3& position : positions) box.extend(position);
  return box;
}

/// Opens the place with its local frame at the middle of the flight, and the region around it.
place::PlaceReader open_around(const SiteOptions& options, const std::vector<dataset::GpsFix>& fixes, double margin_m) {
  const geometry::LocalFrame frame(fixes.front().position);
  const Box3 flown = bounds_of(ingest::to_local_positions(fixes, frame));
  geometry::Geodetic center = frame.geodetic_from_local(flown.center());
  center.height.m = std::numeric_limits<double>::quiet_NaN();
  const Vec3 size(flown.sizes().x() + 2 * margin_m, flown.sizes().y() + 2 * margin_m, 0.0);
  return {options.source,
          {.center = center,
           .size = size,
           .allow_large_area = true,
           .origin = options.origin,
           .source = options.source_options},
          fetch::Use::kAnalyse};
}

void choose_by_positions(const SiteOptions& options, const Recording& recording, const imaging::Camera& camera,
                         Site& site, const Progress& progress) {
  const std::optional<Reference> any = [&] {
    auto reference = reference_of(recording, "sea-level");
    return reference ? reference : reference_of(recording, "takeoff", 0.0);
  }();
  if (!any) throw InputError(recording.telemetry_source.string(), "has no heights, so its positions cannot be used");
  place::PlaceReader place = open_around(options, any->fixes, kFarthestView_m);
  const geometry::LocalFrame frame = *place.placement().local_frame;
  const Box3 around = place.placement().region.box();
  const preview::GroundView view = view_box(place, around, progress);
  const Reference reference = choose_reference(recording, view, frame, site);
  if (known(reference.above_ground_m).empty())
    throw InputError(
        recording.telemetry_source.string(),
        "flies where " + place.name() + " has no surface: " +
            tileset::describe_separation(bounds_of(ingest::to_local_positions(reference.fixes, frame)),
                                         tileset::local_bounding_box(place.tree().volume(place.tree().root()),
                                                                     place.placement().T_local_tileset),
                                         frame));
  if (recording.has_video_clock) site.excerpt = options.choose_excerpt(track_of(reference), true);
  const std::vector<Vec3> positions = ingest::to_local_positions(reference.fixes, frame);
  Box3 seen;
  std::vector<double> heights_m;
  std::vector<Vec3> flown;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double time_s = reference.fixes[i].time_s;
    const bool is_used =
        !site.excerpt || (time_s >= site.excerpt->from_s && (!site.excerpt->to_s || time_s <= *site.excerpt->to_s));
    if (!is_used || !std::isfinite(reference.above_ground_m[i])) continue;
    flown.push_back(positions[i]);
    heights_m.push_back(reference.above_ground_m[i]);
    const double reach_m = view_reach_m(camera, std::max(0.0, heights_m.back()));
    seen.extend(positions[i] - Vec3(reach_m, reach_m, 0));
    seen.extend(positions[i] + Vec3(reach_m, reach_m, 0));
  }
  if (flown.empty())
    throw InputError(recording.telemetry_source.string(),
                     "has no position over the place while the video runs; give the clock's offset "
                     "(telemetry_offset in an experiment) or another part");
  Box3 box = heights_within(view, seen);
  const double margin_m = std::max(2.0, 0.05 * box.sizes().z());
  box.min().z() -= margin_m;
  box.max().z() += margin_m;
  site.usual_height_m = base::median(heights_m);
  add_region(box, ground_truth::suggest_voxel_m(box.sizes()),
             base::formatted("around the %zu positions of the log, as far as the camera sees from %.0f m", flown.size(),
                             *site.usual_height_m),
             Certainty::kLikely, place, site);
  if (options.origin)
    site.choices.push_back({"place", "origin", geodetic_text(*options.origin), "it was given", Certainty::kCertain});
  base::add_distinct(place.warnings(), site.warnings);
  site.map = draw_map(options.source, place, view, box, flown);
}

}  // namespace

Site choose_site(const SiteOptions& options, const Recording& recording, const imaging::Camera& camera,
                 const Progress& progress) {
  Site site;
  const bool is_on_earth =
      place::PlaceReader(options.source, {.allow_large_area = true, .source = options.source_options},
                         fetch::Use::kAnalyse)
          .is_georeferenced();
  if (recording.has_positions() && (is_on_earth || options.origin)) {
    choose_by_positions(options, recording, camera, site, progress);
    return site;
  }
  choose_whole_place(options,
                     recording.has_positions() ? "the tileset has no georeference, so the positions do not say where "
                                                 "in it the flight is (--origin LAT,LON,HEIGHT says it)"
                                               : "the recording has no positions",
                     Certainty::kGuess, site, progress);
  if (recording.has_positions()) {
    for (Choice& choice : choose_height_reference(recording)) site.choices.push_back(std::move(choice));
    site.warnings.emplace_back(
        "the place has no georeference: the log's positions give the scale of the map, not where it lies; give "
        "--origin LAT,LON,HEIGHT, the position of the tileset's origin, if it is known");
  }
  return site;
}

std::vector<Choice> choose_height_reference(const Recording& recording) {
  const flight_logs::Telemetry& telemetry = recording.telemetry;
  if (const std::optional<StatedReference> stated = stated_reference(telemetry))
    return {{"real.ingest", "telemetry_height", stated->word, stated->why, stated->certainty}};
  if (reference_of(recording, "sea-level"))
    return {{"real.ingest", "telemetry_height", "sea-level",
             "the log does not state what its heights are above; a wrong one only moves the whole path up or down",
             Certainty::kGuess}};
  return {{"real.ingest", "telemetry_height", "takeoff", "the log has heights above take-off only", Certainty::kLikely},
          {"real.ingest", "takeoff_height", "0", "not known; a wrong one only moves the whole path up or down",
           Certainty::kGuess}};
}

}  // namespace tileflight::project
