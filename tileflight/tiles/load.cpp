#include "tileflight/tiles/load.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/tile_contents/attribution.h"
#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/transport/tile_source.h"
#include "tileflight/transport/uri.h"

namespace tileflight::tiles {
namespace {

using imaging::TexturedMesh;

/// Appends a loaded content to the result.
void collect(LoadedContent&& content, LoadedTiles& out, tile_contents::AttributionCollector& attribution) {
  ++out.tiles_loaded;
  for (TexturedMesh& mesh : content.meshes) {
    out.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
    out.meshes.push_back(std::move(mesh));
  }
  for (geometry::PointCloud& cloud : content.clouds) {
    out.points += static_cast<std::int64_t>(cloud.size());
    out.clouds.push_back(std::move(cloud));
  }
  for (const std::string& copyright : content.copyrights) attribution.add(copyright);
  base::add_distinct(content.warnings, out.warnings);
}

void fail(const std::string& what, const LoadOptions& options, LoadedTiles& out) {
  if (!options.allow_incomplete)
    throw InputError(what, "the region is not complete (--allow-incomplete continues without this tile)");
  ++out.tiles_failed;
  out.failures.push_back(what);
}

std::string gigabytes(std::uintmax_t bytes) {
  std::ostringstream text;
  text << std::setprecision(3) << 1e-9 * static_cast<double>(bytes) << " GB";
  return text.str();
}

/// Whether no file read from the tree refers to any content.
bool holds_nothing(const TilesetTree& tree) {
  const auto files = tree.files_read();
  return std::all_of(files.begin(), files.end(), [](const auto& file) {
    const std::vector<Tile>& tiles = file.second->tiles;
    return std::all_of(tiles.begin(), tiles.end(),
                       [](const Tile& tile) { return tile.contents.empty() && !tile.implicit_subtree; });
  });
}

/// Explains why a flight's images see no tile, and what to do.
std::string nothing_seen(const TilesetTree& tree, const Placement& placement, const std::vector<ViewCone>& cones) {
  geometry::Box3 flown;
  for (const ViewCone& cone : cones) flown.extend(cone.position);
  const geometry::Box3 tileset = local_bounding_box(tree.volume(tree.root()), placement.T_local_tileset);
  return "the flight sees nothing of the tileset: " + describe_separation(flown, tileset, placement.local_frame);
}

RefinementCriterion make_criterion(const Placement& placement, const LoadOptions& options, const ViewConeRange& part) {
  if (!options.flight) return region_criterion(placement.region, placement.T_local_tileset, options.error_m);
  return limit_refinement(
      flight_criterion(options.flight->view_cones, placement.T_local_tileset, options.flight->error_px, part),
      options.error_m);
}

bool is_partial_flight(const LoadOptions& options) {
  return options.flight &&
         (options.flight->part.begin > 0 || options.flight->part.end < options.flight->view_cones.size());
}

/// Selects the cut to read. The cut of a part keeps the name (hash) of the whole flight's cut.
TileCut select_flight_cut(TilesetTree& tree, const Placement& placement, const LoadOptions& options, LoadedTiles& out) {
  TileCut cut = select_cut(tree, make_criterion(placement, options, {}));
  out.cut_hash = cut.hash;
  out.cut_size = static_cast<std::int64_t>(cut.contents.size());
  return is_partial_flight(options) ? select_cut(tree, make_criterion(placement, options, options.flight->part)) : cut;
}

}  // namespace

LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress) {
  const std::unique_ptr<transport::TileSource> files = transport::open_source(source, options.source);
  return load_region(*files, transport::redact_source(source), options, progress);
}

LoadedTiles load_region(transport::TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress) {
  for (const transport::Use use : options.uses)
    transport::require_permitted(source.terms(), use, options.source.terms_accepted, name);
  transport::CountingSource counted(source);
  report_progress(progress, 0, 0, "reading the tileset");
  TilesetTree tree(counted);
  require_supported_extensions(tree.tileset(tree.root()), name);
  const Placement placement = resolve_placement(tree, options, name);
  LoadedTiles out;
  const TileCut cut = select_flight_cut(tree, placement, options, out);
  if (cut.contents.empty() && cut.failures.empty() && !is_partial_flight(options)) {
    if (holds_nothing(tree)) throw InputError(name, "the tileset is empty: none of its tiles has content");
    if (options.flight) throw InputError(name, nothing_seen(tree, placement, options.flight->view_cones));
    throw InputError(name, "no tile with content overlaps the region " + describe_extent(placement.region.box()) +
                               "; the tileset spans " + describe_extent(tree));
  }

  out.local_frame = placement.local_frame;
  out.region = placement.region;
  out.tiles_wanted = static_cast<std::int64_t>(cut.contents.size() + cut.failures.size());
  out.geometric_error_max_m = cut.geometric_error_max_m;
  out.warnings = placement.warnings;
  base::add_distinct(source.warnings(), out.warnings);
  for (const std::string& failure : cut.failures) fail(failure, options, out);

  tile_contents::AttributionCollector attribution;
  std::vector<LoadedContent> contents =
      read_cut(counted, tree, cut, placement.T_local_tileset, options.textures, progress, options.max_memory_bytes);
  if (contents.size() < cut.contents.size()) {
    throw MemoryLimitExceeded(name, "the requested tiles need more than " + gigabytes(options.max_memory_bytes) +
                                        " of memory: request a smaller region (--size) or coarser tiles (--error, "
                                        "--pixel-error), or raise the limit (--memory)");
  }
  for (LoadedContent& content : contents) {
    if (content.failure.empty()) {
      collect(std::move(content), out, attribution);
    } else {
      fail(content.failure, options, out);
    }
  }
  for (const auto& [uri, tileset] : tree.files_read()) attribution.add(tileset->copyright);
  base::add_distinct(tree.warnings(), out.warnings);
  base::add_distinct(source.warnings(), out.warnings);  // including warnings of the reads
  out.terms = source.terms();
  out.attribution = source.attribution();
  base::add_distinct(attribution.sorted_holders(), out.attribution);
  out.complete = out.tiles_failed == 0;
  out.bytes_read = counted.bytes();
  return out;
}

}  // namespace tileflight::tiles
