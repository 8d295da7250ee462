#include "tileflight/tiles/tileset/inspect.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_document.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/attribution.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/shared_image_cache.h"
#include "tileflight/tiles/tileset/content_records.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {
namespace {

/// Numbers of a part of the tree. They are estimates, and not whole, if files were not opened.
struct TreeTally {
  double tiles = 0, with_content = 0, leaves = 0, replace = 0, add = 0, unsupported = 0, finest = 0;
  std::map<std::string, double> contents;
  std::vector<double> level_tiles;
  double files = 0, files_missing = 0, file_bytes = 0, finest_bytes = 0;  ///< distinct files only

  /// Adds another part that stands for `weight` like it; each of its files for `file_weight`.
  void add_part(const TreeTally& part, double weight, double file_weight) {
    tiles += weight * part.tiles;
    with_content += weight * part.with_content;
    leaves += weight * part.leaves;
    replace += weight * part.replace;
    add += weight * part.add;
    unsupported += weight * part.unsupported;
    finest += weight * part.finest;
    for (const auto& [kind, count] : part.contents) contents[kind] += weight * count;
    if (level_tiles.size() < part.level_tiles.size()) level_tiles.resize(part.level_tiles.size());
    for (std::size_t i = 0; i < part.level_tiles.size(); ++i) level_tiles[i] += weight * part.level_tiles[i];
    files += file_weight * part.files;
    files_missing += file_weight * part.files_missing;
    file_bytes += file_weight * part.file_bytes;
    finest_bytes += file_weight * part.finest_bytes;
  }
};

/// An external tileset or subtree that a file refers to.
struct Reference {
  TilesetTree::NestedFile file;
  std::size_t level = 0;               ///< level of its root
  double weight = 1.0;                 ///< how many such references it stands for
  double file_weight = 1.0;            ///< how many such files
  std::optional<std::size_t> group{};  ///< which of the references of the first generation that was sampled led to it
};

/// Traverses a tree, including external tilesets, one generation of nested files after the other: all references of the
/// files of a generation, or a sample of them that is spread evenly (Knuth, "Estimating the efficiency of backtrack
/// programs", Mathematics of Computation 29 (1975): each visited node stands for its siblings that are not).
class TilesetInspector {
 public:
  TilesetInspector(fetch::TileSource& source, const InspectLimits& limits, const Progress& progress)
      : source_(source), limits_(limits), progress_(progress), tree_(source) {}

  TilesetSummary run() {
    const Tileset& root = tree_.tileset(tree_.root());
    out_.version = root.version;
    out_.generator = root.generator;
    out_.geometric_error_m = root.geometric_error_m;
    out_.content_sizes_known = source_.knows_sizes();
    describe_location();
    std::vector<Reference> references;
    all_.add_part(walk(tree_.root(), {}, references), 1.0, 1.0);
    while (!references.empty()) references = open(references);
    describe_counts();
    describe_files();
    probe_contents();
    if (const auto line = stray_.warning()) base::add_distinct({*line}, out_.warnings);
    if (has_plain_ && !has_textured_) out_.warnings.emplace_back(kNoTextures);
    return std::move(out_);
  }

 private:
  void describe_location() {
    out_.georeferenced = is_georeferenced(tree_);
    const BoundingVolume volume = tree_.volume(tree_.root());
    geometry::SE3 T_local_tileset = out_.georeferenced ? geometry::SE3() : T_own_tileset(tree_);
    if (out_.georeferenced) {
      out_.center = geometry::geodetic_from_ecef(center_of(volume));
      T_local_tileset = geometry::LocalFrame(*out_.center).T_local_ecef();
    }
    out_.bounds_local = local_bounding_box(volume, T_local_tileset);
  }

