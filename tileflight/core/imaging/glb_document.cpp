#include "tileflight/core/imaging/glb_document.h"

#include <algorithm>
#include <utility>

namespace tileflight::imaging {
namespace {

int gltf_wrap(Wrap wrap) {
  if (wrap == Wrap::kRepeat) return kGltfRepeat;
  return wrap == Wrap::kClampToEdge ? kGltfClampToEdge : kGltfMirroredRepeat;
}

void append_u32(std::size_t value, std::string& out) {
  for (unsigned shift = 0; shift < 32; shift += 8) out.push_back(static_cast<char>(value >> shift & 0xffU));
}

}  // namespace

GlbDocument::GlbDocument(const EncodedImages& images, bool writes_defaults)
    : images_(images), writes_defaults_(writes_defaults) {
  json["asset"] = {{"version", "2.0"}, {"generator", "tileflight"}};
  json["extensionsUsed"] = {"KHR_materials_unlit"};
  json["scene"] = 0;
  json["scenes"] = nlohmann::json::array({{{"nodes", {0}}}});
}

std::size_t GlbDocument::add(const char* list, nlohmann::json item) {
  nlohmann::json& array = json[list];
  array.push_back(std::move(item));
  return array.size() - 1;
}

std::size_t GlbDocument::add_part(std::size_t bytes, Append append) {
  parts_.push_back({bytes_ + glb_padding(bytes_), bytes, std::move(append)});
  bytes_ = parts_.back().offset + bytes;
  return parts_.back().offset;
}

std::size_t GlbDocument::add_view(std::size_t bytes, Append append, int target) {
  const std::size_t offset = add_part(bytes, std::move(append));
  nlohmann::json view{{"buffer", 0}, {"byteLength", bytes}};
  if (writes_defaults_ || offset > 0) view["byteOffset"] = offset;
  if (target != 0) view["target"] = target;
  return add("bufferViews", std::move(view));
}

std::size_t GlbDocument::add_accessor(std::size_t view, int component_type, const char* type, std::size_t count,
                                      bool normalized) {
  nlohmann::json accessor{{"bufferView", view}, {"componentType", component_type}, {"type", type}, {"count", count}};
  if (normalized) accessor["normalized"] = true;
  return add("accessors", std::move(accessor));
}

std::size_t GlbDocument::add_material(const TexturedMesh& mesh) {
  nlohmann::json pbr{{"metallicFactor", 0.0}};
  if (writes_defaults_) pbr["roughnessFactor"] = 1.0;
  if (writes_defaults_ || mesh.base_color != std::array{1.0F, 1.0F, 1.0F, 1.0F})
    pbr["baseColorFactor"] = mesh.base_color;
  if (images_.contains(mesh.texture.get())) pbr["baseColorTexture"] = {{"index", add_texture(mesh)}};
  return add("materials", {{"pbrMetallicRoughness", pbr},
                           {"doubleSided", true},
                           {"extensions", {{"KHR_materials_unlit", nlohmann::json::object()}}}});
}

/// Adds an image once, however many meshes share it.
std::size_t GlbDocument::add_texture(const TexturedMesh& mesh) {
  const auto [image, is_new] = image_index_.try_emplace(mesh.texture.get(), image_index_.size());
  if (is_new) {
    const std::vector<std::byte>& jpeg = images_.at(mesh.texture.get());
    const auto append = [&jpeg](std::size_t begin, std::size_t end, std::string& out) {
      out.append(reinterpret_cast<const char*>(jpeg.data()) + begin, end - begin);
    };
    add("images", {{"bufferView", add_view(jpeg.size(), append, 0)}, {"mimeType", "image/jpeg"}});
  }
  const std::size_t sampler = add("samplers", {{"magFilter", kGltfLinear},
                                               {"minFilter", kGltfLinearMipmapLinear},
                                               {"wrapS", gltf_wrap(mesh.wrap_u)},
                                               {"wrapT", gltf_wrap(mesh.wrap_v)}});
  return add("textures", {{"source", image->second}, {"sampler", sampler}});
}

/// Container of glTF 2.0, section 4: header, JSON chunk padded with blanks, binary chunk padded with zeros.
std::string GlbDocument::head() const {
  std::string text = json.dump();
  text.append(glb_padding(text.size()), ' ');
  const std::size_t binary = bytes_ + glb_padding(bytes_);
  std::string out("glTF");
  append_u32(2, out);
  append_u32(12 + 8 + text.size() + 8 + binary, out);
  append_u32(text.size(), out);
  out += "JSON" + text;
  append_u32(binary, out);
  return out.append("BIN\0", 4);
}

std::string_view GlbStream::next() {
  constexpr std::size_t kAtOnce = std::size_t{12} << 16;
  if (!std::exchange(has_begun_, true)) return piece_;
  piece_.clear();
  while (piece_.empty() && part_ < document_.parts_.size()) {
    const GlbDocument::Part& part = document_.parts_[part_];
    if (done_ == 0) piece_.assign(part.offset - written_, '\0');
    const std::size_t end = std::min(part.bytes, done_ + kAtOnce);
    part.append(done_, end, piece_);
    written_ = part.offset + end;
    done_ = end < part.bytes ? end : 0;
    if (done_ == 0) ++part_;
  }
  if (piece_.empty()) {
    piece_.assign(glb_padding(written_), '\0');
    written_ += piece_.size();
  }
  return piece_;
}

}  // namespace tileflight::imaging
