#include "tileflight/capture/preview/propose_region.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/imaging/summed_area_table.h"
#include "tileflight/world/ground_truth/voxelize.h"

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

}  // namespace tileflight::preview
