#include "tileflight/tiles/tile_content/i3dm.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content {
namespace {

using Bytes = std::span<const std::byte>;
using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;

/// Reads the instances' transforms; one object per tile.
class InstanceReader {
 public:
  InstanceReader(const TileTable& table, std::size_t count) : table_(table), count_(count) {}

  std::vector<Mat4> read() const {
    const std::vector<Vec3> positions = this->positions();
    const std::vector<Mat3> rotations = this->rotations(positions);
    const std::vector<Vec3> scales = this->scales();
    std::vector<Mat4> out(count_, Mat4::Identity());
    for (std::size_t i = 0; i < count_; ++i) {
      out[i].topLeftCorner<3, 3>() = rotations[i] * scales[i].asDiagonal();
      out[i].topRightCorner<3, 1>() = positions[i];
      if (!out[i].allFinite()) {
        throw InputError(table_.where(), "the position of instance " + std::to_string(i) + " is not finite");
      }
    }
    return out;
  }

 private:
  std::vector<Vec3> positions() const {
    std::vector<Vec3> out(count_, table_.rtc_center());
    if (const auto floats = table_.values<float>("POSITION", 3 * count_)) {
      for (std::size_t i = 0; i < 3 * count_; ++i) out[i / 3][static_cast<Eigen::Index>(i % 3)] += (*floats)[i];
      return out;
    }
    const auto [numbers, scale, offset] = table_.quantized_positions(count_);
    for (std::size_t i = 0; i < 3 * count_; ++i) {
      out[i / 3][static_cast<Eigen::Index>(i % 3)] += offset[i % 3] + numbers[i] * scale[i % 3] / 65535.0;
    }
    return out;
  }

  /// Section "Instance orientation": x is the instance's right and y its up. Without these, the axes are east, north
  /// and up at its position if EAST_NORTH_UP is set; otherwise there is no rotation.
  std::vector<Mat3> rotations(const std::vector<Vec3>& positions) const {
    std::vector<Mat3> out(count_, Mat3::Identity());
    const std::vector<Vec3> up = table_.directions<std::uint16_t>("NORMAL_UP", "NORMAL_UP_OCT32P", count_);
    const std::vector<Vec3> right = table_.directions<std::uint16_t>("NORMAL_RIGHT", "NORMAL_RIGHT_OCT32P", count_);
    if (!up.empty() && !right.empty()) {
      for (std::size_t i = 0; i < count_; ++i) out[i] << right[i], up[i], right[i].cross(up[i]);
    } else if (find_bool(table_.json(), "EAST_NORTH_UP", table_.where()).value_or(false)) {
      for (std::size_t i = 0; i < count_; ++i) {
        out[i] =
            geometry::LocalFrame(geometry::geodetic_from_ecef(positions[i])).T_ecef_local().rotation.toRotationMatrix();
      }
    }
    return out;
  }

  std::vector<Vec3> scales() const {
    std::vector<Vec3> out(count_, Vec3::Ones());
    if (const auto scale = table_.values<float>("SCALE", count_)) {
      for (std::size_t i = 0; i < count_; ++i) out[i] *= (*scale)[i];
    }
    if (const auto scale = table_.values<float>("SCALE_NON_UNIFORM", 3 * count_)) {
      for (std::size_t i = 0; i < 3 * count_; ++i) out[i / 3][static_cast<Eigen::Index>(i % 3)] *= (*scale)[i];
    }
    return out;
  }

