#include "tileflight/experiment/proposed_region.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tileflight/ground_truth/suiting_voxel.h"

namespace tileflight::experiment {
namespace {

using geometry::Vec3;

constexpr double kWidest_m = 500.0;
constexpr double kTrimmed = 0.005;
constexpr double kSpikes = 0.001;  ///< of heights, on each side

/// Columns or rows, first and last.
struct Span {
  int first = 0, last = 0;
  int size() const { return last - first + 1; }
};

/// How many pixels of surface lie above and to the left of each corner between pixels.
class SurfaceCounts {
 public:
  explicit SurfaceCounts(const imaging::FloatImage& heights_m)
      : columns_(heights_m.width + 1),
        sums_(static_cast<std::size_t>(columns_) * (static_cast<std::size_t>(heights_m.height) + 1), 0) {
    for (int y = 0; y < heights_m.height; ++y) {
      for (int x = 0; x < heights_m.width; ++x) {
        const int here = std::isfinite(heights_m(x, y)) ? 1 : 0;
        sums_[index(x + 1, y + 1)] = here + until(x, y + 1) + until(x + 1, y) - until(x, y);
      }
    }
  }
  std::int64_t in(const Span& x, const Span& y) const {
    return until(x.last + 1, y.last + 1) - until(x.first, y.last + 1) - until(x.last + 1, y.first) +
           until(x.first, y.first);
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
  }
  std::int64_t until(int x, int y) const { return sums_[index(x, y)]; }

  int columns_;
  std::vector<std::int64_t> sums_;
};

/// The span that holds all but the outermost share on each side; `count_until(i)`: pixels before the i-th.
template <class Count>
Span trimmed(int size, std::int64_t all, const Count& count_until) {
  const double left_out = kTrimmed * static_cast<double>(all);
  Span span{0, size - 1};
  while (span.first < span.last && static_cast<double>(count_until(span.first + 1)) <= left_out) ++span.first;
  while (span.last > span.first && static_cast<double>(all - count_until(span.last)) <= left_out) --span.last;
  return span;
}

/// The places of a window within a span.
std::vector<Span> windows(const Span& span, int size) {
  if (span.size() <= size) return {span};
  std::vector<Span> all;
  const int step = std::max(1, size / 24);
  for (int first = span.first; first + size - 1 <= span.last; first += step) all.push_back({first, first + size - 1});
  return all;
}

struct Window {
  Span x, y;
};

Window fullest(const SurfaceCounts& counts, const Window& within, int size) {
  Window best = within;
  std::int64_t most = -1;
  double nearest = INFINITY;
  const auto off = [](const Span& a, const Span& b) { return std::abs(a.first + a.last - b.first - b.last); };
  for (const Span& y : windows(within.y, size)) {
    for (const Span& x : windows(within.x, size)) {
      const std::int64_t count = counts.in(x, y);
      const double away = std::hypot(off(x, within.x), off(y, within.y));
      if (count < most || (count == most && away >= nearest)) continue;
      most = count;
      nearest = away;
      best = {x, y};
    }
  }
  return best;
}

/// Heights in the window without the outermost ones.
std::pair<double, double> heights_in(const imaging::FloatImage& heights_m, const Window& window) {
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
  return {at(kSpikes), at(1 - kSpikes)};
}

/// To what numbers are rounded at this size.
double unit_of(double longest_m) {
  return longest_m >= 50 ? 1.0 : longest_m >= 5 ? 0.1 : longest_m >= 0.5 ? 0.01 : 0.001;
}

std::string decimal(double value, int most_decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", most_decimals, value);
  std::string out = text;
  if (out.find('.') != std::string::npos) {
    out.erase(out.find_last_not_of('0') + 1);
    if (out.back() == '.') out.pop_back();
  }
  return out == "-0" ? "0" : out;
}

}  // namespace

std::optional<ProposedRegion> proposed_region(const sensors::GroundGrid& grid, const imaging::FloatImage& heights_m) {
  const SurfaceCounts counts(heights_m);
  const Span columns{0, heights_m.width - 1}, rows{0, heights_m.height - 1};
  const std::int64_t all = counts.in(columns, rows);
  if (all == 0) return std::nullopt;
  const Window surface{trimmed(heights_m.width, all,
                               [&](int i) {
                                 return counts.in({0, i - 1}, rows);
                               }),
                       trimmed(heights_m.height, all, [&](int i) {
                         return counts.in(columns, {0, i - 1});
                       })};
  const int widest_px = std::max(1, static_cast<int>(kWidest_m / grid.pixel_m));
  const Window window = fullest(counts, surface, widest_px);

  const double west_m = grid.west_m + grid.pixel_m * window.x.first,
               north_m = grid.north_m - grid.pixel_m * window.y.first;
  const double east_m = grid.pixel_m * window.x.size(), south_m = grid.pixel_m * window.y.size();
  const auto [low_m, high_m] = heights_in(heights_m, window);
  const double longest_m = std::max({east_m, south_m, high_m - low_m});
  const double unit_m = unit_of(longest_m), margin_m = std::max(0.1 * (high_m - low_m), 0.02 * longest_m);
  const auto rounded = [&](double value) { return std::round(value / unit_m) * unit_m; };
  const auto enough = [&](double value) { return std::ceil(value / unit_m - 1e-6) * unit_m; };
  ProposedRegion proposed;
  proposed.center = {rounded(west_m + east_m / 2), rounded(north_m - south_m / 2), rounded((low_m + high_m) / 2)};
  proposed.size = {enough(east_m), enough(south_m), enough(high_m - low_m + 2 * margin_m)};
  proposed.voxel_m = ground_truth::suiting_voxel_m({east_m, south_m, high_m - low_m});
  proposed.surface_share = static_cast<double>(counts.in(window.x, window.y)) / static_cast<double>(all);
  return proposed;
}

std::string options_text(const ProposedRegion& p, const std::optional<geometry::LocalFrame>& frame) {
  std::string text =
      "--center-local " + decimal(p.center.x(), 3) + "," + decimal(p.center.y(), 3) + "," + decimal(p.center.z(), 3);
  if (frame) {
    const geometry::Geodetic place = frame->geodetic_from_local(p.center);
    text = "--center " + decimal(place.latitude_deg, 7) + "," + decimal(place.longitude_deg, 7) + "," +
           decimal(place.height.m, 2);
  }
  return text + " --size " + decimal(p.size.x(), 3) + "," + decimal(p.size.y(), 3) + "," + decimal(p.size.z(), 3) +
         " --voxel " + decimal(p.voxel_m, 4);
}

nlohmann::json to_json(const ProposedRegion& p, const std::optional<geometry::LocalFrame>& frame) {
  nlohmann::json out{{"voxel_size", p.voxel_m},
                     {"region",
                      {{"center", {p.center.x(), p.center.y(), p.center.z()}},
                       {"size", {p.size.x(), p.size.y(), p.size.z()}},
                       {"surface_share", p.surface_share}}},
                     {"options", options_text(p, frame)}};
  out["region"]["center_geodetic"] = nullptr;
  if (frame) {
    const geometry::Geodetic place = frame->geodetic_from_local(p.center);
    out["region"]["center_geodetic"] = {
        {"lat", place.latitude_deg}, {"lon", place.longitude_deg}, {"height", place.height.m}};
  }
  return out;
}

}  // namespace tileflight::experiment
