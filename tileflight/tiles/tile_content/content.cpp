#include "tileflight/tiles/tile_content/content.h"

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <string_view>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/tile_content/gltf_meshes.h"
#include "tileflight/tiles/tile_content/i3dm.h"
#include "tileflight/tiles/tile_content/pnts.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content {

using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;

void transform_mesh(const Mat4& T_target_source, imaging::TexturedMesh& mesh) {
  const Mat3 linear = T_target_source.topLeftCorner<3, 3>();
  const Vec3 translation = T_target_source.topRightCorner<3, 1>();
  for (Vec3& vertex : mesh.mesh.vertices) vertex = (linear * vertex + translation).eval();
  if (linear.determinant() >= 0) return;
  for (geometry::Triangle& triangle : mesh.mesh.triangles) std::swap(triangle[1], triangle[2]);
}

void transform_cloud(const Mat4& T_target_source, geometry::PointCloud& cloud) {
  const Mat3 linear = T_target_source.topLeftCorner<3, 3>();
  const Vec3 translation = T_target_source.topRightCorner<3, 1>();
  for (Vec3& point : cloud.positions) point = (linear * point + translation).eval();
  // The cofactor matrix is the inverse transpose times the determinant, and also exists for singular transforms.
  const double side = linear.determinant() < 0 ? -1.0 : 1.0;
  Mat3 of_normals;
  for (int i = 0; i < 3; ++i) of_normals.col(i) = linear.col((i + 1) % 3).cross(linear.col((i + 2) % 3));
  for (Eigen::Vector3f& normal : cloud.normals) {
    normal = (side * (of_normals * normal.cast<double>())).normalized().cast<float>();
  }
}

namespace {

using Bytes = std::span<const std::byte>;

/// GLB (glTF 2.0, section 4.4): header, a JSON chunk, an optional binary chunk.
void append_glb(Bytes bytes, const GltfContainerInfo& around, const std::string& name, const ContentOptions& options,
                DecodedContent& out, const GltfReceiver& receiver = {}) {
  constexpr std::size_t kHeader = 12;
  constexpr std::size_t kChunkHeader = 8;
  constexpr std::uint32_t kJson = 0x4E4F534A;
  constexpr std::uint32_t kBinary = 0x004E4942;
  if (bytes.size() >= kHeader && base::read_raw<std::uint32_t>(bytes, 4) == 1) {
    throw InputError(name, "glTF version 1 is not supported, only 2: upgrade the tileset");
  }
  if (bytes.size() >= kHeader) require_version(bytes, 2, "glTF", name);
  Bytes rest = trim_to_byte_length(bytes, kHeader + kChunkHeader, name).subspan(kHeader);
  const auto next_chunk = [&](std::uint32_t expected) {
    const std::uint32_t length = base::read_raw<std::uint32_t>(rest, 0);
    const std::uint32_t type = base::read_raw<std::uint32_t>(rest, 4);
    if (length > rest.size() - kChunkHeader) throw InputError(name, "a GLB chunk reaches beyond the end of the file");
    if (type != expected) return Bytes();
    const Bytes chunk = rest.subspan(kChunkHeader, length);
    rest = rest.subspan(kChunkHeader + length);
    return chunk;
  };
  const Bytes json = next_chunk(kJson);
  if (json.empty()) throw InputError(name, "the GLB does not begin with a JSON chunk");
  const Bytes binary = rest.size() < kChunkHeader ? Bytes() : next_chunk(kBinary);
  append_gltf(base::as_text(json), binary, around, name, options, out, receiver);
}

/// Handles two older header forms: 20 bytes (batch length, batch table length) and 24 (batch table JSON and binary
/// length, batch length). There the glTF's magic or the batch table's opening brace is at the position of a length,
/// which gives a number larger than any real table.
TileTableLengths b3dm_lengths(Bytes bytes) {
  constexpr std::uint32_t kBeyondAnyTable = 0x22000000;  // "\"" as the highest byte
  TileTableLengths lengths = read_table_lengths(bytes, 28);
  if (base::read_raw<std::uint32_t>(bytes, 20) >= kBeyondAnyTable) {
    lengths = {.header = 20, .batch_json = base::read_raw<std::uint32_t>(bytes, 16)};
  } else if (base::read_raw<std::uint32_t>(bytes, 24) >= kBeyondAnyTable) {
    lengths = {.header = 24,
               .batch_json = base::read_raw<std::uint32_t>(bytes, 12),
               .batch_binary = base::read_raw<std::uint32_t>(bytes, 16)};
  }
  return lengths;
}

/// Number of features of a b3dm; older headers state it before the lengths of their tables.
std::size_t batch_length(const TileTable& features, const TileTableLengths& lengths, Bytes tile) {
  if (lengths.header == 20) return base::read_raw<std::uint32_t>(tile, 12);
  if (lengths.header == 24) return base::read_raw<std::uint32_t>(tile, 20);
  return features.count("BATCH_LENGTH").value_or(0);
}

void append_b3dm(Bytes bytes, const std::string& name, const ContentOptions& options, DecodedContent& out) {
  const Bytes tile = trim_to_byte_length(bytes, 28, name);
  require_version(tile, 1, "b3dm", name);
  const TileTableLengths lengths = b3dm_lengths(tile);
  const TileTables tables = split_tables(tile, lengths, name);
  const TileTable features(tables.feature_json, tables.feature_binary, name + ": feature table");
  if (!base::as_text(tables.body).starts_with("glTF")) throw InputError(name, "the b3dm contains no binary glTF");
  GltfContainerInfo around;
  if (const auto c = features.global("RTC_CENTER", 3)) around.rtc_center = {(*c)[0], (*c)[1], (*c)[2]};
  around.features = try_read_batch_table(tables, batch_length(features, lengths, tile), out.warnings);
  append_glb(tables.body, around, name, options, out);
}

void append_content(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                    DecodedContent& out);

/// Composite (3D Tiles 1.0, "Composite"): a sequence of tiles.
void append_cmpt(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                 DecodedContent& out) {
  constexpr std::size_t kHeader = 16;
  const Bytes tile = trim_to_byte_length(bytes, kHeader, name);
  require_version(tile, 1, "cmpt", name);
  if (nesting >= options.limits.max_nesting) throw InputError(name, "composites are nested too deeply");
  Bytes rest = tile.subspan(kHeader);
  const std::uint32_t count = base::read_raw<std::uint32_t>(tile, 12);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string inner = name + ": inner tile " + std::to_string(i);
    const Bytes inner_tile = trim_to_byte_length(rest, 12, inner);
    append_content(inner_tile, inner, options, nesting + 1, out);
    rest = rest.subspan(inner_tile.size());
  }
}

