#include "tileflight/evaluation/metrics/missed_places.h"

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::metrics {

using geometry::Vec3;

namespace {

using PlaceCell = std::array<std::int64_t, 3>;

PlaceCell place_cell(const Vec3& p, double edge_m) {
  const Vec3 cell = (p / edge_m).array().floor();
  return {static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
          static_cast<std::int64_t>(cell.z())};
}

Vec3 center_of(const PlaceCell& place, double edge_m) {
  const Vec3 corner(static_cast<double>(place[0]), static_cast<double>(place[1]), static_cast<double>(place[2]));
  return edge_m * (corner + Vec3::Constant(0.5));
}

void check(const SeenSurface& surface, const char* flight) {
  if (surface.positions.size() != surface.map_distance_m.size())
    throw InputError(flight, "the number of distances differs from the number of surface samples");
}

void check(const MissedPlacesOptions& options) {
  if (!(options.cell_m > 0.0) || !std::isfinite(options.cell_m))
    throw InputError("cell of the missed-places map", "must be above zero, in metres");
  if (!(options.within_m > 0.0))
    throw InputError("distance within which a map point covers the surface", "must be above zero, in metres");
  if (!(options.block_m >= options.cell_m)) throw InputError("block of the bootstrap", "must be at least one cell");
}

/// Cells seen by either camera.
std::map<PlaceCell, SurfaceCell> all_cells(const SeenSurface& simulated, const SeenSurface& real,
                                           const MissedPlacesOptions& options) {
  std::map<PlaceCell, SurfaceCell> cells;
  std::size_t flight = 0;
  for (const SeenSurface* surface : {&simulated, &real}) {
    for (std::size_t i = 0; i < surface->positions.size(); ++i) {
      const PlaceCell place = place_cell(surface->positions[i], options.cell_m);
      SurfaceCell& cell = cells[place];
      cell.center = center_of(place, options.cell_m);
      ++cell.seen[flight];
      cell.mapped[flight] += surface->map_distance_m[i] <= options.within_m;
    }
    ++flight;
  }
  return cells;
}

std::vector<ContingencyTable> by_block(const std::vector<SurfaceCell>& cells, double block_m) {
  std::map<PlaceCell, ContingencyTable> blocks;
  for (const SurfaceCell& cell : cells) blocks[place_cell(cell.center, block_m)].add(cell.missed(0), cell.missed(1));
  std::vector<ContingencyTable> list;
  for (const auto& [place, block] : blocks) list.push_back(block);
  return list;
}

const char* who_missed(const SurfaceCell& cell) {
  if (cell.missed(0)) return cell.missed(1) ? "both" : "simulated";
  return cell.missed(1) ? "real" : "none";
}

}  // namespace

MissedPlaces missed_places(const SeenSurface& simulated, const SeenSurface& real, const MissedPlacesOptions& options) {
  check(simulated, "simulated flight");
  check(real, "real flight");
  check(options);
  MissedPlaces result{.options = options};
  for (const auto& [place, cell] : all_cells(simulated, real, options)) {
    if (cell.seen[0] > 0 && cell.seen[1] > 0) {
      result.cells.push_back(cell);
      result.missed.add(cell.missed(0), cell.missed(1));
    } else {
      ++result.seen_alone[cell.seen[0] > 0 ? 0 : 1];
    }
  }
  result.phi_ci95 = phi_interval(by_block(result.cells, options.block_m), options.resamples, options.seed);
  return result;
}

nlohmann::json to_json(const MissedPlaces& places) {
  return {{"cell", places.options.cell_m},
          {"within", places.options.within_m},
          {"cells", places.cells.size()},
          {"seen_by_simulated_only", places.seen_alone[0]},
          {"seen_by_real_only", places.seen_alone[1]},
          {"missed", to_json(places.missed)},
          {"phi_ci95", places.phi_ci95}};
}

std::string missed_places_csv(const MissedPlaces& places) {
  std::string text = "x,y,z,seen_simulated,mapped_simulated,seen_real,mapped_real,missed\n";
  for (const SurfaceCell& cell : places.cells) {
    text += base::formatted("%.3f,%.3f,%.3f,%zu,%zu,%zu,%zu,%s\n", cell.center.x(), cell.center.y(), cell.center.z(),
                            cell.seen[0], cell.mapped[0], cell.seen[1], cell.mapped[1], who_missed(cell));
  }
  return text;
}

}  // namespace tileflight::metrics