  /// Opens the references of a generation, or some of them; returns the next generation.
  std::vector<Reference> open(const std::vector<Reference>& references) {
    const std::vector<std::size_t> chosen = spread_sample(references.size(), count_to_open(references.size()));
    if (tree_.is_high_latency()) {
      std::vector<TilesetTree::NestedFile> files;
      for (const std::size_t index : chosen) files.push_back(references[index].file);
      tree_.read_nested_files(files);
    }
    struct Opened {
      const Reference* reference;
      TreeTally tally;
      std::vector<Reference> below;
    };
    std::vector<Opened> opened;
    std::set<std::string> distinct;
    for (const std::size_t index : chosen) {
      if (!may_go_on(opened.size())) break;
      opened.push_back({&references[index], {}, {}});
      distinct.insert(uri_of(references[index]));
      if (const auto root = root_of(references[index]))
        opened.back().tally = walk(*root, references[index], opened.back().below);
    }
    out_.nested_files += static_cast<std::int64_t>(references.size());
    out_.nested_files_opened += static_cast<std::int64_t>(opened.size());
    const bool is_sampled = opened.size() < references.size();
    const double stands_for = static_cast<double>(references.size()) / static_cast<double>(opened.size());
    const double file_stands_for =
        is_sampled ? static_cast<double>(count_distinct(references)) / static_cast<double>(distinct.size()) : 1.0;
    if (is_sampled && !out_.is_estimate) {
      out_.is_estimate = true;
      finest_of_group_.resize(opened.size());
      groups_stand_for_ = stands_for;
    }
    std::vector<Reference> next;
    for (std::size_t i = 0; i < opened.size(); ++i) {
      const Reference& reference = *opened[i].reference;
      const double weight = reference.weight * stands_for;
      all_.add_part(opened[i].tally, weight, reference.file_weight * file_stands_for);
      std::optional<std::size_t> group = reference.group;
      if (out_.is_estimate && !group && is_sampled) group = i;
      if (group && *group < finest_of_group_.size()) finest_of_group_[*group] += weight * opened[i].tally.finest;
      for (Reference& below : opened[i].below) {
        below.weight = weight;
        below.file_weight = reference.file_weight * file_stands_for;
        below.group = group;
        next.push_back(below);
      }
    }
    return next;
  }

  /// A generation of few files is opened whole, and of each generation at least a few.
  std::size_t count_to_open(std::size_t references) const {
    constexpr std::size_t kFewest = 16;
    if (limits_.all) return references;
    const auto opened = static_cast<std::size_t>(out_.nested_files_opened);
    return std::min(references,
                    std::max(kFewest, limits_.max_nested_files - std::min(limits_.max_nested_files, opened)));
  }

  bool may_go_on(std::size_t opened) const {
    constexpr std::size_t kFewest = 4;
    return limits_.all || opened < kFewest || tiles_walked_ < limits_.max_tiles;
  }

  std::string uri_of(const Reference& reference) const {
    const auto& [node, content] = reference.file;
    return content ? tree_.content_uri(node, *content) : tree_.name(node);
  }

  std::size_t count_distinct(const std::vector<Reference>& references) const {
    std::vector<std::size_t> hashes;
    for (const Reference& reference : references) hashes.push_back(std::hash<std::string>{}(uri_of(reference)));
    std::sort(hashes.begin(), hashes.end());
    return static_cast<std::size_t>(std::unique(hashes.begin(), hashes.end()) - hashes.begin());
  }

  /// nullopt, and a failure, if it cannot be read.
  std::optional<NodeId> root_of(const Reference& reference) {
    const auto& [node, content] = reference.file;
    try {
      if (content) return tree_.external_root(node, *content);
      const NodeId root = tree_.implicit_root(node);
      ++out_.subtrees;
      return root;
    } catch (const TreeTooLarge&) {
      throw;
    } catch (const InputError& error) {
      out_.failures.push_back(tree_.name(node) + ": " + error.what());
      return std::nullopt;
    }
  }

