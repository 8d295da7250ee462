#include <nlohmann/json.hpp>

#include <iomanip>
#include <map>
#include <sstream>

#include "command.h"
#include "number_text.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/tiling/georeference.h"
#include "tileflight/tiling/mesh_source.h"
#include "tileflight/tiling/mesh_tileset.h"

namespace tileflight::app {
namespace {

struct TileOptions {
  std::string mesh;
  std::string out;
  std::vector<double> georeference;  // latitude, longitude, height
  std::string crs;
  std::vector<double> offset;
  bool no_georeference = false;
  std::string up;
  bool no_textures = false;
  double scale = 1.0;
  int levels = 0;
  tiling::MeshTilesetOptions tileset;
};

tiling::MeshSourceOptions source_of(const TileOptions& options) {
  tiling::MeshSourceOptions out;
  const std::map<std::string, tile_contents::UpAxis> axes{
      {"x", tile_contents::UpAxis::kX}, {"y", tile_contents::UpAxis::kY}, {"z", tile_contents::UpAxis::kZ}};
  if (!options.up.empty()) out.up = axes.at(options.up);
  out.metres_per_unit = options.scale;
  out.textures = !options.no_textures;
  return out;
}

/// Georeference of the mesh, from the options or else from a file beside it. Moves a mesh that is in map coordinates.
std::optional<geometry::LocalFrame> place_on_earth(const TileOptions& options, tiling::MeshSource& source,
                                                   std::string& stated_by) {
  if (options.no_georeference) return std::nullopt;
  if (!options.georeference.empty()) {
    stated_by = "--georeference";
    return geometry::LocalFrame(
        {options.georeference[0], options.georeference[1], geometry::EllipsoidalHeight{options.georeference[2]}});
  }
  std::optional<tiling::Georeference> place;
  if (!options.crs.empty()) {
    place = tiling::Georeference{options.crs, geometry::Vec3::Zero(), "--crs"};
    if (!options.offset.empty()) place->offset = geometry::Vec3(options.offset.data());
  } else {
    place = tiling::find_georeference(options.mesh);
  }
  if (!place) return std::nullopt;
  stated_by = place->stated_by;
  return tiling::reproject_to_local(*place, source.meshes);
}

nlohmann::json frame_json(const std::optional<geometry::LocalFrame>& frame, const std::string& stated_by) {
  if (!frame) return nullptr;
  const geometry::Geodetic& origin = frame->origin();
  return {{"origin_lat", origin.latitude_deg},
          {"origin_lon", origin.longitude_deg},
          {"origin_height", origin.height.m},
          {"stated_by", stated_by}};
}

nlohmann::json result_of(const TileOptions& options, const tiling::MeshTilesetSummary& summary,
                         const std::vector<std::string>& warnings) {
  nlohmann::json levels = nlohmann::json::array();
  for (const tiling::TilesetLevel& level : summary.levels)
    levels.push_back({{"tiles", level.tiles},
                      {"triangles", level.triangles},
                      {"texels", level.texels},
                      {"texel_m", level.texel_m},
                      {"geometric_error", level.geometric_error_m}});
  return {{"tileset", (std::filesystem::path(options.out) / "tileset.json").string()},
          {"bytes", summary.bytes},
          {"levels", levels},
          {"texture_scale", summary.texture_scale},
          {"warnings", warnings}};
}

std::string text_of(const nlohmann::json& result) {
  std::ostringstream text;
  text << std::setprecision(9) << result["tileset"].get<std::string>() << ": " << result["levels"].back()["triangles"]
       << " triangles, " << result["bytes"].get<std::int64_t>() / 1000000 << " MB";
  if (result["frame"].is_null()) {
    text << ", not georeferenced\n";
  } else {
    text << ", at " << result["frame"]["origin_lat"].get<double>() << ", "
         << result["frame"]["origin_lon"].get<double>() << " (" << result["frame"]["stated_by"].get<std::string>()
         << ")\n";
  }
  int number = 0;
  for (const auto& level : result["levels"])
    text << "  level " << number++ << ": " << level["tiles"] << " tiles, " << level["triangles"]
         << " triangles, geometric error " << std::setprecision(4) << level["geometric_error"].get<double>() << " m\n";
  for (const auto& warning : result["warnings"]) text << "note: " << warning.get<std::string>() << "\n";
  return text.str();
}

Output tile(const TileOptions& options, const CommonOptions& shared, const Progress& progress) {
  nlohmann::json result;
  const base::OutputFolder output{.folder = options.out,
                                  .command = "tile",
                                  .replace = shared.force,
                                  .inputs = {options.mesh},
                                  .legacy = tiling::legacy_tileset_folder()};
  base::write_folder(output, [&](const std::filesystem::path& temporary) {
    report_progress(progress, 0, 0, "reading the mesh");
    tiling::MeshSource source = tiling::read_mesh_source(options.mesh, source_of(options));
    std::string stated_by;
    const std::optional<geometry::LocalFrame> frame = place_on_earth(options, source, stated_by);
    tiling::MeshTilesetOptions settings = options.tileset;
    if (options.levels > 0) settings.levels = options.levels;
    if (frame) settings.T_ecef_local = frame->T_ecef_local();
    if (settings.copyright.empty() && !source.copyrights.empty()) settings.copyright = source.copyrights.front();
    const tiling::MeshTilesetSummary summary = tiling::write_mesh_tileset(temporary, source.meshes, settings, progress);
    if (summary.texture_scale < 1.0)
      source.warnings.push_back("textures that did not fit into a tile's texture were scaled down, to " +
                                rounded(summary.texture_scale, 3) +
                                " of their size at the smallest; increase --texture-size to keep them");
    result = result_of(options, summary, source.warnings);
    result["frame"] = frame_json(frame, stated_by);
  });
  return {result, text_of(result)};
}

void add_options(CLI::App& command, TileOptions& options) {
  command.add_option("MESH", options.mesh, "mesh: .obj (with .mtl and textures), .glb, .gltf or .ply")->required();
  command.add_option("--out", options.out, "folder to write")->required();
  auto* georeference = command
                           .add_option("--georeference", options.georeference,
                                       "LAT,LON,HEIGHT of the mesh's origin (degrees, metres above the ellipsoid); its "
                                       "axes are east, north, up")
                           ->delimiter(',')
                           ->expected(3);
  auto* crs = command.add_option("--crs", options.crs,
                                 "coordinate reference system of the mesh, e.g. EPSG:32717 (default: from the files of "
                                 "OpenDroneMap or metadata.xml beside the mesh)");
  command.add_option("--offset", options.offset, "X,Y,Z to add to the mesh's coordinates in that reference system")
      ->delimiter(',')
      ->expected(3)
      ->needs(crs);
  auto* none =
      command.add_flag("--no-georeference", options.no_georeference, "ignore georeferencing files beside the mesh");
  georeference->excludes(crs)->excludes(none);
  crs->excludes(none);
  command.add_option("--up", options.up, "the mesh's axis that points up (default: z; y for glTF)")
      ->check(CLI::IsMember({"x", "y", "z"}));
  command.add_option("--scale", options.scale, "metres in one unit of the mesh (default 1)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--tile-triangles", options.tileset.tile_triangles,
                  "maximum number of triangles per tile (default 20000)")
      ->check(CLI::Range(100, 10000000));
  command
      .add_option("--texture-size", options.tileset.max_atlas_px,
                  "longest side of a tile's texture, pixels (default 4096)")
      ->check(CLI::Range(64, 16384));
  command
      .add_option("--levels", options.levels, "number of levels of detail (default: as many as the tile size requires)")
      ->check(CLI::Range(1, 10));
  command
      .add_option("--jpeg-quality", options.tileset.jpeg_quality, "JPEG quality of the textures, 1 to 100 (default 90)")
      ->check(CLI::Range(1, 100));
  command.add_option("--copyright", options.tileset.copyright, "attribution, written into every tile");
  command.add_flag("--no-textures", options.no_textures, "write no textures");
}

}  // namespace

void add_tile(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<TileOptions>();
  CLI::App* command = app.add_subcommand("tile", "convert a mesh to 3D Tiles with levels of detail");
  command->footer(
      "Example:\n  tileflight tile odm_textured_model_geo.obj --out tiles\n"
      "  tileflight tile scan.glb --georeference 50.8231,14.2210,312.5 --out tiles");
  add_options(*command, *options);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      return tile(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
