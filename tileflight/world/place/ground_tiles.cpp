#include "tileflight/world/place/ground_tiles.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/cut_reader.h"

namespace tileflight::place {
namespace {

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr double kFarthest_m = 1e8;  // of positions that may have a surface
constexpr double kMargin_m = 0.01;   // around a cell: more than the rounding of a scene's floats

/// A cell's column of space, with its margin.
Box3 column_of(std::int64_t column, std::int64_t row) {
  const Vec2 low = GroundTiles::kCell_m * Vec2(static_cast<double>(column), static_cast<double>(row));
  const Vec2 high = low + Vec2::Constant(GroundTiles::kCell_m);
  return {Vec3(low.x() - kMargin_m, low.y() - kMargin_m, -kFarthest_m),
          Vec3(high.x() + kMargin_m, high.y() + kMargin_m, kFarthest_m)};
}

/// The triangles that may reach into a column, without appearance; empty if there are none.
TexturedMesh triangles_in(const TexturedMesh& mesh, const Box3& column) {
  TexturedMesh kept;
  kept.name = mesh.name;
  std::unordered_map<std::uint32_t, std::uint32_t> number_of;
  for (const geometry::Triangle& triangle : mesh.mesh.triangles) {
    Box3 box;
    for (const std::uint32_t corner : triangle) box.extend(mesh.mesh.vertices[corner]);
    if (!box.intersects(column)) continue;
    geometry::Triangle renumbered = triangle;
    for (std::uint32_t& corner : renumbered) {
      const auto [known, is_new] = number_of.emplace(corner, static_cast<std::uint32_t>(kept.mesh.vertices.size()));
      if (is_new) kept.mesh.vertices.push_back(mesh.mesh.vertices[corner]);
      corner = known->second;
    }
    kept.mesh.triangles.push_back(renumbered);
  }
  return kept;
}

}  // namespace

GroundTiles::GroundTiles(const std::string& source, const tileset::LoadOptions& load, Progress progress)
    : name_(fetch::redact_source(source)),
      max_bytes_(load.max_memory_bytes / 2),
      progress_(std::move(progress)),
      source_(fetch::open_source(source, load.source)) {
  tileset::LoadOptions surface = load;
  surface.textures = false;
  reader_.emplace(*source_, name_, surface, progress_);
}

std::optional<double> GroundTiles::height(double x, double y, double below_z) {
  if (!(std::abs(x) < kFarthest_m && std::abs(y) < kFarthest_m)) return std::nullopt;
  const Cell& cell =
      cell_at({static_cast<std::int64_t>(std::floor(x / kCell_m)), static_cast<std::int64_t>(std::floor(y / kCell_m))});
  if (!cell.surface) return std::nullopt;
  const Box3& bounds = cell.surface->bounds();
  const double top_m = std::min(below_z, bounds.max().z() + 1.0);
  const double down_m = top_m - bounds.min().z() + 1.0;
  if (down_m <= 0.0) return std::nullopt;
  const auto hit = cell.surface->intersect({{x, y, top_m}, -Vec3::UnitZ()}, down_m);
  return hit ? std::optional(top_m - hit->distance_m) : std::nullopt;
}

const GroundTiles::Cell& GroundTiles::cell_at(const CellIndex& index) {
  auto found = cells_.find(index);
  if (found == cells_.end()) {
    make_room();
    found = cells_.emplace(index, read(index)).first;
  }
  found->second.used = ++asked_;
  return found->second;
}

/// A few of the contents, or as many as fit into memory, from the `next` on.
std::vector<tileset::LoadedContent> GroundTiles::read_some(const std::vector<std::size_t>& contents,
                                                           std::size_t& next) {
  constexpr std::size_t kAtOnce = 4;
  const std::size_t count = std::min(kAtOnce, contents.size() - next);
  const auto read = [&](std::size_t so_many) {
    const auto first = contents.begin() + static_cast<std::ptrdiff_t>(next);
    std::vector<tileset::LoadedContent> loaded =
        reader_->read({first, first + static_cast<std::ptrdiff_t>(so_many)}, progress_);
    next += so_many;
    read_count_ += static_cast<std::int64_t>(so_many);
    return loaded;
  };
  try {
    return read(count);
  } catch (const tileset::MemoryLimitExceeded&) {
    if (count == 1) throw;
    return read(1);
  }
}

/// Keeps only those triangles of the tiles that are above or below the cell.
GroundTiles::Cell GroundTiles::read(const CellIndex& index) {
  const Box3 column = column_of(index.first, index.second);
  const std::vector<std::size_t> contents = reader_->contents_in(column);
  std::vector<TexturedMesh> meshes;
  Cell cell;
  for (std::size_t next = 0; next < contents.size();) {
    for (const tileset::LoadedContent& content : read_some(contents, next)) {
      for (const TexturedMesh& mesh : content.meshes) {
        TexturedMesh kept = triangles_in(mesh, column);
        if (kept.mesh.triangles.empty()) continue;
        cell.bytes += tileset::memory_bytes(kept);
        meshes.push_back(std::move(kept));
      }
    }
    if (cell.bytes > max_bytes_)
      throw tileset::MemoryLimitExceeded(
          name_, base::formatted("the surface of %g m x %g m under an actor needs more than half of %.3g GB of memory: "
                                 "raise the limit (--memory) or request coarser tiles (--pixel-error, --error)",
                                 kCell_m, kCell_m, 2e-9 * static_cast<double>(max_bytes_)));
  }
  if (!meshes.empty()) cell.surface = std::make_unique<const scene::Scene>(std::move(meshes));
  return cell;
}

/// Releases cells that were not asked for lately, so that another as large as the largest is likely to fit.
void GroundTiles::make_room() {
  std::uintmax_t sum = 0, largest = 0;
  for (const auto& [index, cell] : cells_) {
    sum += cell.bytes;
    largest = std::max(largest, cell.bytes);
  }
  while (!cells_.empty() && sum + largest > max_bytes_) {
    const auto oldest = std::ranges::min_element(cells_, {}, [](const auto& one) { return one.second.used; });
    sum -= oldest->second.bytes;
    cells_.erase(oldest);
  }
}

}  // namespace tileflight::place