  /// Counts the tiles of one file, and lists its references to others.
  TreeTally walk(NodeId root, const Reference& from, std::vector<Reference>& references) {
    TreeTally tally;
    std::vector<std::pair<NodeId, std::size_t>> pending = {{root, from.level}};
    while (!pending.empty()) {
      const auto [id, level] = pending.back();
      pending.pop_back();
      const std::shared_ptr<const Tile> tile = read_tile(id);
      if (tile == nullptr) continue;
      if (tile->implicit_subtree) {
        references.push_back({.file = {id, std::nullopt}, .level = level});
        continue;
      }
      count_tile(id, *tile, level, tally);
      for (const NodeId child : tree_.children(id)) pending.emplace_back(child, level + 1);
      for (std::size_t content = 0; content < tile->contents.size(); ++content) {
        if (is_nested(id, content, *tile, tally)) references.push_back({.file = {id, content}, .level = level + 1});
      }
      if (++tiles_walked_ % 4096 == 0)
        report_progress(progress_, static_cast<std::int64_t>(tiles_walked_), 0, "reading the tree");
    }
    return tally;
  }

  std::shared_ptr<const Tile> read_tile(NodeId id) {
    try {
      return tree_.tile(id);
    } catch (const InputError& error) {
      out_.failures.push_back(tree_.name(id) + ": " + error.what());
      return nullptr;
    }
  }

  void count_tile(NodeId id, const Tile& tile, std::size_t level, TreeTally& tally) {
    const double error_m = tree_.geometric_error_m(id);
    ++tally.tiles;
    if (!tile.contents.empty()) ++tally.with_content;
    if (!tile.unsupported.empty()) ++tally.unsupported;
    if (tile.children.empty()) ++tally.leaves;
    if (!tile.children.empty()) ++(tree_.node(id).refine == Refine::kAdd ? tally.add : tally.replace);
    if (out_.levels.size() <= level) out_.levels.resize(level + 1, {0, error_m, error_m});
    LevelSummary& summary = out_.levels[level];
    summary.geometric_error_min_m = std::min(summary.geometric_error_min_m, error_m);
    summary.geometric_error_max_m = std::max(summary.geometric_error_max_m, error_m);
    if (tally.level_tiles.size() <= level) tally.level_tiles.resize(level + 1);
    ++tally.level_tiles[level];
  }

  /// Counts a content; whether it is an external tileset.
  bool is_nested(NodeId id, std::size_t content, const Tile& tile, TreeTally& tally) {
    try {
      if (tree_.is_external_tileset(id, content)) {
        ++tally.contents["tileset"];
        return true;
      }
    } catch (const InputError& error) {
      out_.failures.push_back(tree_.name(id) + ": " + error.what());
      return false;
    }
    const std::string uri = tree_.content_uri(id, content);
    const std::string ending = fetch::uri_extension(uri);
    ++tally.contents[ending.empty() ? "unknown" : ending];
    const bool is_finest = tile.children.empty() || tree_.node(id).refine == Refine::kAdd;
    tally.finest += is_finest ? 1.0 : 0.0;
    const auto [known, is_new] = content_uris_.insert(uri);
    if (!is_new) return false;
    contents_in_order_.push_back(&*known);
    if (is_finest) {
      finest_.emplace(*known, id);
      finest_in_order_.push_back(&*known);
    }
    count_file(uri, is_finest, tally);
    return false;
  }

  void count_file(const std::string& uri, bool is_finest, TreeTally& tally) {
    ++tally.files;
    if (!out_.content_sizes_known || fetch::is_data_uri(uri)) return;
    const std::optional<std::uintmax_t> bytes = source_.size(uri);
    if (!bytes) ++tally.files_missing;
    tally.file_bytes += static_cast<double>(bytes.value_or(0));
    if (is_finest) tally.finest_bytes += static_cast<double>(bytes.value_or(0));
  }

