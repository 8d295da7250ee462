#include "tileflight/tiles/tile_writer/georeference.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <memory>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::tile_writer {
namespace {

namespace fs = std::filesystem;
using geometry::Geodetic;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr std::uintmax_t kMaxGeoreferenceBytes = std::uintmax_t{64} << 20;

/// Vertices per task: creating a transformation costs as much as transforming some thousands of them.
constexpr std::size_t kGrain = 65536;

/// Converts from a reference system to longitude, latitude (degrees) and height on WGS84. One object per thread.
class GeodeticConverter {
 public:
  explicit GeodeticConverter(const Georeference& place)
      : georeference_(place), projection_(geometry::Projection::to_geodetic(place.crs)) {
    if (!projection_)
      throw InputError(
          place.stated_by,
          "'" + place.crs + "' is not a coordinate reference system known to PROJ; use a name such as EPSG:32717");
  }

  Geodetic operator()(const Vec3& position) const {
    const Vec3 at = position + georeference_.offset;
    const std::optional<Vec3> place = (*projection_)(at);
    if (!place)
      throw InputError(georeference_.stated_by, "the coordinates " + std::to_string(at.x()) + ", " +
                                                    std::to_string(at.y()) + " lie outside " + georeference_.crs +
                                                    "; check the offset");
    return {place->y(), place->x(), {place->z()}};
  }

 private:
  const Georeference& georeference_;
  std::optional<geometry::Projection> projection_;
};

/// The numbers in a text, separated by blanks or commas; empty if a field is not a number.
std::vector<double> numbers_in(std::string_view text) {
  std::vector<double> out;
  for (const std::string_view field : base::split_fields(text, " \t,;\r\n")) {
    const auto value = base::parse_number<double>(field);
    if (!value || !std::isfinite(*value)) return {};
    out.push_back(*value);
  }
  return out;
}

/// "EPSG:32617" for "WGS84 UTM 17N"; empty for other texts.
std::string crs_of_utm(std::string_view line) {
  const std::vector<std::string_view> fields = base::split_fields(line);
  if (fields.size() < 3 || fields[1] != "UTM" || fields[2].size() < 2) return {};
  const auto zone = base::parse_number<int>(fields[2].substr(0, fields[2].size() - 1));
  const char half = fields[2].back();
  if (!zone || *zone < 1 || *zone > 60 || (half != 'N' && half != 'S')) return {};
  return "EPSG:" + std::to_string((half == 'N' ? 32600 : 32700) + *zone);
}

Georeference read_odm(const fs::path& file) {
  const std::string text = base::read_text(file, kMaxGeoreferenceBytes);
  std::string_view rest = text;
  const std::string crs = crs_of_utm(base::take_line(rest).value_or(""));
  const std::vector<double> offset = numbers_in(base::take_line(rest).value_or(""));
  if (crs.empty() || offset.size() < 2)
    throw InputError(file.string(),
                     "unknown format: expected a line like 'WGS84 UTM 17N' and one with the offset east and north; "
                     "--no-georeference ignores the file");
  return {crs, {offset[0], offset[1], 0.0}, file.string()};
}

/// The text between the first <tag> and </tag>.
std::string_view element(std::string_view xml, const std::string& tag) {
  const std::size_t begin = xml.find("<" + tag + ">");
  if (begin == std::string_view::npos) return {};
  xml.remove_prefix(begin + tag.size() + 2);
  return xml.substr(0, xml.find("</" + tag + ">"));
}

Georeference read_metadata_xml(const fs::path& file) {
  const std::string text = base::read_text(file, kMaxGeoreferenceBytes);
  const std::string_view srs = element(text, "SRS"), origin_text = element(text, "SRSOrigin");
  const std::vector<double> origin = numbers_in(origin_text);
  if (srs.empty() || (origin.size() != 3 && !origin_text.empty()))
    throw InputError(file.string(),
                     "has no SRS with an SRSOrigin of three numbers; --no-georeference ignores the file");
  return {std::string(srs), origin.empty() ? Vec3(Vec3::Zero()) : Vec3(origin[0], origin[1], origin[2]), file.string()};
}

geometry::Box3 box_of(const std::vector<TexturedMesh>& meshes) {
  geometry::Box3 box;
  for (const TexturedMesh& m : meshes)
    for (const Vec3& v : m.mesh.vertices) box.extend(v);
  return box;
}

/// "ENU:LAT,LON": the mesh is already in an east-north-up frame.
geometry::LocalFrame frame_of_enu(const Georeference& place) {
  const std::vector<double> at = numbers_in(std::string_view(place.crs).substr(4));
  if (at.size() < 2) throw InputError(place.stated_by, "'" + place.crs + "' is not of the form ENU:LAT,LON");
  return geometry::LocalFrame({at[0], at[1], {at.size() > 2 ? at[2] : 0.0}});
}

}  // namespace

std::optional<Georeference> find_georeference(const fs::path& mesh_file) {
  const fs::path folder = fs::absolute(mesh_file).parent_path(), above = folder.parent_path();
  std::error_code ignored;
  for (const fs::path& where : {folder, above / "odm_georeferencing"})
    for (const char* name : {"odm_georeferencing_model_geo.txt", "coords.txt"})
      if (fs::exists(where / name, ignored)) return read_odm(where / name);
  for (const fs::path& where : {folder, above})
    if (fs::exists(where / "metadata.xml", ignored)) return read_metadata_xml(where / "metadata.xml");
  return std::nullopt;
}

LocalPlacement place_locally(const Georeference& place, const geometry::Box3& extent) {
  if (place.crs.starts_with("ENU:"))
    return {frame_of_enu(place), [offset = place.offset](const Vec3& p) { return Vec3(p + offset); }};
  const auto stays = std::make_shared<const Georeference>(place);  // the converter refers to it
  const auto to_geodetic = std::make_shared<const GeodeticConverter>(*stays);
  const geometry::LocalFrame frame((*to_geodetic)(extent.center()));
  return {frame, [stays, to_geodetic, frame](const Vec3& p) { return frame.local_from_geodetic((*to_geodetic)(p)); }};
}

geometry::LocalFrame reproject_to_local(const Georeference& place, std::vector<TexturedMesh>& meshes) {
  if (place.crs.starts_with("ENU:")) {
    for (TexturedMesh& m : meshes)
      for (Vec3& v : m.mesh.vertices) v += place.offset;
    return frame_of_enu(place);
  }
  const geometry::LocalFrame frame(GeodeticConverter(place)(box_of(meshes).center()));
  for (TexturedMesh& m : meshes) {
    std::vector<Vec3>& vertices = m.mesh.vertices;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices.size(), kGrain), [&](const auto& range) {
      const GeodeticConverter to_geodetic(place);
      for (std::size_t i = range.begin(); i < range.end(); ++i)
        vertices[i] = frame.local_from_geodetic(to_geodetic(vertices[i]));
    });
  }
  return frame;
}

}  // namespace tileflight::tile_writer
