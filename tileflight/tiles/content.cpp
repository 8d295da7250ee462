#include "tileflight/tiles/content.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string_view>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/gltf_meshes.h"
#include "tileflight/tiles/json_reader.h"

namespace tileflight::tiles {
namespace {

using Bytes = std::span<const std::byte>;

std::string_view as_text(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

std::uint32_t uint32_at(Bytes bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// The content without what follows its own byteLength (bytes 8 to 11 in every container of 3D Tiles and in GLB).
Bytes whole_of(Bytes bytes, std::size_t header_bytes, const std::string& name) {
  if (bytes.size() < header_bytes) {
    throw InputError(name, "cut short: " + std::to_string(bytes.size()) + " bytes, the header alone has " +
                               std::to_string(header_bytes));
  }
  const std::uint32_t length = uint32_at(bytes, 8);
  if (length > bytes.size()) {
    throw InputError(name, "cut short: " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
  }
  if (length < header_bytes)
    throw InputError(name, "its header gives a length of " + std::to_string(length) + " bytes");
  return bytes.first(length);
}

void require_version(Bytes bytes, std::uint32_t wanted, const std::string& kind, const std::string& name) {
  const std::uint32_t version = uint32_at(bytes, 4);
  if (version != wanted) {
    throw InputError(
        name, kind + " version " + std::to_string(version) + " is not supported; " + std::to_string(wanted) + " is");
  }
}

/// GLB (glTF 2.0, section 4.4): header, a JSON chunk, a binary chunk if there is one.
void append_glb(Bytes bytes, const geometry::Vec3& rtc_center, const std::string& name, const ContentOptions& options,
                DecodedContent& out) {
  constexpr std::size_t kHeader = 12;
  constexpr std::size_t kChunkHeader = 8;
  constexpr std::uint32_t kJson = 0x4E4F534A;
  constexpr std::uint32_t kBinary = 0x004E4942;
  if (bytes.size() >= kHeader) require_version(bytes, 2, "glTF", name);
  Bytes rest = whole_of(bytes, kHeader + kChunkHeader, name).subspan(kHeader);
  const auto next_chunk = [&](std::uint32_t wanted) {
    const std::uint32_t length = uint32_at(rest, 0);
    const std::uint32_t type = uint32_at(rest, 4);
    if (length > rest.size() - kChunkHeader) throw InputError(name, "a GLB chunk reaches beyond the end of the file");
    if (type != wanted) return Bytes();
    const Bytes chunk = rest.subspan(kChunkHeader, length);
    rest = rest.subspan(kChunkHeader + length);
    return chunk;
  };
  const Bytes json = next_chunk(kJson);
  if (json.empty()) throw InputError(name, "the GLB does not begin with a JSON chunk");
  const Bytes binary = rest.size() < kChunkHeader ? Bytes() : next_chunk(kBinary);
  append_gltf(as_text(json), binary, rtc_center, name, options, out);
}

/// Lengths of a b3dm's tables and where they begin (3D Tiles 1.0, "Batched 3D Model").
struct B3dmLayout {
  std::size_t header = 28;
  std::size_t feature_json = 0, feature_binary = 0, batch_json = 0, batch_binary = 0;
};

/// Two header forms came before the present one: 20 bytes (batch length, batch table length) and 24 (batch table JSON
/// and binary length, batch length). There the glTF's magic or the batch table's opening brace stands where a length
/// would be, which makes a number beyond any real table.
B3dmLayout b3dm_layout(Bytes bytes) {
  constexpr std::uint32_t kBeyondAnyTable = 0x22000000;  // "\"" as the highest byte
  B3dmLayout layout;
  if (uint32_at(bytes, 20) >= kBeyondAnyTable) {
    layout.header = 20;
    layout.batch_json = uint32_at(bytes, 16);
  } else if (uint32_at(bytes, 24) >= kBeyondAnyTable) {
    layout.header = 24;
    layout.batch_json = uint32_at(bytes, 12);
    layout.batch_binary = uint32_at(bytes, 16);
  } else {
    layout.feature_json = uint32_at(bytes, 12);
    layout.feature_binary = uint32_at(bytes, 16);
    layout.batch_json = uint32_at(bytes, 20);
    layout.batch_binary = uint32_at(bytes, 24);
  }
  return layout;
}

/// RTC_CENTER of a feature table: in its JSON, or as three floats in its binary part.
geometry::Vec3 rtc_center_of(Bytes feature_json, Bytes feature_binary, const std::string& name) {
  if (feature_json.empty()) return geometry::Vec3::Zero();
  const std::string where = name + ": feature table";
  const Json table = parse_json(as_text(feature_json), where, {.max_depth = 64});
  const Json* center = find_member(table, "RTC_CENTER");
  if (center == nullptr) return geometry::Vec3::Zero();
  if (center->is_array()) {
    const std::vector<double> c = *find_numbers(table, "RTC_CENTER", 3, where);
    return {c[0], c[1], c[2]};
  }
  const std::size_t offset = required(find_index(*center, "byteOffset", where), "RTC_CENTER.byteOffset", where);
  float c[3];
  if (offset > feature_binary.size() || feature_binary.size() - offset < sizeof c) {
    throw InputError(where, "RTC_CENTER lies outside of its binary part");
  }
  std::memcpy(c, feature_binary.data() + offset, sizeof c);
  return {c[0], c[1], c[2]};
}

void append_b3dm(Bytes bytes, const std::string& name, const ContentOptions& options, DecodedContent& out) {
  const Bytes tile = whole_of(bytes, 28, name);
  require_version(tile, 1, "b3dm", name);
  const B3dmLayout layout = b3dm_layout(tile);
  // Sums of four 32-bit numbers in 64 bits: nothing wraps around.
  const std::size_t features_end = layout.header + layout.feature_json + layout.feature_binary;
  const std::size_t tables_end = features_end + layout.batch_json + layout.batch_binary;
  if (tables_end > tile.size()) throw InputError(name, "the tables of the b3dm reach beyond the end of the file");
  const Bytes feature_json = tile.subspan(layout.header, layout.feature_json);
  const Bytes feature_binary = tile.subspan(layout.header + layout.feature_json, layout.feature_binary);
  const geometry::Vec3 rtc_center = rtc_center_of(feature_json, feature_binary, name);
  const Bytes glb = tile.subspan(tables_end);
  if (!as_text(glb).starts_with("glTF")) throw InputError(name, "the b3dm holds no binary glTF");
  append_glb(glb, rtc_center, name, options, out);
}

void append_content(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                    DecodedContent& out);

/// Composite (3D Tiles 1.0, "Composite"): tiles one after the other.
void append_cmpt(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                 DecodedContent& out) {
  constexpr std::size_t kHeader = 16;
  const Bytes tile = whole_of(bytes, kHeader, name);
  require_version(tile, 1, "cmpt", name);
  if (nesting >= options.limits.max_nesting) throw InputError(name, "composites inside each other too deep");
  Bytes rest = tile.subspan(kHeader);
  const std::uint32_t count = uint32_at(tile, 12);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string inner = name + ": inner tile " + std::to_string(i);
    const Bytes inner_tile = whole_of(rest, 12, inner);
    append_content(inner_tile, inner, options, nesting + 1, out);
    rest = rest.subspan(inner_tile.size());
  }
}

void append_content(Bytes bytes, const std::string& name, const ContentOptions& options, int nesting,
                    DecodedContent& out) {
  const std::string kind = content_kind(bytes);
  if (kind == "b3dm") return append_b3dm(bytes, name, options, out);
  if (kind == "glb") return append_glb(bytes, geometry::Vec3::Zero(), name, options, out);
  if (kind == "cmpt") return append_cmpt(bytes, name, options, nesting, out);
  if (kind == "JSON") return append_gltf(as_text(bytes), {}, geometry::Vec3::Zero(), name, options, out);
  if (kind == "empty") throw InputError(name, "is empty");
  if (kind == "HTML") throw InputError(name, "is a web page (HTML), not a tile");
  if (kind == "unknown") throw InputError(name, "is no tile: its first bytes are those of no known format");
  throw InputError(name, kind + " contents are not supported so far");
}

}  // namespace

std::string content_kind(Bytes bytes) {
  static const std::map<std::string_view, std::string> kMagics = {
      {"b3dm", "b3dm"}, {"glTF", "glb"},  {"cmpt", "cmpt"}, {"i3dm", "i3dm"},
      {"pnts", "pnts"}, {"vctr", "vctr"}, {"geom", "geom"}, {"subt", "subtree"}};
  if (bytes.empty()) return "empty";
  const std::string_view text = as_text(bytes);
  const auto magic = kMagics.find(text.substr(0, 4));
  if (magic != kMagics.end()) return magic->second;
  if (text.starts_with("\x1f\x8b")) return "gzip";
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

}  // namespace tileflight::tiles