  void describe_counts() {
    const auto whole = [](double number) { return static_cast<std::int64_t>(std::llround(number)); };
    out_.tiles = whole(all_.tiles);
    out_.tiles_with_content = whole(all_.with_content);
    out_.leaves = whole(all_.leaves);
    out_.tiles_replace = whole(all_.replace);
    out_.tiles_add = whole(all_.add);
    out_.tiles_unsupported = whole(all_.unsupported);
    for (const auto& [kind, count] : all_.contents) out_.contents[kind] = whole(count);
    for (const char* kind : {"vctr", "geom", "terrain", "geojson"}) {
      const auto found = out_.contents.find(kind);
      if (found == out_.contents.end() || found->second == 0) continue;
      base::add_distinct(std::vector{std::to_string(found->second) + " contents are of the kind " + kind +
                                     ", which is not read: their tiles show nothing"},
                         out_.warnings);
    }
    for (std::size_t i = 0; i < all_.level_tiles.size(); ++i) out_.levels[i].tiles = whole(all_.level_tiles[i]);
    out_.content_files = whole(all_.files);
    if (out_.content_sizes_known) {
      out_.content_files_missing = whole(all_.files_missing);
      out_.content_bytes = whole(all_.file_bytes);
    }
    out_.finest_contents = whole(all_.finest);
    out_.finest_bytes = whole(all_.finest_bytes);
    if (!out_.is_estimate || !(all_.finest > 0.0)) return;
    const auto opened = static_cast<double>(finest_of_group_.size());
    const SampleMean mean = sample_mean(finest_of_group_, opened * groups_stand_for_);
    out_.count_spread = 2.0 * opened * mean.standard_error / all_.finest;
  }

  void describe_files() {
    tile_content::AttributionCollector attribution;
    for (const auto& [uri, tileset] : tree_.files_read()) {
      attribution.add(tileset->copyright);
      base::add_distinct(tileset->extensions_used, out_.extensions_used);
      base::add_distinct(tileset->extensions_required, out_.extensions_required);
      base::add_distinct(unsupported_extensions(*tileset), out_.extensions_unsupported);
    }
    base::add_distinct(source_.warnings(), out_.warnings);
    base::add_distinct(tree_.warnings(), out_.warnings);
    out_.external_tilesets = static_cast<std::int64_t>(tree_.files_read().size()) - 1;
    for (const std::string& uri : sample_of_contents()) add_copyrights(uri, attribution);
    out_.attribution = source_.attribution();
    base::add_distinct(attribution.sorted_holders(), out_.attribution);
  }

  /// Contents to read for attribution: up to 64 local files, or 5 from a server; none if the provider itself states
  /// whom to credit.
  std::vector<std::string> sample_of_contents() {
    constexpr std::size_t kOfFiles = 64, kOfServer = 5;
    constexpr std::uintmax_t kLargest_bytes = 64 << 20;
    const bool is_here = source_.knows_sizes();
    if (!is_here && !source_.attribution().empty()) return {};
    const std::size_t all = contents_in_order_.size(), wanted = std::min(all, is_here ? kOfFiles : kOfServer);
    std::vector<std::string> sample;
    for (std::size_t i = 0; i < wanted; ++i) {
      const std::string& uri = *contents_in_order_[i * all / wanted];
      if (!is_here || fetch::is_data_uri(uri) || source_.size(uri).value_or(kLargest_bytes + 1) <= kLargest_bytes)
        sample.push_back(uri);
    }
    return sample;
  }

  void add_copyrights(const std::string& uri, tile_content::AttributionCollector& attribution) {
    try {
      const std::vector<std::byte> bytes = fetch::read_uri(source_, uri);
      for (const std::string& copyright : tile_content::find_copyrights(bytes)) attribution.add(copyright);
      ++out_.contents_read;
      if (!source_.knows_sizes()) probe(uri, bytes);  // not to be fetched again
    } catch (const InputError&) {                     // reported to the caller that loads the tile
    }
  }

  /// Decodes some contents of the finest cut of a local source.
  void probe_contents() {
    constexpr std::size_t kProbes = 40;
    constexpr std::uintmax_t kLargest_bytes = 64 << 20;
    if (!source_.knows_sizes()) return;
    for (const std::size_t index : spread_sample(finest_in_order_.size(), kProbes)) {
      report_progress(progress_, static_cast<std::int64_t>(out_.probes.size()), 0, "reading some tiles");
      const std::string& uri = *finest_in_order_[index];
      if (source_.size(uri).value_or(0) > kLargest_bytes) continue;
      try {
        probe(uri, fetch::read_uri(source_, uri));
      } catch (const InputError&) {  // reported to the caller that loads the tile
      }
    }
  }

