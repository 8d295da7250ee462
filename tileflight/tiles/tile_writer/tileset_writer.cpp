#include "tileflight/tiles/tile_writer/tileset_writer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/core/imaging/rectangle_packing.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/texture_filter.h"
#include "tileflight/tiles/tile_writer/tileset_json.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Box3;
using geometry::Vec3;
using imaging::RgbImage;
using imaging::TexturedMesh;

constexpr int kGutter_px = 2;

RgbImage small_image(const TexturedMesh& mesh, int halvings) {
  if (!mesh.texture) {
    const auto byte = [&](std::size_t c) {
      return static_cast<std::uint8_t>(std::lround(255.0F * mesh.base_color[c]));
    };
    return RgbImage(2, 2, {byte(0), byte(1), byte(2)});
  }
  const auto scaled_length = [&](int length) { return std::max(1, (length + (1 << halvings) - 1) >> halvings); };
  return resize_area(*mesh.texture, scaled_length(mesh.texture->width), scaled_length(mesh.texture->height));
}

/// Copies an image to (x, y) with its edge repeated around it.
void place(const RgbImage& image, imaging::PixelPosition at, RgbImage& sheet) {
  for (int row = -kGutter_px; row < image.height + kGutter_px; ++row) {
    const imaging::Rgb8* from = image.row(std::clamp(row, 0, image.height - 1));
    imaging::Rgb8* to = sheet.row(at.y + kGutter_px + row) + at.x;
    std::fill_n(to, kGutter_px, from[0]);
    std::copy_n(from, image.width, to + kGutter_px);
    std::fill_n(to + kGutter_px + image.width, kGutter_px, from[image.width - 1]);
  }
}

void add_mesh(const TexturedMesh& mesh, imaging::PixelPosition at, const RgbImage& image, const RgbImage& sheet,
              TexturedMesh& out) {
  const auto first = static_cast<std::uint32_t>(out.mesh.vertices.size());
  out.mesh.vertices.insert(out.mesh.vertices.end(), mesh.mesh.vertices.begin(), mesh.mesh.vertices.end());
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    out.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  const Eigen::Vector2f low(static_cast<float>(at.x + kGutter_px), static_cast<float>(at.y + kGutter_px));
  const Eigen::Vector2f size(static_cast<float>(image.width), static_cast<float>(image.height));
  const Eigen::Vector2f whole(static_cast<float>(sheet.width), static_cast<float>(sheet.height));
  for (std::size_t i = 0; i < mesh.mesh.vertices.size(); ++i) {
    const Eigen::Vector2f uv = mesh.uv.empty() ? Eigen::Vector2f(0.5F, 0.5F) : mesh.uv[i];
    out.uv.emplace_back((low + uv.cwiseProduct(size)).cwiseQuotient(whole));
  }
}

/// Merges the meshes into one with one texture: their images reduced by a factor of `2^halvings`, side by side with
/// repeated edges. Texture coordinates must lie in 0..1. Meshes without texture take their base colour. The result is
/// empty if no mesh has triangles.
TexturedMesh merge_into_atlas(const std::vector<const TexturedMesh*>& meshes, int halvings) {
  std::vector<const TexturedMesh*> used;
  for (const TexturedMesh* mesh : meshes)
    if (!mesh->mesh.triangles.empty()) used.push_back(mesh);
  TexturedMesh out;
  out.wrap_u = out.wrap_v = imaging::Wrap::kClampToEdge;
  if (used.empty()) return out;
  std::vector<RgbImage> images;
  std::vector<imaging::PixelSize> sizes;
  for (const TexturedMesh* mesh : used) {
    images.push_back(small_image(*mesh, halvings));
    sizes.push_back({images.back().width + 2 * kGutter_px, images.back().height + 2 * kGutter_px});
  }
  const imaging::RectanglePacking packing = imaging::pack_rectangles(sizes);
  const auto sheet = std::make_shared<RgbImage>(packing.size.width, packing.size.height);
  for (std::size_t i = 0; i < used.size(); ++i) {
    place(images[i], packing.positions[i], *sheet);
    add_mesh(*used[i], packing.positions[i], images[i], *sheet, out);
  }
  out.texture = sheet;
  return out;
}

/// A cell of the quadtree: level 0 is the root; x, y count cells from the south-west.
struct TileId {
  int level = 0, x = 0, y = 0;
  friend auto operator<=>(const TileId&, const TileId&) = default;

  TileId parent() const { return {level - 1, x / 2, y / 2}; }
  std::string uri() const {
    return "tiles/" + std::to_string(level) + "-" + std::to_string(x) + "-" + std::to_string(y) + ".glb";
  }
};

struct Tile {
  std::vector<std::size_t> meshes;  ///< indices into the input, in input order
  Box3 content;
};

using Tree = std::map<TileId, Tile>;

Box3 box_of(const TexturedMesh& mesh) {
  Box3 box;
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    for (const std::uint32_t corner : t) box.extend(mesh.mesh.vertices[corner]);
  return box;
}

/// Assigns the meshes to the tiles of each level.
Tree make_tree(const std::vector<TexturedMesh>& meshes, int depth) {
  std::vector<Box3> boxes;
  Box3 all;
  for (const TexturedMesh& mesh : meshes) all.extend(boxes.emplace_back(box_of(mesh)));
  const double edge_m = std::max(all.sizes().x(), all.sizes().y());
  const Vec3 low = all.center() - Vec3::Constant(edge_m / 2);
  const int leaves = 1 << depth;
  const auto cell = [&](double place_m) {
    return edge_m > 0 ? std::clamp(static_cast<int>(place_m / edge_m * leaves), 0, leaves - 1) : 0;
  };
  Tree tree;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (boxes[i].isEmpty()) continue;
    const Vec3 middle = boxes[i].center() - low;
    for (TileId id{depth, cell(middle.x()), cell(middle.y())}; id.level >= 0; id = id.parent())
      tree[id].meshes.push_back(i);
  }
  return tree;
}

