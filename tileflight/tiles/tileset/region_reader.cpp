#include "tileflight/tiles/tileset/region_reader.h"

#include <algorithm>
#include <iomanip>
#include <numeric>
#include <set>
#include <sstream>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/content_sample.h"

namespace tileflight::tileset {
namespace {

using geometry::Box3;
using geometry::Vec3;

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
  select();
  first_warnings_ = source_.warnings();
  if (!options_.allow_incomplete && !cut_.failures.empty()) throw incomplete_region(cut_.failures.front());
  constexpr double kEverywhere_m = 1e9;
  for (std::size_t i = 0; i < cut_.contents.size(); ++i) {
    const Box3 stated = stated_bounds(tree_, cut_.contents[i], placement_.T_local_tileset);
    const Vec3 unknown = is_outside_[i] ? Vec3(0.5, 0.5, kEverywhere_m) : Vec3(Vec3::Zero());
    bounds_.emplace_back(stated.min() - unknown, stated.max() + unknown);
  }
  records_.resize(cut_.contents.size());
  require_some_surface();
}

/// Selects the contents of the region by their volumes, and marks those above and below. The hash is of the former.
void RegionReader::select() {
  cut_ = select_cut(tree_, request_criterion(placement_, options_));
  is_outside_.assign(cut_.contents.size(), false);
  if (options_.flight) return require_contents(cut_, tree_, placement_, options_, name_);
  TileCut column;
  try {
    column =
        select_cut(tree_, region_criterion(column_of(placement_.region), placement_.T_local_tileset, options_.error_m));
  } catch (const TreeTooLarge&) {  // the region alone is not
    return;
  }
  std::set<std::pair<NodeId, std::size_t>> inside;
  for (const CutContent& content : cut_.contents) inside.emplace(content.node, content.content);
  if (column.contents.empty()) return require_contents(cut_, tree_, placement_, options_, name_);
  cut_.contents = std::move(column.contents);
  is_outside_.clear();
  for (const CutContent& content : cut_.contents)
    is_outside_.push_back(!inside.contains({content.node, content.content}));
}

/// Whether a content counts: by its volume, or by what it turned out to hold.
bool RegionReader::reaches_in(std::size_t content) const {
  if (!is_outside_[content]) return true;
  const std::optional<ContentRecord>& record = records_[content];
  return record && record->failure.empty() && record->bounds.intersects(placement_.region.box());
}

double RegionReader::estimated_count() const {
  std::size_t inside = 0, outside = 0, read = 0, held = 0;  // the last two are of those outside
  for (std::size_t i = 0; i < content_count(); ++i) {
    if (!is_outside_[i]) {
      ++inside;
      continue;
    }
    ++outside;
    if (!records_[i]) continue;
    ++read;
    if (reaches_in(i)) ++held;
  }
  const double share = read == 0 ? 0.0 : static_cast<double>(held) / static_cast<double>(read);
  return static_cast<double>(inside) + share * static_cast<double>(outside);
}

/// Throws InputError if all volumes lie outside of the region, and so does what some of the contents hold.
void RegionReader::require_some_surface() {
  constexpr std::size_t kMost = 64, kAtOnce = 8;
  if (!cut_.failures.empty() || std::ranges::find(is_outside_, false) != is_outside_.end()) return;
  const std::vector<std::size_t> probed = spread_sample(content_count(), kMost);
  for (std::size_t k = 0; k < probed.size(); k += kAtOnce) {
    const auto first = probed.begin() + static_cast<std::ptrdiff_t>(k);
    const std::vector<std::size_t> some(first,
                                        first + static_cast<std::ptrdiff_t>(std::min(kAtOnce, probed.size() - k)));
    learn_bounds(some, {});
    if (std::ranges::any_of(some, [&](std::size_t content) { return reaches_in(content); })) return;
  }
  cut_.contents.clear();
  require_contents(cut_, tree_, placement_, options_, name_);
}

/// Whether the request leaves the region's extent, or its heights, to the tileset.
bool RegionReader::is_open_region() const {
  const bool has_heights = options_.size && options_.size->z() > 0;
  return !options_.flight && options_.areas.empty() && !has_heights;
}

void RegionReader::settle_region(const Progress& progress) {
  constexpr std::size_t kAtOnce = 16;
  if (!is_open_region()) return;
  std::vector<std::size_t> some;
  for (std::size_t i = 0; i < content_count(); ++i) {
    if (!records_[i]) some.push_back(i);
    if (some.empty() || (some.size() < kAtOnce && i + 1 < content_count())) continue;
    learn_bounds(some, progress);
    some.clear();
  }
}

/// Reads contents for their records alone; with their textures, whose faults belong to these.
void RegionReader::learn_bounds(const std::vector<std::size_t>& contents, const Progress& progress) {
  TileCut part;
  for (const std::size_t i : contents) part.contents.push_back(cut_.contents[i]);
  const std::vector<LoadedContent> loaded = read_cut(counted_, tree_, part, placement_.T_local_tileset,
                                                     options_.textures, progress, options_.max_memory_bytes);
  for (std::size_t k = 0; k < loaded.size(); ++k) record(contents[k], loaded[k]);
}

/// Extends what the request leaves open to what a content holds.
void RegionReader::grow_region(const Box3& bounds) {
  constexpr double kRounding_m = 1e-8;
  const Box3 box = placement_.region.box();
  if (!is_open_region() || bounds.isEmpty() || box.contains(bounds)) return;
  Vec3 low = box.min(), high = box.max();
  const bool is_whole = !options_.center && !options_.center_local && !options_.size;
  for (int axis = is_whole ? 0 : 2; axis < 3; ++axis) {
    if (bounds.min()[axis] < low[axis]) low[axis] = bounds.min()[axis] - kRounding_m;
    if (bounds.max()[axis] > high[axis]) high[axis] = bounds.max()[axis] + kRounding_m;
  }
  if (!Box3(low, high).intersects(bounds) || (low == box.min() && high == box.max())) return;
  placement_.region.center = (low + high) / 2;
  placement_.region.size = high - low;
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
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contents.size(); ++k) {
    if (is_left_out(contents[k])) continue;
    if (kept != k) loaded[kept] = std::move(loaded[k]);
    ++kept;
  }
  loaded.resize(kept);
  return loaded;
}

void RegionReader::record(std::size_t content, const LoadedContent& loaded) {
  if (!loaded.failure.empty() && !options_.allow_incomplete && !is_outside_[content])
    throw incomplete_region(loaded.failure);
  if (!records_[content]) learn(content, make_record(loaded));
}

void RegionReader::learn(std::size_t content, const ContentRecord& record) {
  if (records_[content]) return;
  records_[content] = record;
  if (record.failure.empty() || is_outside_[content]) bounds_[content] = record.bounds;
  if (record.failure.empty()) grow_region(record.bounds);
}

LoadedTiles RegionReader::summary() const {
  TileCut counted = cut_;
  counted.contents.clear();
  std::vector<std::optional<ContentRecord>> records;
  for (std::size_t i = 0; i < content_count(); ++i) {
    if (!reaches_in(i)) continue;
    counted.contents.push_back(cut_.contents[i]);
    records.push_back(records_[i]);
  }
  LoadedTiles out = summarize(placement_, counted, records, first_warnings_, tree_, source_);
  out.bytes_read = counted_.bytes();
  return out;
}

}  // namespace tileflight::tileset
