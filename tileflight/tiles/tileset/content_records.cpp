#include "tileflight/tiles/tileset/content_records.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/attribution.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/content_sample.h"

namespace tileflight::tileset {
namespace {

using nlohmann::json;

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

geometry::Vec3 corner_from_json(const json& v) {
  return {v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>()};
}

/// Adds what the contents that were read say.
void add_records(std::span<const std::optional<ContentRecord>> records, tile_content::AttributionCollector& attribution,
                 LoadedTiles& to) {
  for (const std::optional<ContentRecord>& record : records) {
    if (!record) continue;
    if (!record->failure.empty()) {
      to.failures.push_back(record->failure);
      continue;
    }
    ++to.tiles_loaded;
    to.triangles += record->triangles;
    to.points += record->points;
    for (const std::string& copyright : record->copyrights) attribution.add(copyright);
    base::add_distinct(record->warnings, to.warnings);
  }
}

}  // namespace

geometry::Box3 stated_bounds(const TilesetTree& tree, const CutContent& content, const geometry::SE3& T_local_tileset) {
  return local_bounding_box(tree.stated_volume(content.node, content.content), T_local_tileset);
}

double overreach_m(const geometry::Box3& stated, const geometry::Box3& held) {
  constexpr double kRounding_m = 1e-4, kRoundingShare = 1e-5;
  if (stated.isEmpty() || held.isEmpty()) return 0.0;
  const double out_m = std::max((stated.min() - held.min()).maxCoeff(), (held.max() - stated.max()).maxCoeff());
  return out_m < kRounding_m + kRoundingShare * stated.sizes().norm() ? 0.0 : out_m;
}

bool widen_to_contents(fetch::TileSource& source, TilesetTree& tree, const std::vector<CutContent>& contents,
                       const geometry::SE3& T_local_tileset) {
  constexpr std::size_t kMostRead = 32, kAtOnce = 8;
  constexpr double kMost_m = 1000.0;
  const std::vector<std::size_t> sample = spread_sample(contents.size(), kMostRead);
  double margin_m = 0.0;
  for (std::size_t first = 0; first < sample.size(); first += kAtOnce) {
    TileCut some;
    for (std::size_t k = first; k < std::min(sample.size(), first + kAtOnce); ++k)
      some.contents.push_back(contents[sample[k]]);
    const std::vector<LoadedContent> loaded = read_cut(source, tree, some, T_local_tileset, false);
    for (std::size_t k = 0; k < loaded.size(); ++k) {
      const geometry::Box3 stated = stated_bounds(tree, some.contents[k], T_local_tileset);
      margin_m = std::max(margin_m, overreach_m(stated, bounds_of(loaded[k])));
    }
  }
  margin_m = std::min(margin_m, kMost_m);
  if (margin_m <= tree.volume_margin_m()) return false;
  tree.set_volume_margin(margin_m);
  return true;
}

void StrayContents::add(const std::string& uri, const geometry::Box3& stated, const geometry::Box3& held) {
  const double out_m = overreach_m(stated, held);
  if (out_m == 0.0) return;
  uris_.insert(uri);
  if (out_m <= worst_m_) return;
  worst_m_ = out_m;
  worst_uri_ = uri;
}

std::optional<std::string> StrayContents::warning() const {
  if (uris_.empty()) return std::nullopt;
  return base::formatted(
      "tiles that hold surface outside of the bounding volumes that the tileset states for them: %zu of those read, by "
      "up to "
      "%.3g m (%s): what was read counts where it lies, and images select tiles by volumes that are widened by what a "
      "sample of them holds",
      uris_.size(), worst_m_, fetch::uri_for_message(worst_uri_).c_str());
}

ContentRecord make_record(const LoadedContent& content) {
  ContentRecord record;
  record.failure = content.failure;
  if (!content.failure.empty()) return record;
  for (const imaging::TexturedMesh& mesh : content.meshes)
    record.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
  for (const geometry::PointCloud& cloud : content.clouds) record.points += static_cast<std::int64_t>(cloud.size());
  record.bounds = bounds_of(content);
  record.copyrights = content.copyrights;
  record.warnings = content.warnings;
  return record;
}

json to_json(const ContentRecord& record) {
  return {{"triangles", record.triangles},
          {"points", record.points},
          {"low", geometry::json_numbers(record.bounds.min())},
          {"high", geometry::json_numbers(record.bounds.max())},
          {"copyrights", record.copyrights},
          {"warnings", record.warnings},
          {"failure", record.failure}};
}

ContentRecord content_record_from_json(const json& record) {
  return {.triangles = record.at("triangles").get<std::int64_t>(),
          .points = record.at("points").get<std::int64_t>(),
          .bounds = {corner_from_json(record.at("low")), corner_from_json(record.at("high"))},
          .copyrights = record.at("copyrights").get<std::vector<std::string>>(),
          .warnings = record.at("warnings").get<std::vector<std::string>>(),
          .failure = record.at("failure").get<std::string>()};
}

LoadedTiles summarize(const Placement& placement, const TileCut& cut,
                      std::span<const std::optional<ContentRecord>> records,
                      const std::vector<std::string>& first_warnings, const TilesetTree& tree,
                      const fetch::TileSource& source) {
  LoadedTiles out;
  out.local_frame = placement.local_frame;
  out.region = placement.region;
  out.tiles_wanted = static_cast<std::int64_t>(cut.contents.size() + cut.failures.size());
  out.geometric_error_max_m = cut.geometric_error_max_m;
  out.cut_hash = cut.hash;
  out.cut_size = static_cast<std::int64_t>(cut.contents.size());
  out.warnings = placement.warnings;
  base::add_distinct(first_warnings, out.warnings);
  out.failures = cut.failures;
  tile_content::AttributionCollector attribution;
  add_records(records, attribution, out);
  out.tiles_failed = static_cast<std::int64_t>(out.failures.size());
  StrayContents stray;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (records[i] && records[i]->failure.empty())
      stray.add(cut.contents[i].uri, stated_bounds(tree, cut.contents[i], placement.T_local_tileset),
                records[i]->bounds);
  }
  if (const auto line = stray.warning()) base::add_distinct({*line}, out.warnings);
  for (const auto& [uri, tileset] : tree.files_read()) attribution.add(tileset->copyright);
  base::add_distinct(tree.warnings(), out.warnings);
  base::add_distinct(source.warnings(), out.warnings);  // including warnings of the reads
  out.terms = source.terms();
  out.attribution = source.attribution();
  base::add_distinct(attribution.sorted_holders(), out.attribution);
  out.complete = out.tiles_failed == 0;
  return out;
}

InputError incomplete_region(const std::string& what) {
  return {what, "the region is not complete (--allow-incomplete continues without this tile)"};
}

}  // namespace tileflight::tileset