/// The model of an i3dm: GLB or glTF, never a tile container.
DecodedContent read_model(Bytes bytes, const std::string& name, const ContentOptions& options) {
  const std::string kind = detect_content_format(bytes);
  if (kind != "glb" && kind != "JSON") throw InputError(name, "is not glTF, which the model of an i3dm must be");
  DecodedContent out;
  append_content(bytes, name, options, 0, out);
  return out;
}

void append_content(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                    DecodedContent& out) {
  const std::string kind = detect_content_format(bytes);
  if (kind == "b3dm") return append_b3dm(bytes, name, options, out);
  if (kind == "glb") return append_glb(bytes, {}, name, options, out);
  if (kind == "pnts") return append_pnts(bytes, name, options, out);
  if (kind == "i3dm") return append_i3dm(bytes, name, options, read_model, out);
  if (kind == "cmpt") return append_cmpt(bytes, name, options, nesting, out);
  if (kind == "JSON") return append_gltf(base::as_text(bytes), {}, {}, name, options, out);
  if (kind == "empty") throw InputError(name, "is empty");
  if (kind == "HTML") throw InputError(name, "is a web page (HTML), not a tile");
  if (kind == "unknown") throw InputError(name, "is not a tile: its first bytes match no known format");
  throw InputError(name, kind + " contents are not supported");
}

}  // namespace

std::string detect_content_format(Bytes bytes) {
  static const std::map<std::string_view, std::string> kMagics = {
      {"b3dm", "b3dm"}, {"glTF", "glb"},  {"cmpt", "cmpt"}, {"i3dm", "i3dm"},
      {"pnts", "pnts"}, {"vctr", "vctr"}, {"geom", "geom"}, {"subt", "subtree"}};
  if (bytes.empty()) return "empty";
  const std::string_view text = base::as_text(bytes);
  const auto magic = kMagics.find(text.substr(0, 4));
  if (magic != kMagics.end()) return magic->second;
  if (text.starts_with("\x1f\x8b")) return "gzip";
  if (text.starts_with("PK\x03\x04")) return "archive (.3tz)";
  std::string_view start = text.starts_with("\xEF\xBB\xBF") ? text.substr(3) : text;
  start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n"), start.size()));
  if (start.starts_with('{')) return "JSON";
  return start.starts_with('<') ? "HTML" : "unknown";
}

DecodedContent decode_content(Bytes bytes, const std::string& name, const ContentOptions& options) {
  DecodedContent out;
  append_content(bytes, name, options, 0, out);
  return out;
}

DecodedContent decode_gltf(Bytes bytes, const std::string& name, const ContentOptions& options,
                           const GltfReceiver& receiver) {
  const std::string kind = detect_content_format(bytes);
  if (kind != "glb" && kind != "JSON") throw InputError(name, "is not a glTF file, judging by its first bytes");
  DecodedContent out;
  if (kind == "glb") {
    append_glb(bytes, {}, name, options, out, receiver);
  } else {
    append_gltf(base::as_text(bytes), {}, {}, name, options, out, receiver);
  }
  return out;
}

}  // namespace tileflight::tile_content
