#include "tileflight/world/place/place_reader.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/cut_reader.h"

namespace tileflight::place {

void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source,
                     const std::vector<std::string>& failures) {
  const auto has_triangle = [](const imaging::TexturedMesh& mesh) { return !mesh.mesh.triangles.empty(); };
  if (std::ranges::any_of(meshes, has_triangle)) return;
  if (has_points)
    throw InputError(source,
                     "contains only points there, which cannot be rendered; `extract` can turn them into voxels");
  if (!failures.empty()) {
    throw InputError(failures.front(), "nothing else is there to see: " + std::to_string(failures.size()) +
                                           " of the tiles of " + source + " could not be read");
  }
  throw InputError(source, "contains no triangle there; is the region empty?");
}

std::vector<imaging::TexturedMesh> with_placeholder(std::vector<imaging::TexturedMesh> meshes) {
  if (!meshes.empty()) return meshes;
  imaging::TexturedMesh nothing;
  nothing.mesh.vertices.assign(3, geometry::Vec3::Zero());
  nothing.mesh.triangles.push_back({0, 1, 2});
  return {nothing};
}

namespace {

std::uintmax_t memory_of(const PlacePart& part) {
  std::uintmax_t bytes = 0;
  std::set<const void*> textures;
  for (const imaging::TexturedMesh& mesh : part.meshes) {
    bytes += tileset::memory_bytes(mesh);
    if (mesh.texture && textures.insert(mesh.texture.get()).second)
      bytes += mesh.texture->pixels.size() * sizeof(mesh.texture->pixels[0]);
  }
  for (const geometry::PointCloud& cloud : part.clouds) bytes += cloud.size() * sizeof(cloud.positions[0]);
  return bytes;
}

/// Throws InputError, before anything is read, if the source's terms forbid the use.
std::unique_ptr<fetch::TileSource> require_permitted_source(std::unique_ptr<fetch::TileSource> source, fetch::Use use,
                                                            const tileset::LoadOptions& load, const std::string& name) {
  fetch::require_permitted(source->terms(), use, load.source.terms_accepted, name);
  return source;
}

}  // namespace

PlaceReader::PlaceReader(const std::string& source, const tileset::LoadOptions& load, fetch::Use use)
    : name_(fetch::redact_source(source)),
      source_(require_permitted_source(fetch::open_source(source, load.source), use, load, name_)),
      tree_(*source_) {
  tileset::require_supported_extensions(tree_.tileset(tree_.root()), name_);
  placement_ = tileset::resolve_placement(tree_, load, name_);
  is_georeferenced_ = tileset::is_georeferenced(tree_);
}

std::optional<PlacePart> PlaceReader::read(const tileset::TileCut& cut, bool textures, std::uintmax_t max_memory_bytes,
                                           const Progress& progress) {
  std::vector<tileset::LoadedContent> contents =
      tileset::read_cut(*source_, tree_, cut, placement_.T_local_tileset, textures, progress, max_memory_bytes);
  if (contents.size() < cut.contents.size()) return std::nullopt;
  PlacePart part;
  for (const std::string& failure : cut.failures) part.missing.push_back({failure, std::nullopt});
  failures_.insert(cut.failures.begin(), cut.failures.end());
  for (std::size_t i = 0; i < contents.size(); ++i) {
    tileset::LoadedContent& content = contents[i];
    if (!content.failure.empty()) {
      failures_.insert(content.failure);
      const tileset::BoundingVolume volume = tree_.volume(cut.contents[i].node);
      part.missing.push_back({content.failure, tileset::local_bounding_box(volume, placement_.T_local_tileset)});
      continue;
    }
    ++part.tiles;
    part.file_bytes += static_cast<std::uintmax_t>(content.bytes);
    const tileset::ContentRecord record = tileset::make_record(content);
    stray_.add(cut.contents[i].uri, tileset::stated_bounds(tree_, cut.contents[i], placement_.T_local_tileset),
               record.bounds);
    for (imaging::TexturedMesh& mesh : content.meshes) {
      if (!mesh.mesh.triangles.empty()) part.meshes.push_back(std::move(mesh));
    }
    std::move(content.clouds.begin(), content.clouds.end(), std::back_inserter(part.clouds));
    for (const std::string& copyright : content.copyrights) copyrights_.add(copyright);
    base::add_distinct(content.warnings, warnings_);
  }
  part.memory_bytes = memory_of(part);
  return part;
}

bool PlaceReader::widen_to_contents(const std::vector<tileset::CutContent>& contents) {
  return tileset::widen_to_contents(*source_, tree_, contents, placement_.T_local_tileset);
}

bool PlaceReader::lacks_textures(const std::vector<tileset::CutContent>& contents) {
  return tileset::lacks_textures(*source_, tree_, contents, placement_.T_local_tileset);
}

std::vector<std::string> PlaceReader::attribution() const {
  tile_content::AttributionCollector all = copyrights_;
  for (const auto& [uri, tileset] : tree_.files_read()) all.add(tileset->copyright);
  std::vector<std::string> names = source_->attribution();
  base::add_distinct(all.sorted_holders(), names);
  return names;
}

std::vector<std::string> PlaceReader::warnings() const {
  std::vector<std::string> all = placement_.warnings;
  base::add_distinct(source_->warnings(), all);
  base::add_distinct(tree_.warnings(), all);
  base::add_distinct(warnings_, all);
  if (const auto line = stray_.warning()) base::add_distinct({*line}, all);
  return all;
}

tileset::RefinementCriterion restrict_to_box(tileset::RefinementCriterion criterion, const geometry::Box3& box,
                                             const geometry::SE3& T_local_tileset) {
  criterion.intersects = [inner = std::move(criterion.intersects), box,
                          T_local_tileset](const tileset::BoundingVolume& volume) {
    return tileset::intersects(volume, T_local_tileset, box) && inner(volume);
  };
  return criterion;
}

std::string source_display_name(const std::string& source) {
  const std::string shown = fetch::redact_source(source);
  std::filesystem::path path(shown.substr(0, shown.find('?')));  // strip a URL's parameters
  if (!fetch::is_network_source(source)) path = std::filesystem::absolute(path).lexically_normal();
  const auto go_up_from = [&path](const std::string& last) {
    if (path.filename() == last && path.parent_path().has_filename()) path = path.parent_path();
  };
  go_up_from("");
  go_up_from("tileset.json");
  const std::string name = path.filename().string();
  return name.empty() ? shown : name;
}

}  // namespace tileflight::place
