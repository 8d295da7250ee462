#include "tileflight/capture/preview/coverage_contents.h"

#include <algorithm>
#include <limits>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::preview {
namespace {

// Shares of the memory limit. The rest is for the pixels of frames, cells and pictures.
constexpr std::uintmax_t kKeptDivisor = 2;   ///< contents kept
constexpr std::uintmax_t kSceneDivisor = 4;  ///< one scene
constexpr std::uintmax_t kBatchDivisor = 8;  ///< contents read at once

constexpr std::size_t kFirstBatch = 16, kLargestBatch = 512;

ContentFacts facts_of(const tileset::LoadedContent& content) {
  ContentFacts facts{.bytes = content.bytes, .bounds = {}, .has_points = !content.clouds.empty()};
  std::size_t decoded = 0, working = 0;
  std::set<const void*> textures;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    decoded += mesh.mesh.vertices.size() * sizeof(mesh.mesh.vertices[0]) + mesh.colors.size() * sizeof(mesh.colors[0]);
    decoded += mesh.mesh.triangles.size() * sizeof(mesh.mesh.triangles[0]) + mesh.uv.size() * sizeof(mesh.uv[0]);
    working += tileset::memory_bytes(mesh);
    if (mesh.texture && textures.insert(mesh.texture.get()).second) {
      decoded += mesh.texture->pixels.size() * sizeof(mesh.texture->pixels[0]);
      working += mesh.texture->pixels.size() * sizeof(mesh.texture->pixels[0]);
    }
    if (mesh.mesh.triangles.empty()) continue;
    for (const geometry::Vec3& vertex : mesh.mesh.vertices) facts.bounds.extend(vertex);
  }
  facts.decoded_bytes = static_cast<std::int64_t>(decoded);
  facts.working_bytes = working;
  return facts;
}

}  // namespace

CoverageContents::CoverageContents(fetch::TileSource& source, tileset::TilesetTree& tree,
                                   const geometry::SE3& T_local_tileset, std::uintmax_t max_memory_bytes)
    : source_(source),
      tree_(tree),
      T_local_tileset_(T_local_tileset),
      max_memory_bytes_(max_memory_bytes),
      kept_limit_bytes_(max_memory_bytes / kKeptDivisor) {}

void CoverageContents::reserve(std::uintmax_t bytes) {
  const std::uintmax_t share = max_memory_bytes_ / kKeptDivisor;
  kept_limit_bytes_ = share - std::min(share, bytes);
  for (std::size_t id = kept_.size(); id-- > 0 && kept_bytes_ > kept_limit_bytes_;) {
    if (!kept_[id]) continue;
    kept_bytes_ -= static_cast<std::uintmax_t>(facts_[id].decoded_bytes);
    kept_[id].reset();
  }
}

ContentIds CoverageContents::add(const tileset::TileCut& cut) {
  ContentIds ids;
  for (const tileset::CutContent& content : cut.contents) {
    const auto [found, is_new] =
        id_of_.try_emplace({content.node, content.content}, static_cast<std::uint32_t>(all_.contents.size()));
    if (is_new) all_.contents.push_back(content);
    ids.push_back(found->second);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

std::vector<tileset::LoadedContent> CoverageContents::read(const ContentIds& ids, bool textures,
                                                           std::uintmax_t max_bytes) {
  tileset::TileCut part;
  for (const std::uint32_t id : ids) part.contents.push_back(all_.contents[id]);
  return tileset::read_cut(source_, tree_, part, T_local_tileset_, textures, {}, max_bytes);
}

void CoverageContents::read_all(bool allow_incomplete,
                                const std::function<void(std::uint32_t, const tileset::LoadedContent&)>& visit,
                                const Progress& progress) {
  facts_.resize(size());
  kept_.resize(size());
  const std::uintmax_t batch_bytes = max_memory_bytes_ / kBatchDivisor;
  std::uintmax_t read_bytes = 0;
  for (std::size_t begin = 0, count = kFirstBatch; begin < size();) {
    count = std::min(count, size() - begin);
    ContentIds ids;
    for (std::size_t i = 0; i < count; ++i) ids.push_back(static_cast<std::uint32_t>(begin + i));
    std::vector<tileset::LoadedContent> batch = read(ids, true, count > 1 ? batch_bytes : max_memory_bytes_ / 2);
    if (batch.size() < count) {
      if (count == 1) {
        throw tileset::MemoryLimitExceeded(all_.contents[begin].uri,
                                           "this tile needs more than half of the memory limit: raise it (--memory)");
      }
      count = (count + 1) / 2;
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (!batch[i].failure.empty() && !allow_incomplete)
        throw InputError(batch[i].failure, "this tile is needed (--allow-incomplete continues without it)");
      visit(ids[i], batch[i]);
      record(ids[i], std::move(batch[i]));
      read_bytes += facts_[ids[i]].working_bytes;
    }
    begin += count;
    report_progress(progress, static_cast<std::int64_t>(begin), static_cast<std::int64_t>(size()), "reading tiles");
    const std::uintmax_t mean_bytes = std::max<std::uintmax_t>(1, read_bytes / begin);
    count = std::clamp<std::size_t>(batch_bytes / (2 * mean_bytes), 1, kLargestBatch);
  }
}

/// Contents are kept in the order in which they are read: later passes read in the same order, so that what was used
/// last is needed last.
void CoverageContents::record(std::uint32_t id, tileset::LoadedContent content) {
  facts_[id] = facts_of(content);
  const auto bytes = static_cast<std::uintmax_t>(facts_[id].decoded_bytes);
  if (kept_bytes_ + bytes > kept_limit_bytes_) return;
  kept_bytes_ += bytes;
  kept_[id] = std::move(content);
}

std::vector<ContentIds> CoverageContents::scene_groups(const ContentIds& ids) const {
  std::vector<ContentIds> groups;
  std::uintmax_t bytes = 0;
  for (const std::uint32_t id : ids) {
    if (facts_[id].bounds.isEmpty()) continue;
    bytes += facts_[id].working_bytes;
    if (groups.empty() || bytes > max_memory_bytes_ / kSceneDivisor) {
      groups.emplace_back();
      bytes = facts_[id].working_bytes;
    }
    groups.back().push_back(id);
  }
  return groups;
}

CoverageContents::OwnedMeshes CoverageContents::meshes(const ContentIds& ids, bool textures) {
  ContentIds dropped;
  for (const std::uint32_t id : ids) {
    if (!kept_[id]) dropped.push_back(id);
  }
  std::vector<tileset::LoadedContent> read_again = read(dropped, textures, std::numeric_limits<std::uintmax_t>::max());
  OwnedMeshes out;
  std::size_t next = 0;
  for (const std::uint32_t id : ids) {
    std::vector<imaging::TexturedMesh> meshes = kept_[id] ? kept_[id]->meshes : std::move(read_again[next++].meshes);
    for (imaging::TexturedMesh& mesh : meshes) {
      if (mesh.mesh.triangles.empty()) continue;
      out.meshes.push_back(std::move(mesh));
      out.content_of_mesh.push_back(id);
    }
  }
  return out;
}

geometry::Box3 CoverageContents::bounds(const ContentIds& ids) const {
  geometry::Box3 box;
  for (const std::uint32_t id : ids) box.extend(facts_[id].bounds);
  return box;
}

}  // namespace tileflight::preview
