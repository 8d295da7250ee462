#include "tileflight/capture/render/scene_memory.h"

#include "tileflight/capture/render/appearance.h"

namespace tileflight::render {

std::uintmax_t decoded_bytes(const imaging::TexturedMesh& mesh) {
  return imaging::vertex_bytes(mesh) + mesh.mesh.triangles.size() * sizeof(mesh.mesh.triangles[0]);
}

std::uintmax_t rendered_bytes(const imaging::TexturedMesh& mesh) {
  constexpr std::uintmax_t kTreeBytes = 180;  // per triangle: both trees, with their copies of its corners
  return decoded_bytes(mesh) + mesh.mesh.triangles.size() * (kTreeBytes + sizeof(TriangleShading));
}

std::uintmax_t rendered_bytes(const imaging::RgbImage& texture) {
  return texture.pixels.size() * sizeof(imaging::Rgb8) * 7 / 3;  // image, copy, and a third of it
}

}  // namespace tileflight::render
