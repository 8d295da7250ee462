#include "tileflight/capture/preview/inspect_map.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tileflight/capture/preview/ground_view.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/summed_area_table.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::preview {

namespace {

using geometry::Vec3;

constexpr double kMaxSide_m = 500.0;
constexpr double kTrimmedShare = 0.005;
constexpr double kHeightOutlierShare = 0.001;  ///< share of heights cut off on each side

/// Columns or rows, first and last.
struct IndexRange {
  int first = 0, last = 0;
  int size() const { return last - first + 1; }
};

/// Numbers of surface pixels.
using SurfaceCounts = imaging::SummedAreaTable<std::int64_t>;

std::int64_t count_in(const SurfaceCounts& counts, const IndexRange& x, const IndexRange& y) {
  return counts.sum(x.first, y.first, x.last + 1, y.last + 1);
}

/// The range that holds all but the outermost share on each side; `count_until(i)`: pixels before the i-th.
template <class Count>
IndexRange trim_outliers(int size, std::int64_t all, const Count& count_until) {
  const double left_out = kTrimmedShare * static_cast<double>(all);
  IndexRange span{0, size - 1};
  while (span.first < span.last && static_cast<double>(count_until(span.first + 1)) <= left_out) ++span.first;
  while (span.last > span.first && static_cast<double>(all - count_until(span.last)) <= left_out) --span.last;
  return span;
}

/// Possible positions of a window within a range.
std::vector<IndexRange> window_positions(const IndexRange& span, int size) {
  if (span.size() <= size) return {span};
  std::vector<IndexRange> all;
  const int step = std::max(1, size / 24);
  for (int first = span.first; first + size - 1 <= span.last; first += step) all.push_back({first, first + size - 1});
  return all;
}

struct Window {
  IndexRange x, y;
};

Window find_fullest_window(const SurfaceCounts& counts, const Window& within, int size) {
  Window best = within;
  std::int64_t most = -1;
  double nearest = INFINITY;
  const auto off = [](const IndexRange& a, const IndexRange& b) {
    return std::abs(a.first + a.last - b.first - b.last);
  };
  for (const IndexRange& y : window_positions(within.y, size)) {
    for (const IndexRange& x : window_positions(within.x, size)) {
      const std::int64_t count = count_in(counts, x, y);
      const double away = std::hypot(off(x, within.x), off(y, within.y));
      if (count < most || (count == most && away >= nearest)) continue;
      most = count;
      nearest = away;
      best = {x, y};
    }
  }
  return best;
}

/// Range of heights in the window without outliers.
std::pair<double, double> trimmed_height_range(const imaging::FloatImage& heights_m, const Window& window) {
  std::vector<float> found;
  for (int y = window.y.first; y <= window.y.last; ++y) {
    for (int x = window.x.first; x <= window.x.last; ++x) {
      if (std::isfinite(heights_m(x, y))) found.push_back(heights_m(x, y));
    }
  }
  const auto at = [&](double share) {
    const auto place =
        found.begin() + static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(found.size() - 1)));
    std::nth_element(found.begin(), place, found.end());
    return double{*place};
  };
  return {at(kHeightOutlierShare), at(1 - kHeightOutlierShare)};
}

/// Unit to which numbers are rounded at this size.
double rounding_unit(double longest_m) {
  return longest_m >= 50 ? 1.0 : longest_m >= 5 ? 0.1 : longest_m >= 0.5 ? 0.01 : 0.001;
}

std::string format_decimal(double value, int most_decimals) {
  const std::string out = base::trimmed_text(value, most_decimals);
  return out == "-0" ? "0" : out;
}

}  // namespace

std::optional<ProposedRegion> propose_region(const render::GroundGrid& grid, const imaging::FloatImage& heights_m) {
  const SurfaceCounts counts(heights_m.width, heights_m.height,
                             [&](int x, int y) { return std::isfinite(heights_m(x, y)) ? 1 : 0; });
  const IndexRange columns{0, heights_m.width - 1}, rows{0, heights_m.height - 1};
  const std::int64_t all = count_in(counts, columns, rows);
  if (all == 0) return std::nullopt;
  const Window surface{trim_outliers(heights_m.width, all,
                                     [&](int i) {
                                       return count_in(counts, {0, i - 1}, rows);
                                     }),
                       trim_outliers(heights_m.height, all, [&](int i) {
                         return count_in(counts, columns, {0, i - 1});
                       })};
  const int widest_px = std::max(1, static_cast<int>(kMaxSide_m / grid.pixel_m));
  const Window window = find_fullest_window(counts, surface, widest_px);

  const double west_m = grid.west_m + grid.pixel_m * window.x.first,
               north_m = grid.north_m - grid.pixel_m * window.y.first;
  const double east_m = grid.pixel_m * window.x.size(), south_m = grid.pixel_m * window.y.size();
  const auto [low_m, high_m] = trimmed_height_range(heights_m, window);
  const double longest_m = std::max({east_m, south_m, high_m - low_m});
  const double unit_m = rounding_unit(longest_m), margin_m = std::max(0.1 * (high_m - low_m), 0.02 * longest_m);
  const auto rounded = [&](double value) { return std::round(value / unit_m) * unit_m; };
  const auto enough = [&](double value) { return std::ceil(value / unit_m - 1e-6) * unit_m; };
  ProposedRegion proposed;
  proposed.center = {rounded(west_m + east_m / 2), rounded(north_m - south_m / 2), rounded((low_m + high_m) / 2)};
  proposed.size = {enough(east_m), enough(south_m), enough(high_m - low_m + 2 * margin_m)};
  proposed.voxel_m = ground_truth::suggest_voxel_m({east_m, south_m, high_m - low_m});
  proposed.surface_share = static_cast<double>(count_in(counts, window.x, window.y)) / static_cast<double>(all);
  return proposed;
}

