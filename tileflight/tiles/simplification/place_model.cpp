#include "tileflight/tiles/simplification/place_model.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/simplification/painted_surface.h"
#include "tileflight/tiles/simplification/surface_simplification.h"

namespace tileflight::simplification {
namespace {

/// Vertices of separately quantized tiles are merged within this distance.
constexpr double kJoin_m = 0.02;
/// Share of a texture atlas that charts fill (rectangles with gaps between them).
constexpr double kModelAtlasFill = 0.5;

geometry::TriangleMesh simplify_surface(const std::vector<imaging::TexturedMesh>& meshes, std::size_t triangles) {
  geometry::TriangleMesh surface = weld_vertices(meshes);
  if (surface.triangles.size() <= triangles) return surface;
  return simplify_to_count(join_borders(surface, kJoin_m), triangles);
}

}  // namespace

PlaceModel make_place_model(const std::vector<imaging::TexturedMesh>& source, const PlaceModelOptions& options) {
  PlaceModel model;
  std::vector<const imaging::TexturedMesh*> meshes;
  for (const imaging::TexturedMesh& mesh : source) {
    model.source_triangles += mesh.mesh.triangles.size();
    meshes.push_back(&mesh);
  }
  const geometry::TriangleMesh surface = simplify_surface(source, options.max_triangles);
  const double texels = kModelAtlasFill * options.texture_px * options.texture_px;
  const double texel_m = std::sqrt(geometry::surface_area_m2(surface) / texels);
  model.mesh = transfer_colors(surface, SurfaceColors(meshes), {texel_m, options.texture_px}).mesh;
  return model;
}

PlaceModel read_place_model(const std::vector<std::filesystem::path>& mesh_glbs, const PlaceModelOptions& options) {
  std::vector<imaging::TexturedMesh> source;
  for (const std::filesystem::path& file : mesh_glbs)
    std::ranges::move(mesh_files::read_mesh_source(file, {.defer_textures = true}).meshes, std::back_inserter(source));
  return make_place_model(source, options);
}

}  // namespace tileflight::simplification
