#include "tileflight/tiles/tileset/region_reader.h"

#include <algorithm>
#include <iomanip>
#include <numeric>
#include <sstream>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tileset/bounding_volume.h"

namespace tileflight::tileset {
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

/// Extent of what a content holds.
fetch::TileSource& require_terms(fetch::TileSource& source, const std::string& name, const LoadOptions& options) {
  for (const fetch::Use use : options.uses)
    fetch::require_permitted(source.terms(), use, options.source.terms_accepted, name);
  return source;
}

}  // namespace

RefinementCriterion request_criterion(const Placement& placement, const LoadOptions& options) {
  if (!options.flight) return region_criterion(placement.region, placement.T_local_tileset, options.error_m);
  return limit_refinement(
      flight_criterion(options.flight->view_cones, placement.T_local_tileset, options.flight->error_px),
      options.error_m);
}

void require_contents(const TileCut& cut, const TilesetTree& tree, const Placement& placement,
                      const LoadOptions& options, const std::string& name) {
  if (!cut.contents.empty() || !cut.failures.empty()) return;
  if (holds_nothing(tree)) throw InputError(name, "the tileset is empty: none of its tiles has content");
  if (options.flight) throw InputError(name, nothing_seen(tree, placement, options.flight->view_cones));
  throw InputError(name, "no tile with content overlaps the region " + describe_extent(placement.region.box()) +
                             "; the tileset spans " + describe_extent(tree));
}

RegionReader::RegionReader(fetch::TileSource& source, std::string name, const LoadOptions& options,
                           const Progress& progress)
    : source_(require_terms(source, name, options)),
      counted_(source),
      name_(std::move(name)),
      options_(options),
      tree_(counted_) {
  report_progress(progress, 0, 0, "reading the tileset");
  require_supported_extensions(tree_.tileset(tree_.root()), name_);
  placement_ = resolve_placement(tree_, options_, name_);
  cut_ = select_cut(tree_, request_criterion(placement_, options_));
  require_contents(cut_, tree_, placement_, options_, name_);
  first_warnings_ = source_.warnings();
  if (!options_.allow_incomplete && !cut_.failures.empty()) throw incomplete_region(cut_.failures.front());
  for (const CutContent& content : cut_.contents) {
    const BoundingVolume volume =
        tree_.content_volume(content.node, content.content).value_or(tree_.volume(content.node));
    bounds_.push_back(local_bounding_box(volume, placement_.T_local_tileset));
  }
  records_.resize(cut_.contents.size());
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
    bytes += fetch::is_data_uri(content.uri) ? content.uri.size() : source_.size(content.uri).value_or(0);
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
  if (!loaded.failure.empty() && !options_.allow_incomplete) throw incomplete_region(loaded.failure);
  if (records_[content]) return;
  records_[content] = make_record(loaded);
  if (loaded.failure.empty()) bounds_[content] = records_[content]->bounds;
}

void RegionReader::learn(std::size_t content, const ContentRecord& record) {
  if (records_[content]) return;
  records_[content] = record;
  if (record.failure.empty()) bounds_[content] = record.bounds;
}

LoadedTiles RegionReader::summary() const {
  LoadedTiles out = summarize(placement_, cut_, records_, first_warnings_, tree_, source_);
  out.bytes_read = counted_.bytes();
  return out;
}

}  // namespace tileflight::tileset
