#include "tileflight/report/place_model.h"

#include <cmath>

#include "tileflight/tiling/coarser_surface.h"
#include "tileflight/tiling/mesh_source.h"
#include "tileflight/tiling/painted_surface.h"

namespace tileflight::report {
namespace {

/// Tiles that were rounded by themselves meet again within this.
constexpr double kJoin_m = 0.02;
/// How much of a sheet charts fill, of rectangles and the gaps between them.
constexpr double kSheetFill = 0.5;

geometry::TriangleMesh simplified_surface(const std::vector<imaging::TexturedMesh>& meshes, std::size_t triangles) {
  geometry::TriangleMesh surface = tiling::welded(meshes);
  if (surface.triangles.size() <= triangles) return surface;
  return tiling::coarser(tiling::borders_joined(surface, kJoin_m), triangles);
}

}  // namespace

PlaceModel read_place_model(const std::filesystem::path& mesh_glb, const PlaceModelOptions& options) {
  const tiling::MeshSource source = tiling::read_mesh_source(mesh_glb, {});
  PlaceModel model;
  std::vector<const imaging::TexturedMesh*> meshes;
  for (const imaging::TexturedMesh& mesh : source.meshes) {
    model.source_triangles += mesh.mesh.triangles.size();
    meshes.push_back(&mesh);
  }
  const geometry::TriangleMesh surface = simplified_surface(source.meshes, options.triangles);
  const double texels = kSheetFill * options.sheet_px * options.sheet_px;
  const double texel_m = std::sqrt(geometry::surface_area_m2(surface) / texels);
  model.mesh = tiling::painted(surface, tiling::SurfaceColors(meshes), {texel_m, options.sheet_px}).mesh;
  return model;
}

}  // namespace tileflight::report