/// The finest meshes, and the simplified meshes for each coarser level of the tree.
struct Levels {
  std::vector<std::vector<TexturedMesh>> coarse;  ///< levels from the root, without the finest
  const std::vector<TexturedMesh>& finest;

  const std::vector<TexturedMesh>& at(int level) const {
    return level < static_cast<int>(coarse.size()) ? coarse[static_cast<std::size_t>(level)] : finest;
  }
  int depth() const { return static_cast<int>(coarse.size()); }
};

Levels simplify_levels(const std::vector<TexturedMesh>& meshes, const TilesetOptions& options) {
  Levels levels{std::vector<std::vector<TexturedMesh>>(options.level_errors_m.size()), meshes};
  tbb::parallel_for(std::size_t{0}, levels.coarse.size(), [&](std::size_t i) {
    levels.coarse[i] = simplification::simplify_meshes(meshes, options.level_errors_m[i]);
  });
  return levels;
}

/// Measured errors, monotone: not smaller at a coarser level than at a finer one (3D Tiles 1.1, section 7.3).
std::vector<double> measure_errors(const Levels& levels) {
  const geometry::TriangleMesh finest = simplification::merge_meshes(levels.finest);
  std::vector<double> errors_m(levels.coarse.size() + 1, 0.0);
  for (int level = levels.depth() - 1; level >= 0; --level) {
    const auto i = static_cast<std::size_t>(level);
    errors_m[i] = std::max(
        errors_m[i + 1], simplification::hausdorff_distance_m(simplification::merge_meshes(levels.coarse[i]), finest));
  }
  return errors_m;
}

std::vector<TexturedMesh> tile_content(const Tile& tile, const TileId& id, const Levels& levels) {
  std::vector<TexturedMesh> content;
  std::vector<const TexturedMesh*> parts;
  for (const std::size_t i : tile.meshes) parts.push_back(&levels.at(id.level)[i]);
  if (id.level < levels.depth()) {
    content.push_back(merge_into_atlas(parts, levels.depth() - id.level));
  } else {
    for (const TexturedMesh* part : parts) content.push_back(*part);
  }
  return content;
}

struct Written {
  std::int64_t bytes = 0, triangles = 0, texels = 0;
};

Written write_tile(const std::filesystem::path& folder, const TileId& id, Tile& tile, const Levels& levels,
                   const TilesetOptions& options) {
  const std::vector<TexturedMesh> content = tile_content(tile, id, levels);
  const std::string glb = imaging::write_glb(content, {options.jpeg_quality, options.copyright});
  base::write_file(folder / id.uri(), glb);
  Written written{static_cast<std::int64_t>(glb.size()), 0, 0};
  for (const TexturedMesh& mesh : content) {
    tile.content.extend(box_of(mesh));
    written.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
    if (mesh.texture) written.texels += static_cast<std::int64_t>(mesh.texture->pixels.size());
  }
  return written;
}

TileEntry entry_of(const TileId& id, const Tree& tree, const std::vector<double>& errors_m) {
  TileEntry out{id.uri(), tree.at(id).content, errors_m[static_cast<std::size_t>(id.level)], {}};
  for (int child = 0; child < 4; ++child) {
    const TileId child_id{id.level + 1, 2 * id.x + child % 2, 2 * id.y + child / 2};
    if (tree.contains(child_id)) out.children.push_back(entry_of(child_id, tree, errors_m));
  }
  return out;
}

}  // namespace

TilesetSummary write_tileset(const std::filesystem::path& folder, const std::vector<TexturedMesh>& meshes,
                             const TilesetOptions& options, const Progress& progress) {
  Tree tree = make_tree(meshes, static_cast<int>(options.level_errors_m.size()));
  if (tree.empty()) throw InputError(folder.string(), "there is no triangle to write");
  const auto total = static_cast<std::int64_t>(tree.size());
  report_progress(progress, 0, total, "simplifying");
  const Levels levels = simplify_levels(meshes, options);
  const std::vector<double> errors_m = measure_errors(levels);
  std::filesystem::create_directories(folder / "tiles");
  std::vector<std::pair<TileId, Tile*>> order;
  for (auto& [id, tile] : tree) order.emplace_back(id, &tile);
  std::vector<Written> written(order.size());
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t i) {
    written[i] = write_tile(folder, order[i].first, *order[i].second, levels, options);
    const std::lock_guard lock(mutex);
    report_progress(progress, ++done, total, "writing tiles");
  });
  TileEntry root = entry_of({}, tree, errors_m);
  compute_bounds(root);
  const std::string text = tileset_json(root, options.T_ecef_local);
  base::write_file(folder / "tileset.json", text);
  TilesetSummary summary{std::vector<TilesetLevel>(errors_m.size()), static_cast<std::int64_t>(text.size())};
  for (std::size_t i = 0; i < errors_m.size(); ++i) summary.levels[i].geometric_error_m = errors_m[i];
  for (std::size_t i = 0; i < order.size(); ++i) {
    TilesetLevel& level = summary.levels[static_cast<std::size_t>(order[i].first.level)];
    ++level.tiles;
    level.triangles += written[i].triangles;
    level.texels += written[i].texels;
    summary.bytes += written[i].bytes;
  }
  return summary;
}

}  // namespace tileflight::tile_writer