  /// Measures a content if it is of the finest cut. Throws InputError if it cannot be decoded.
  void probe(const std::string& uri, const std::vector<std::byte>& bytes) {
    const auto node = finest_.find(uri);
    if (node == finest_.end()) return;
    tile_content::SharedImageCache images(source_);
    tile_content::ContentOptions options;
    options.read_resource = [&](const std::string& resource) {
      return fetch::read_uri(source_, fetch::resolve_reference(source_, uri, resource));
    };
    options.read_image = [&](const std::string& image) {
      return images.read(fetch::resolve_reference(source_, uri, image), options.limits.max_texture_pixels);
    };
    const tile_content::DecodedContent decoded =
        tile_content::decode_content(bytes, fetch::uri_for_message(uri), options);
    base::add_distinct(decoded.warnings, out_.warnings);
    for (const imaging::TexturedMesh& mesh : decoded.meshes) {
      (mesh.texture || !mesh.colors.empty() ? has_textured_ : has_plain_) = true;
    }
    ContentMeasures measures = measure_content(decoded.meshes, decoded.clouds);
    measures.file_bytes = static_cast<double>(bytes.size());
    const geometry::Mat3 linear = tree_.T_tileset_tile(node->second).topLeftCorner<3, 3>();
    measures.area_m2 *= std::pow(std::abs(linear.determinant()), 2.0 / 3.0);
    out_.probes.push_back(measures);
    compare_with_volume(uri, node->second, decoded);
  }

  /// Compares in the frame at the volume's centre, where boxes along the axes are tight.
  void compare_with_volume(const std::string& uri, NodeId node, const tile_content::DecodedContent& decoded) {
    const BoundingVolume volume = tree_.volume(node);
    geometry::SE3 T_local_tileset;
    if (is_georeferenced(tree_))
      T_local_tileset = geometry::LocalFrame(geometry::geodetic_from_ecef(center_of(volume))).T_local_ecef();
    const geometry::Mat4 T_local_tile = T_local_tileset.matrix() * tree_.T_tileset_tile(node);
    geometry::Box3 held;
    const auto add = [&](const geometry::Vec3& p) { held.extend((T_local_tile * p.homogeneous()).head<3>()); };
    for (const imaging::TexturedMesh& mesh : decoded.meshes) std::ranges::for_each(mesh.mesh.vertices, add);
    for (const geometry::PointCloud& cloud : decoded.clouds) std::ranges::for_each(cloud.positions, add);
    stray_.add(uri, local_bounding_box(volume, T_local_tileset), held);
  }

  fetch::TileSource& source_;
  InspectLimits limits_;
  const Progress& progress_;
  TilesetTree tree_;
  TilesetSummary out_;
  TreeTally all_;
  std::size_t tiles_walked_ = 0;
  bool has_textured_ = false,
       has_plain_ = false;  ///< whether a probed tile has surfaces with texture or colours, or not
  /// Contents of the finest cut below each reference of the first generation that was sampled, and how many references
  /// each of these stands for.
  std::vector<double> finest_of_group_;
  double groups_stand_for_ = 1.0;
  StrayContents stray_;
  std::unordered_set<std::string> content_uris_;
  std::vector<const std::string*> contents_in_order_;
  std::unordered_map<std::string_view, NodeId> finest_;  ///< contents of the finest cut, and a tile of each
  std::vector<const std::string*> finest_in_order_;
};

}  // namespace

TilesetSummary inspect_tileset(fetch::TileSource& source, const InspectLimits& limits, const Progress& progress) {
  return TilesetInspector(source, limits, progress).run();
}

TilesetSummary inspect_tileset(const std::string& source, const fetch::SourceOptions& options,
                               const InspectLimits& limits, const Progress& progress) {
  const std::unique_ptr<fetch::TileSource> files = fetch::open_source(source, options);
  return inspect_tileset(*files, limits, progress);
}

}  // namespace tileflight::tileset
