#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {

/// Summary of a content that was read. It is kept when the meshes are released.
struct ContentRecord {
  std::int64_t triangles = 0, points = 0;
  geometry::Box3 bounds;  ///< local frame
  std::vector<std::string> copyrights, warnings;
  std::string failure;  ///< empty: the content was read
};

/// Returns the bounds that a content's volume, or else its tile's, states: local frame.
geometry::Box3 stated_bounds(const TilesetTree& tree, const CutContent& content, const geometry::SE3& T_local_tileset);

/// Returns by how much a content reaches out of its stated volume, both as boxes of one frame; 0 if no more than
/// rounding explains.
double overreach_m(const geometry::Box3& stated, const geometry::Box3& held);

/// Widens the tree's volumes (TilesetTree::volume_margin_m) by as much as the contents reach out of theirs, up to a
/// kilometre: by a sample that is spread over these contents, so that the result depends on the tileset and on what is
/// asked of it, but not on what else was read. Returns whether that changed them. Stated volumes are hints: selections
/// by views would miss what lies outside.
bool widen_to_contents(fetch::TileSource& source, TilesetTree& tree, const std::vector<CutContent>& contents,
                       const geometry::SE3& T_local_tileset);

/// Counts contents that hold surface outside of the volumes that their tiles state.
class StrayContents {
 public:
  /// Compares what a content holds with its volume, both in one frame. Each content counts once.
  void add(const std::string& uri, const geometry::Box3& stated, const geometry::Box3& held);
  /// Returns the warning that names them; nullopt if there is none.
  std::optional<std::string> warning() const;

 private:
  std::set<std::string> uris_;
  std::string worst_uri_;
  double worst_m_ = 0.0;
};

/// Summarizes a content.
ContentRecord make_record(const LoadedContent& content);

/// Converts a record to JSON.
nlohmann::json to_json(const ContentRecord& record);
/// Converts JSON to a record. Throws nlohmann::json::exception.
ContentRecord content_record_from_json(const nlohmann::json& record);

/// Returns the result of load_region() without meshes and clouds. `records`: one for each content of the cut, in its
/// order; nullopt: it was not read. `first_warnings`: warnings of the source before any content was read. `tree`,
/// `source`: those that the contents were read from.
LoadedTiles summarize(const Placement& placement, const TileCut& cut,
                      std::span<const std::optional<ContentRecord>> records,
                      const std::vector<std::string>& first_warnings, const TilesetTree& tree,
                      const fetch::TileSource& source);

/// Returns the error for a region that lacks a part (`what`) although LoadOptions::allow_incomplete is not set.
InputError incomplete_region(const std::string& what);

}  // namespace tileflight::tileset
