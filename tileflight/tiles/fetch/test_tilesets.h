#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/test_byte_strings.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/tiles/fetch/tile_source.h"

/// Small tilesets built by tests, and an in-memory source for them.
namespace tileflight::fetch::test_support {

using base::test_support::Bytes;
using base::test_support::error_of;
using base::test_support::to_bytes;
using base::test_support::to_raw_bytes;
using base::test_support::to_text;
using Json = nlohmann::json;
/// In-memory files; records which were read.
class MemorySource : public TileSource {
 public:
  MemorySource() = default;
  explicit MemorySource(const Json& tileset) { add("tileset.json", tileset.dump()); }

  void add(const std::string& uri, const std::string& content) { files_[uri] = to_bytes(content); }
  void add(const std::string& uri, const Bytes& content) { files_[uri] = content; }
  void remove(const std::string& uri) { files_.erase(uri); }

  std::string root_uri() const override { return "tileset.json"; }
  Bytes read(const std::string& uri) override {
    const std::lock_guard lock(mutex_);
    ++reads_[uri];
    const auto it = files_.find(uri);
    if (it == files_.end()) throw InputError(uri, "is missing");
    return it->second;
  }
  std::optional<std::uintmax_t> size(const std::string& uri) override {
    const auto it = files_.find(uri);
    return it == files_.end() ? std::nullopt : std::optional<std::uintmax_t>(it->second.size());
  }

  const Bytes& file(const std::string& uri) const { return files_.at(uri); }
  /// URI to number of reads.
  const std::map<std::string, int>& reads() const { return reads_; }

 private:
  std::map<std::string, Bytes> files_;
  std::map<std::string, int> reads_;
  std::mutex mutex_;
};

/// Collects binary data and the JSON that describes it.
class GltfWriter {
 public:
  GltfWriter() { json_ = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}}; }

  Json& json() { return json_; }

  /// A bufferView over `values`; returns its index.
  template <class T>
  std::size_t add_view(const std::vector<T>& values) {
    while (binary_.size() % 4 != 0) binary_ += '\0';
    json_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", values.size() * sizeof(T)}});
    binary_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return json_["bufferViews"].size() - 1;
  }

  /// An accessor over `values`, `components` per element; returns its index.
  template <class T>
  std::size_t add_accessor(const std::vector<T>& values, std::size_t components, bool normalized = false) {
    static const char* const kTypes[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    const std::size_t view = add_view(values);
    json_["accessors"].push_back({{"bufferView", view},
                                  {"componentType", component_type<T>()},
                                  {"type", kTypes[components]},
                                  {"count", values.size() / components},
                                  {"normalized", normalized}});
    return json_["accessors"].size() - 1;
  }

  /// Adds a mesh with this primitive in its own node; returns the node.
  Json& add_primitive(const Json& primitive) {
    json_["meshes"].push_back({{"primitives", {primitive}}});
    json_["nodes"].push_back({{"mesh", json_["meshes"].size() - 1}});
    json_["scenes"][0]["nodes"] = Json::array();
    for (std::size_t i = 0; i < json_["nodes"].size(); ++i) json_["scenes"][0]["nodes"].push_back(i);
    return json_["nodes"].back();
  }

  std::string glb() const {
    Json json = json_;
    std::string binary = binary_;
    while (binary.size() % 4 != 0) binary += '\0';
    if (!binary.empty()) json["buffers"] = {{{"byteLength", binary.size()}}};
    std::string text = json.dump();
    while (text.size() % 4 != 0) text += ' ';
    std::string out =
        "glTF" + u32(2) + u32(static_cast<std::uint32_t>(20 + text.size() + (binary.empty() ? 0 : 8 + binary.size())));
    out += u32(static_cast<std::uint32_t>(text.size())) + "JSON" + text;
    if (!binary.empty()) out += u32(static_cast<std::uint32_t>(binary.size())) + std::string("BIN\0", 4) + binary;
    return out;
  }

  const std::string& binary() const { return binary_; }

  static std::string u32(std::uint32_t value) { return {reinterpret_cast<const char*>(&value), sizeof value}; }

 private:
  template <class T>
  static int component_type() {
    if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
    if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
    if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
    if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
    if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
    return 5126;
  }

  Json json_;
  std::string binary_;
};

/// A GLB of one triangle with these corners (x y z of each, in the glTF's y-up frame).
inline std::string triangle_glb(const std::vector<float>& corners = {0, 0, 0, 1, 0, 0, 0, 1, 0}) {
  GltfWriter writer;
  writer.add_primitive({{"attributes", {{"POSITION", writer.add_accessor(corners, 3)}}}});
  return writer.glb();
}

