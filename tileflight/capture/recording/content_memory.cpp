#include "tileflight/capture/recording/content_memory.h"

#include <algorithm>

#include "tileflight/capture/render/scene_memory.h"

namespace tileflight::recording {

std::vector<const imaging::RgbImage*> textures_of(const std::vector<imaging::TexturedMesh>& meshes) {
  std::vector<const imaging::RgbImage*> textures;
  for (const imaging::TexturedMesh& mesh : meshes) {
    if (mesh.texture && std::ranges::find(textures, mesh.texture.get()) == textures.end())
      textures.push_back(mesh.texture.get());
  }
  return textures;
}

ContentMemory memory_of(const std::vector<imaging::TexturedMesh>& meshes) {
  ContentMemory memory;
  for (const imaging::TexturedMesh& mesh : meshes) {
    memory.decoded_bytes += render::decoded_bytes(mesh);
    memory.rendered_bytes += render::rendered_bytes(mesh);
  }
  for (const imaging::RgbImage* texture : textures_of(meshes)) {
    memory.textures.push_back(
        {memory.textures.size(), texture->pixels.size() * sizeof(imaging::Rgb8), render::rendered_bytes(*texture)});
  }
  return memory;
}

std::uintmax_t MemorySum::bytes_of(const ContentMemory& content, std::size_t file, bool is_rendered) const {
  std::uintmax_t bytes = is_rendered ? content.rendered_bytes : content.decoded_bytes;
  for (const ContentMemory::Texture& texture : content.textures) {
    if (!textures_.contains({file, texture.number}))
      bytes += is_rendered ? texture.rendered_bytes : texture.decoded_bytes;
  }
  return bytes;
}

void MemorySum::add(const ContentMemory& content, std::size_t file, bool is_rendered) {
  bytes_ += bytes_of(content, file, is_rendered);
  for (const ContentMemory::Texture& texture : content.textures) textures_.emplace(file, texture.number);
}

}  // namespace tileflight::recording