std::string to_cli_options(const ProposedRegion& p, const std::optional<geometry::LocalFrame>& frame) {
  std::string text = "--center-local " + format_decimal(p.center.x(), 3) + "," + format_decimal(p.center.y(), 3) + "," +
                     format_decimal(p.center.z(), 3);
  if (frame) {
    const geometry::Geodetic place = frame->geodetic_from_local(p.center);
    text = "--center " + format_decimal(place.latitude_deg, 7) + "," + format_decimal(place.longitude_deg, 7) + "," +
           format_decimal(place.height.m, 2);
  }
  return text + " --size " + format_decimal(p.size.x(), 3) + "," + format_decimal(p.size.y(), 3) + "," +
         format_decimal(p.size.z(), 3) + " --voxel " + format_decimal(p.voxel_m, 4);
}

nlohmann::json to_json(const ProposedRegion& p, const std::optional<geometry::LocalFrame>& frame) {
  nlohmann::json out{{"voxel_size", p.voxel_m},
                     {"region",
                      {{"center", {p.center.x(), p.center.y(), p.center.z()}},
                       {"size", {p.size.x(), p.size.y(), p.size.z()}},
                       {"surface_share", p.surface_share}}},
                     {"options", to_cli_options(p, frame)}};
  out["region"]["center_geodetic"] = nullptr;
  if (frame) {
    const geometry::Geodetic place = frame->geodetic_from_local(p.center);
    out["region"]["center_geodetic"] = {
        {"lat", place.latitude_deg}, {"lon", place.longitude_deg}, {"height", place.height.m}};
  }
  return out;
}

