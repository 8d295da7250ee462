#include "tileflight/tiles/load.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/attribution.h"
#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/tiles/tile_source.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

using imaging::TexturedMesh;

void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

/// Appends a content that was read to the result.
void collect(ReadContent&& content, LoadedTiles& out, Attribution& attribution) {
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
  add_distinct(content.warnings, out.warnings);
}

void fail(const std::string& what, const LoadOptions& options, LoadedTiles& out) {
  if (!options.allow_incomplete)
    throw InputError(what, "the region is not complete (--allow-incomplete goes on without)");
  ++out.tiles_failed;
  out.failures.push_back(what);
}

std::string gigabytes(std::uintmax_t bytes) {
  std::ostringstream text;
  text << std::setprecision(3) << 1e-9 * static_cast<double>(bytes) << " GB";
  return text.str();
}

/// Whether no file of the tree that was read names anything to be shown.
bool holds_nothing(const TilesetTree& tree) {
  const auto files = tree.files_read();
  return std::all_of(files.begin(), files.end(), [](const auto& file) {
    const std::vector<Tile>& tiles = file.second->tiles;
    return std::all_of(tiles.begin(), tiles.end(),
                       [](const Tile& tile) { return tile.contents.empty() && !tile.implicit; });
  });
}

/// Why a flight's pictures see no tile, and what to do.
std::string nothing_seen(const TilesetTree& tree, const Placement& placement, const std::vector<Eye>& eyes) {
  geometry::Box3 flown;
  for (const Eye& eye : eyes) flown.extend(eye.position);
  const geometry::Box3 tileset = bounds_local(tree.volume(tree.root()), placement.T_local_tileset);
  return "the flight sees nothing of the tileset: " + apart_text(flown, tileset, placement.local_frame);
}

Wanted wanted(const Placement& placement, const LoadOptions& options, const EyeRange& part) {
  if (!options.flight) return wanted_region(placement.region, placement.T_local_tileset, options.error_m);
  return no_finer_than(wanted_flight(options.flight->eyes, placement.T_local_tileset, options.flight->error_px, part),
                       options.error_m);
}

bool is_part(const LoadOptions& options) {
  return options.flight && (options.flight->part.begin > 0 || options.flight->part.end < options.flight->eyes.size());
}

/// The cut that is read. A part's goes by the name of the whole flight's.
TileCut cut_of(TilesetTree& tree, const Placement& placement, const LoadOptions& options, LoadedTiles& out) {
  TileCut cut = select_cut(tree, wanted(placement, options, {}));
  out.cut_hash = cut.hash;
  out.cut_size = static_cast<std::int64_t>(cut.contents.size());
  return is_part(options) ? select_cut(tree, wanted(placement, options, options.flight->part)) : cut;
}

}  // namespace

LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress) {
  const std::unique_ptr<TileSource> files = open_source(source, options.source);
  return load_region(*files, shown_source(source), options, progress);
}

LoadedTiles load_region(TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress) {
  for (const Use use : options.uses) require_permitted(source.terms(), use, options.source.terms_accepted, name);
  CountingSource counted(source);
  report_progress(progress, 0, 0, "reading the tileset");
  TilesetTree tree(counted);
  require_supported_extensions(tree.tileset(tree.root()), name);
  const Placement placement = place(tree, options, name);
  LoadedTiles out;
  const TileCut cut = cut_of(tree, placement, options, out);
  if (cut.contents.empty() && cut.failures.empty() && !is_part(options)) {
    if (holds_nothing(tree)) throw InputError(name, "the tileset holds nothing: none of its tiles has a content");
    if (options.flight) throw InputError(name, nothing_seen(tree, placement, options.flight->eyes));
    throw InputError(name, "no tile with content meets the region " + extent_text(placement.region.box()) +
                               "; the tileset spans " + extent_text(tree));
  }

  out.local_frame = placement.local_frame;
  out.region = placement.region;
  out.tiles_wanted = static_cast<std::int64_t>(cut.contents.size() + cut.failures.size());
  out.geometric_error_max_m = cut.geometric_error_max_m;
  out.warnings = placement.warnings;
  add_distinct(source.warnings(), out.warnings);
  for (const std::string& failure : cut.failures) fail(failure, options, out);

  Attribution attribution;
  std::vector<ReadContent> contents =
      read_cut(counted, tree, cut, placement.T_local_tileset, options.textures, progress, options.max_memory_bytes);
  if (contents.size() < cut.contents.size()) {
    throw MemoryExceeded(name, "what is wanted needs more than " + gigabytes(options.max_memory_bytes) +
                                   " of memory: ask for less (--size), for coarser tiles (--error, --pixel-error), or "
                                   "allow more (--memory)");
  }
  for (ReadContent& content : contents) {
    if (content.failure.empty()) {
      collect(std::move(content), out, attribution);
    } else {
      fail(content.failure, options, out);
    }
  }
  for (const auto& [uri, tileset] : tree.files_read()) attribution.add(tileset->copyright);
  add_distinct(tree.warnings(), out.warnings);
  add_distinct(source.warnings(), out.warnings);  // of reading, too
  out.terms = source.terms();
  out.attribution = source.attribution();
  add_distinct(attribution.sorted(), out.attribution);
  out.complete = out.tiles_failed == 0;
  out.bytes_read = counted.bytes();
  return out;
}

}  // namespace tileflight::tiles