/// A b3dm of a GLB and this feature table.
inline std::string b3dm(const std::string& glb, const Json& feature_table = {{"BATCH_LENGTH", 0}}) {
  std::string table = feature_table.dump();
  while ((28 + table.size()) % 8 != 0) table += ' ';
  const auto u32 = GltfWriter::u32;
  return "b3dm" + u32(1) + u32(static_cast<std::uint32_t>(28 + table.size() + glb.size())) +
         u32(static_cast<std::uint32_t>(table.size())) + u32(0) + u32(0) + u32(0) + table + glb;
}

/// The four tables of a container of 3D Tiles 1.0.
struct Tables {
  Json feature_json = Json::object();
  std::string feature_binary = {};
  Json batch_json = nullptr;
  std::string batch_binary = {};
};

/// A b3dm, i3dm or pnts; `after_lengths`: the bytes that an i3dm has after its four lengths.
inline std::string container(const std::string& magic, const Tables& tables, const std::string& body = "",
                             const std::string& after_lengths = "") {
  const auto u32 = [](std::size_t value) { return GltfWriter::u32(static_cast<std::uint32_t>(value)); };
  std::string feature = tables.feature_json.dump();
  while (feature.size() % 8 != 0) feature += ' ';
  std::string batch = tables.batch_json.is_null() ? "" : tables.batch_json.dump();
  while (batch.size() % 8 != 0) batch += ' ';
  const std::string rest = u32(feature.size()) + u32(tables.feature_binary.size()) + u32(batch.size()) +
                           u32(tables.batch_binary.size()) + after_lengths + feature + tables.feature_binary + batch +
                           tables.batch_binary + body;
  return magic + u32(1) + u32(12 + rest.size()) + rest;
}

/// A binary subtree file.
inline std::string subtree(const Json& json, const std::string& binary = "") {
  std::string text = json.dump();
  while (text.size() % 8 != 0) text += ' ';
  return "subt" + GltfWriter::u32(1) + to_raw_bytes<std::uint64_t>({text.size(), binary.size()}) + text + binary;
}

/// A file of a ZIP archive: its stored data and properties.
struct ZipEntry {
  std::string path;
  std::string content;
  std::string packed = {};  ///< data compressed by `method`; empty if stored uncompressed
  std::uint16_t method = 0;
};

/// CRC-32, bit by bit (ISO 3309).
inline std::uint32_t crc32_of(const std::string& bytes) {
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

/// A ZIP archive of these files; `offsets` receives their positions.
inline std::string make_zip(const std::vector<ZipEntry>& entries, std::vector<std::uint64_t>* offsets = nullptr) {
  const auto u16 = [](std::size_t value) { return to_raw_bytes<std::uint16_t>({static_cast<std::uint16_t>(value)}); };
  const auto u32 = [](std::size_t value) { return GltfWriter::u32(static_cast<std::uint32_t>(value)); };
  std::string out;
  std::string directory;
  for (const ZipEntry& entry : entries) {
    const std::string& packed = entry.method == 0 ? entry.content : entry.packed;
    const std::string common = u16(0) + u16(entry.method) + u32(0) + u32(crc32_of(entry.content)) + u32(packed.size()) +
                               u32(entry.content.size()) + u16(entry.path.size()) + u16(0);
    if (offsets != nullptr) offsets->push_back(out.size());
    directory +=
        "PK\1\2" + u16(20) + u16(20) + common + u16(0) + u16(0) + u16(0) + u32(0) + u32(out.size()) + entry.path;
    out += "PK\3\4" + u16(20) + common + entry.path + packed;
  }
  return out + directory + "PK\5\6" + u16(0) + u16(0) + u16(entries.size()) + u16(entries.size()) +
         u32(directory.size()) + u32(out.size()) + u16(0);
}

/// An axis-aligned box as a boundingVolume.
inline Json box_volume(double cx, double cy, double cz, double hx, double hy, double hz) {
  return {{"box", {cx, cy, cz, hx, 0, 0, 0, hy, 0, 0, 0, hz}}};
}

inline Json tile(const Json& volume, double geometric_error, const std::string& uri = "") {
  Json out = {{"boundingVolume", volume}, {"geometricError", geometric_error}};
  if (!uri.empty()) out["content"] = {{"uri", uri}};
  return out;
}

inline Json tileset(const Json& root, const std::string& version = "1.1") {
  return {{"asset", {{"version", version}}}, {"geometricError", 1000}, {"root", root}};
}

}  // namespace tileflight::fetch::test_support
