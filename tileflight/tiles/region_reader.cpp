#include "tileflight/tiles/region_reader.h"

#include <algorithm>
#include <iomanip>
#include <numeric>
#include <sstream>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/tile_contents/attribution.h"
#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/transport/uri.h"

namespace tileflight::tiles {
namespace {

std::string gigabytes(std::uintmax_t bytes) {
  std::ostringstream text;
  text << std::setprecision(3) << 1e-9 * static_cast<double>(bytes) << " GB";
  return text.str();
}

/// Whether no file read from the tree refers to any content.
bool holds_nothing(const TilesetTree& tree) {
  const auto& files = tree.files_read();
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

InputError incomplete(const std::string& what) {
  return {what, "the region is not complete (--allow-incomplete continues without this tile)"};
}

/// Extent of what a content holds.
geometry::Box3 bounds_of(const LoadedContent& content) {
  geometry::Box3 box;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    for (const geometry::Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  for (const geometry::PointCloud& cloud : content.clouds) {
    for (const geometry::Vec3& point : cloud.positions) box.extend(point);
  }
  return box;
}

transport::TileSource& require_terms(transport::TileSource& source, const std::string& name,
                                     const LoadOptions& options) {
  for (const transport::Use use : options.uses)
    transport::require_permitted(source.terms(), use, options.source.terms_accepted, name);
  return source;
}

}  // namespace

RegionReader::RegionReader(transport::TileSource& source, std::string name, const LoadOptions& options,
                           const Progress& progress)
    : source_(require_terms(source, name, options)),
      counted_(source),
      name_(std::move(name)),
      options_(options),
      tree_(counted_) {
  report_progress(progress, 0, 0, "reading the tileset");
  require_supported_extensions(tree_.tileset(tree_.root()), name_);
  placement_ = resolve_placement(tree_, options_, name_);
  select();
  require_contents();
  first_warnings_ = source_.warnings();
  if (!options_.allow_incomplete && !cut_.failures.empty()) throw incomplete(cut_.failures.front());
  for (const CutContent& content : cut_.contents) {
    const BoundingVolume volume =
        tree_.content_volume(content.node, content.content).value_or(tree_.volume(content.node));
    bounds_.push_back(local_bounding_box(volume, placement_.T_local_tileset));
  }
  records_.resize(cut_.contents.size());
}

/// Selects the cut to read. The cut of a part of a flight keeps the name (hash) of the whole flight's cut.
void RegionReader::select() {
  cut_ = select_cut(tree_, make_criterion(placement_, options_, {}));
  whole_cut_hash_ = cut_.hash;
  whole_cut_size_ = static_cast<std::int64_t>(cut_.contents.size());
  if (is_partial_flight(options_))
    cut_ = select_cut(tree_, make_criterion(placement_, options_, options_.flight->part));
}

void RegionReader::require_contents() const {
  if (!cut_.contents.empty() || !cut_.failures.empty() || is_partial_flight(options_)) return;
  if (holds_nothing(tree_)) throw InputError(name_, "the tileset is empty: none of its tiles has content");
  if (options_.flight) throw InputError(name_, nothing_seen(tree_, placement_, options_.flight->view_cones));
  throw InputError(name_, "no tile with content overlaps the region " + describe_extent(placement_.region.box()) +
                              "; the tileset spans " + describe_extent(tree_));
}

std::vector<std::size_t> RegionReader::contents_in(const geometry::Box3& box) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < bounds_.size(); ++i) {
    if (bounds_[i].intersects(box)) found.push_back(i);
  }
  return found;
}

std::vector<std::size_t> RegionReader::all_contents() const {
  std::vector<std::size_t> all(cut_.contents.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

std::optional<std::uintmax_t> RegionReader::file_bytes() const {
  if (!source_.knows_sizes()) return std::nullopt;
  std::unordered_set<std::string_view> uris;
  std::uintmax_t bytes = 0;
  for (const CutContent& content : cut_.contents) {
    if (!uris.insert(content.uri).second) continue;
    bytes += transport::is_data_uri(content.uri) ? content.uri.size() : source_.size(content.uri).value_or(0);
  }
  return bytes;
}

std::vector<LoadedContent> RegionReader::read(const std::vector<std::size_t>& contents, const Progress& progress) {
  TileCut part;
  for (const std::size_t i : contents) part.contents.push_back(cut_.contents[i]);
  std::vector<LoadedContent> loaded = read_cut(counted_, tree_, part, placement_.T_local_tileset, options_.textures,
                                               progress, options_.max_memory_bytes);
  if (loaded.size() < contents.size()) {
    throw MemoryLimitExceeded(name_, "the requested tiles need more than " + gigabytes(options_.max_memory_bytes) +
                                         " of memory: request a smaller region (--size) or coarser tiles (--error, "
                                         "--pixel-error), or raise the limit (--memory)");
  }
  for (std::size_t k = 0; k < contents.size(); ++k) record(contents[k], loaded[k]);
  std::erase_if(loaded, [](const LoadedContent& content) { return !content.failure.empty(); });
  return loaded;
}

void RegionReader::record(std::size_t content, const LoadedContent& loaded) {
  if (!loaded.failure.empty() && !options_.allow_incomplete) throw incomplete(loaded.failure);
  if (records_[content]) return;
  ContentRecord& record = records_[content].emplace();
  record.failure = loaded.failure;
  if (!loaded.failure.empty()) return;
  for (const imaging::TexturedMesh& mesh : loaded.meshes)
    record.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
  for (const geometry::PointCloud& cloud : loaded.clouds) record.points += static_cast<std::int64_t>(cloud.size());
  record.copyrights = loaded.copyrights;
  record.warnings = loaded.warnings;
  bounds_[content] = bounds_of(loaded);
}

LoadedTiles RegionReader::summary() const {
  LoadedTiles out;
  out.local_frame = placement_.local_frame;
  out.region = placement_.region;
  out.tiles_wanted = static_cast<std::int64_t>(cut_.contents.size() + cut_.failures.size());
  out.geometric_error_max_m = cut_.geometric_error_max_m;
  out.cut_hash = whole_cut_hash_;
  out.cut_size = whole_cut_size_;
  out.warnings = placement_.warnings;
  base::add_distinct(first_warnings_, out.warnings);
  out.failures = cut_.failures;
  tile_contents::AttributionCollector attribution;
  for (const std::optional<ContentRecord>& record : records_) {
    if (!record) continue;
    if (!record->failure.empty()) {
      out.failures.push_back(record->failure);
      continue;
    }
    ++out.tiles_loaded;
    out.triangles += record->triangles;
    out.points += record->points;
    for (const std::string& copyright : record->copyrights) attribution.add(copyright);
    base::add_distinct(record->warnings, out.warnings);
  }
  out.tiles_failed = static_cast<std::int64_t>(out.failures.size());
  for (const auto& [uri, tileset] : tree_.files_read()) attribution.add(tileset->copyright);
  base::add_distinct(tree_.warnings(), out.warnings);
  base::add_distinct(source_.warnings(), out.warnings);  // including warnings of the reads
  out.terms = source_.terms();
  out.attribution = source_.attribution();
  base::add_distinct(attribution.sorted_holders(), out.attribution);
  out.complete = out.tiles_failed == 0;
  out.bytes_read = counted_.bytes();
  return out;
}

}  // namespace tileflight::tiles
