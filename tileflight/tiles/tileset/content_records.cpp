#include "tileflight/tiles/tileset/content_records.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/tiles/tile_content/attribution.h"

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