  const TileTable& table_;
  std::size_t count_;
};

/// Reads the model, embedded or from its URI; the model's own references are relative to that URI.
DecodedContent read_body(Bytes tile, Bytes body, const std::string& name, const ContentOptions& options,
                         const ModelReader& read_model) {
  const std::uint32_t format = base::read_raw<std::uint32_t>(tile, 28);
  if (format == 1) return read_model(body, name, options);
  if (format != 0) throw InputError(name, "gltfFormat is " + std::to_string(format) + "; expected 0 (URI) or 1 (GLB)");
  std::string uri(base::as_text(body));
  uri = uri.substr(0, uri.find('\0'));
  while (uri.ends_with(' ')) uri.pop_back();
  if (uri.empty()) throw InputError(name, "has no model URI");
  if (!fetch::is_data_uri(uri) && !options.read_resource) {
    throw InputError(name, "its model is in another file, which is not available here");
  }
  ContentOptions beside = options;
  if (options.read_resource) {
    beside.read_resource = [&](const std::string& reference) {
      return options.read_resource(fetch::resolve_in_tileset(uri, reference));
    };
  }
  if (options.read_image) {
    beside.read_image = [&](const std::string& reference) {
      return options.read_image(fetch::resolve_in_tileset(uri, reference));
    };
  }
  const std::vector<std::byte> model =
      fetch::is_data_uri(uri) ? fetch::decode_data_uri(uri, name) : options.read_resource(uri);
  return read_model(model, name + ": " + fetch::uri_for_message(uri), beside);
}

void check_size(const DecodedContent& model, std::size_t count, const ContentLimits& limits, const std::string& name) {
  std::size_t vertices = 0;
  std::size_t triangles = 0;
  std::size_t points = 0;
  for (const imaging::TexturedMesh& mesh : model.meshes) {
    vertices += mesh.mesh.vertices.size();
    triangles += mesh.mesh.triangles.size();
  }
  for (const geometry::PointCloud& cloud : model.clouds) points += cloud.size();
  const auto too_many = [&](std::size_t each, std::size_t limit) { return each > 0 && count > limit / each; };
  if (too_many(vertices, limits.max_vertices) || too_many(triangles, limits.max_triangles) ||
      too_many(points, limits.max_points) || too_many(model.meshes.size(), limits.max_meshes)) {
    throw InputError(name, std::to_string(count) + " instances of its model exceed the limits");
  }
}

}  // namespace

void append_i3dm(Bytes bytes, const std::string& name, const ContentOptions& options, const ModelReader& read_model,
                 DecodedContent& out) {
  constexpr std::size_t kHeader = 32;
  const Bytes tile = trim_to_byte_length(bytes, kHeader, name);
  require_version(tile, 1, "i3dm", name);
  const TileTables tables = split_tables(tile, read_table_lengths(tile, kHeader), name);
  const TileTable table(tables.feature_json, tables.feature_binary, name + ": feature table");
  const std::size_t count = require_value(table.count("INSTANCES_LENGTH"), "INSTANCES_LENGTH", table.where());
  if (count > tables.feature_json.size() + tables.feature_binary.size()) {
    throw InputError(table.where(), "the number of positions differs from INSTANCES_LENGTH");
  }
  const DecodedContent model = read_body(tile, tables.body, name, options, read_model);
  check_size(model, count, options.limits, name);
  const std::vector<Mat4> places = InstanceReader(table, count).read();
  const auto ids = table.ids("BATCH_ID", count);
  const auto features = try_read_batch_table(tables, count, out.warnings);
  for (std::size_t i = 0; i < count; ++i) {
    for (const imaging::TexturedMesh& mesh : model.meshes) {
      out.meshes.push_back(mesh);
      transform_mesh(places[i], out.meshes.back());
      const std::uint32_t id = ids ? (*ids)[i] : static_cast<std::uint32_t>(i);
      out.meshes.back().feature_ids.assign(mesh.mesh.vertices.size(), id);
      out.meshes.back().features = features;
    }
    for (const geometry::PointCloud& cloud : model.clouds) {
      out.clouds.push_back(cloud);
      transform_cloud(places[i], out.clouds.back());
    }
  }
  out.copyrights.insert(out.copyrights.end(), model.copyrights.begin(), model.copyrights.end());
  for (const std::string& warning : model.warnings) warn_once(warning, out.warnings);
}

}  // namespace tileflight::tile_content