namespace {

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;

/// The local frame is planar: at this distance the ground is 2 km below it.
constexpr double kMaxExtent_m = 320e3;
/// Tile resolution, as a fraction of the extent, used to find bounds.
constexpr double kBoundsSteps = 128.0;

bool has_region(const tileset::LoadOptions& load) {
  return load.center || load.center_local || load.size || !load.areas.empty();
}

/// Metres with the number of decimals appropriate to the size of the place.
std::string format_metres(double value, double longest_m) {
  return base::formatted("%.*f", longest_m >= 100 ? 1 : longest_m >= 10 ? 2 : 3, value);
}

/// Explains why there is nothing to show in a region; nullopt: the whole place.
std::string nothing_to_show(const place::PlaceReader& place, std::int64_t triangles,
                            const std::optional<Box3>& region) {
  const std::set<std::string>& failures = place.failures();
  if (!failures.empty()) {
    return "nothing could be read: " + std::to_string(failures.size()) +
           (failures.size() == 1 ? " tile is" : " tiles are") + " missing or broken (" + *failures.begin() + ")";
  }
  if (triangles > 0) {
    return "seen from above, its surface has no area: " + std::to_string(triangles) +
           " triangles, all upright or without area; `extract` takes them, a map cannot show them";
  }
  if (!region) return "contains no surface and no points: there is nothing to show";
  return "there is no surface in the region " + tileset::describe_extent(*region) + "; the tileset spans " +
         tileset::describe_extent(place.tree());
}

/// The extent shown.
Box3 choose_extent(place::PlaceReader& place, const InspectMapSettings& settings, std::uintmax_t memory,
                   const Progress& progress) {
  const Box3 region = place.placement().region.box();
  const double longer_m = std::max(region.sizes().x(), region.sizes().y());
  if (longer_m > kMaxExtent_m) {
    throw InputError(place.name(), "spans " + base::formatted("%.0f km", longer_m / 1e3) +
                                       ", too much for one map; give --center and --size");
  }
  if (has_region(settings.load)) return region;
  const double error_m = settings.error_m.value_or(longer_m / kBoundsSteps);
  const Box3 surface = surface_bounds(place, error_m, memory, progress);
  if (surface.isEmpty()) throw InputError(place.name(), nothing_to_show(place, 0, std::nullopt));
  return surface;
}

render::OrthophotoOptions top_down_options(const InspectMapSettings& settings, const Box3& region) {
  render::OrthophotoOptions options;
  const bool wants_heights = settings.load.size && settings.load.size->z() > 0;
  if (!wants_heights && settings.load.areas.empty()) return options;
  options.top_m = region.max().z();
  options.bottom_m = region.min().z();
  return options;
}

/// Extent of the surface in the image, and the share of pixels that have one.
struct SurfaceExtent {
  Box3 box;
  double covered_share = 0.0;
};

SurfaceExtent find_surface(const GroundView& view) {
  SurfaceExtent found;
  std::int64_t count = 0;
  for (int y = 0; y < view.grid.height; ++y) {
    for (int x = 0; x < view.grid.width; ++x) {
      const float height_m = view.image.height_m(x, y);
      if (!std::isfinite(height_m)) continue;
      ++count;
      const render::GroundGrid pixel = view.grid.crop(x, y, 1, 1);
      found.box.extend(Vec3(pixel.west_m, pixel.south_m(), height_m));
      found.box.extend(Vec3(pixel.east_m(), pixel.north_m, height_m));
    }
  }
  found.covered_share = static_cast<double>(count) / static_cast<double>(view.image.height_m.pixels.size());
  return found;
}

std::vector<std::string> map_notes(const place::PlaceReader& place, const GroundView& view,
                                   const SurfaceExtent& found) {
  const Vec3 size = found.box.sizes();
  const double longest_m = std::max(size.x(), size.y());
  std::string extent = format_metres(size.x(), longest_m) + " m east × " + format_metres(size.y(), longest_m) +
                       " m north; heights " + format_metres(found.box.min().z(), longest_m) + " to " +
                       format_metres(found.box.max().z(), longest_m) + " m";
  if (const auto& frame = place.placement().local_frame) {
    const double origin_m = frame->origin().height.m;
    extent += " in the local frame, " + format_metres(origin_m + found.box.min().z(), longest_m) + " to " +
              format_metres(origin_m + found.box.max().z(), longest_m) + " m above the ellipsoid";
  }
  std::string pixels =
      base::formatted("one pixel is %.3g m; tiles to a geometric error of %.3g m", view.grid.pixel_m, view.error_m);
  if (const auto& frame = place.placement().local_frame) {
    const geometry::Geodetic& origin = frame->origin();
    pixels += base::formatted("; local frame: east, north, up at %.7f°, %.7f°, %.2f m", origin.latitude_deg,
                              origin.longitude_deg, origin.height.m);
  } else {
    pixels += "; not georeferenced: the local frame is the tileset's own";
  }
  return {extent, pixels};
}

drawing::MapOutline region_outline(const ProposedRegion& proposed) {
  const Vec3 low = proposed.center - proposed.size / 2, high = proposed.center + proposed.size / 2;
  return {drawing::MapOutline::Kind::kProposedRegion,
          {{low.x(), low.y()}, {high.x(), low.y()}, {high.x(), high.y()}, {low.x(), high.y()}}};
}

json map_json(const GroundView& view, const SurfaceExtent& found, const std::filesystem::path& picture) {
  const auto corner = [](const Vec3& v) { return json{v.x(), v.y(), v.z()}; };
  return {
      {"file", picture.string()},
      {"pixels", {view.grid.width, view.grid.height}},
      {"pixel_size", view.grid.pixel_m},
      {"west", view.grid.west_m},
      {"north", view.grid.north_m},
      {"surface", {{"min", corner(found.box.min())}, {"max", corner(found.box.max())}, {"share", found.covered_share}}},
      {"geometric_error_wanted", view.error_m},
      {"tiles", view.tiles},
      {"tiles_missing", view.missing.size()},
      {"parts", view.parts}};
}

void check(const InspectMapSettings& settings, const std::filesystem::path& picture) {
  const std::string ending = picture.extension().string();
  if (ending != ".png" && ending != ".jpg" && ending != ".jpeg")
    throw InputError(picture.string(), "unknown image format for a map (.png or .jpg expected)");
  if (settings.longer_side_px < 64 || settings.longer_side_px > 8000)
    throw InputError("--pixels", "must be from 64 to 8000 pixels");
}

/// Returns the part of the memory limit that the image leaves for tiles. Throws InputError if the image alone exceeds
/// the limit.
std::uintmax_t memory_for_tiles(const render::GroundGrid& grid, std::uintmax_t memory) {
  // Colours and heights, of the part in work, too; and, once the tiles are gone, of the figure that is drawn from them.
  constexpr std::uintmax_t kPixelWithTiles_bytes = 14;
  constexpr std::uintmax_t kPixelOfFigure_bytes = 60;
  const std::uintmax_t pixels = static_cast<std::uintmax_t>(grid.width) * static_cast<std::uintmax_t>(grid.height);
  if (pixels * kPixelOfFigure_bytes > memory) {
    throw InputError("--pixels",
                     base::formatted("a map of %d x %d pixels takes about %.2g GB, more than %.2g GB of "
                                     "memory: fewer pixels, or a higher limit (--memory)",
                                     grid.width, grid.height, static_cast<double>(pixels * kPixelOfFigure_bytes) / 1e9,
                                     static_cast<double>(memory) / 1e9));
  }
  return memory - pixels * kPixelWithTiles_bytes;
}

}  // namespace

json inspect_map(const InspectMapSettings& settings, const std::filesystem::path& picture, const Progress& progress) {
  check(settings, picture);
  tileset::LoadOptions load = settings.load;
  load.allow_large_area = true;
  place::PlaceReader place(settings.source, load, fetch::Use::kAnalyse);
  const std::uintmax_t memory = settings.max_memory_bytes.value_or(base::default_memory_bytes());
  const Box3 box = choose_extent(place, settings, memory, progress);
  const render::GroundGrid grid = fit_ground_grid(box, settings.longer_side_px);
  const std::uintmax_t tile_memory = memory_for_tiles(grid, memory);
  const GroundView view = render_ground_view(place, grid,
                                             {.error_m = settings.error_m.value_or(grid.pixel_m),
                                              .top_down = top_down_options(settings, box),
                                              .max_memory_bytes = tile_memory},
                                             progress);
  const SurfaceExtent found = find_surface(view);
  const auto proposed = propose_region(view.grid, view.image.height_m);
  if (!proposed) {
    const bool is_whole = !has_region(settings.load);
    throw InputError(place.name(),
                     nothing_to_show(place, view.triangles, is_whole ? std::nullopt : std::optional(box)));
  }
  const auto& frame = place.placement().local_frame;
  drawing::PlaceMap map{.title = place::source_display_name(settings.source),
                        .notes = map_notes(place, view, found),
                        .attribution = base::joined(place.attribution(), "; "),
                        .ground = to_ground_picture(view),
                        .frame = frame,
                        .outlines = missing_outlines(view),
                        .flight = std::nullopt};
  if (!has_region(settings.load)) map.outlines.push_back(region_outline(*proposed));
  imaging::write_rgb(picture, draw_to_image(map));

  std::vector<std::string> warnings = ground_view_warnings(view);
  const std::vector<std::string> of_place = place.warnings();
  warnings.insert(warnings.end(), of_place.begin(), of_place.end());
  return {{"map", map_json(view, found, picture)},     {"frame", place::frame_json(place.placement().local_frame)},
          {"georeferenced", place.is_georeferenced()}, {"proposal", to_json(*proposed, frame)},
          {"attribution", place.attribution()},        {"warnings", warnings}};
}

std::string inspect_map_text(const json& found) {
  const json& map = found["map"];
  const json &low = map["surface"]["min"], &high = map["surface"]["max"];
  const double east = high[0].get<double>() - low[0].get<double>(),
               north = high[1].get<double>() - low[1].get<double>();
  const double longest_m = std::max(east, north);
  std::string text =
      map["file"].get<std::string>() + ": " + format_metres(east, longest_m) + " x " + format_metres(north, longest_m) +
      " m of surface from above, " + base::formatted("%.3g", map["pixel_size"].get<double>()) + " m per pixel, from " +
      std::to_string(map["tiles"].get<std::int64_t>()) + " tiles\nheights: " + format_metres(low[2], longest_m) +
      " to " + format_metres(high[2], longest_m) + " m in the local frame";
  const json& frame = found["frame"];
  if (!frame["origin_lat"].is_null()) {
    const double origin_m = frame["origin_height"];
    text += ", " + format_metres(origin_m + low[2].get<double>(), longest_m) + " to " +
            format_metres(origin_m + high[2].get<double>(), longest_m) +
            " m above the ellipsoid\nlocal frame: --origin " +
            base::formatted("%.7f,%.7f,%.2f", frame["origin_lat"].get<double>(), frame["origin_lon"].get<double>(),
                            origin_m);
  }
  const json& proposal = found["proposal"];
  text += "\nproposed region and voxel: " + proposal["options"].get<std::string>() +
          base::formatted(
              " (%.0f %% of the surface; %.0f voxels along its longest side)\n",
              100 * proposal["region"]["surface_share"].get<double>(),
              std::max({proposal["region"]["size"][0].get<double>(), proposal["region"]["size"][1].get<double>(),
                        proposal["region"]["size"][2].get<double>()}) /
                  proposal["voxel_size"].get<double>());
  for (const auto& warning : found["warnings"]) text += "note: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace tileflight::preview
