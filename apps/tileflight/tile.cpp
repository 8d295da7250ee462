#include <algorithm>
#include <filesystem>
#include <functional>
#include <iomanip>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "number_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/tile_writer/georeference.h"
#include "tileflight/tiles/tile_writer/large_mesh_tileset.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"

namespace tileflight::app {
namespace {

namespace fs = std::filesystem;

struct TileOptions {
  std::vector<std::string> meshes;  ///< files or folders
  std::string out;
  std::vector<double> georeference;  // latitude, longitude, height
  std::string crs;
  std::vector<double> offset;
  bool no_georeference = false;
  std::string up;
  bool no_textures = false;
  double scale = 1.0;
  int levels = 0;
  double memory_gb = 0.0;    ///< 0: half of the machine's
  bool out_of_core = false;  ///< also where the mesh would fit
  std::string texture_format = "jpeg", compression = "none";
  tile_writer::MeshTilesetOptions tileset;
};

mesh_files::MeshSourceOptions source_of(const TileOptions& options) {
  mesh_files::MeshSourceOptions out;
  const std::map<std::string, tile_content::UpAxis> axes{
      {"x", tile_content::UpAxis::kX}, {"y", tile_content::UpAxis::kY}, {"z", tile_content::UpAxis::kZ}};
  if (!options.up.empty()) out.up = axes.at(options.up);
  out.metres_per_unit = options.scale;
  out.textures = !options.no_textures;
  return out;
}

/// Georeference of a mesh's frame, and the file or option that states it.
struct MeshFrame {
  std::optional<geometry::LocalFrame> frame;
  std::string stated_by;
};

/// Finds the map coordinates that a mesh is in: from the options, or else from a file beside it or in its folder.
std::optional<tile_writer::Georeference> map_of(const TileOptions& options, const fs::path& first_file) {
  if (!options.crs.empty()) {
    tile_writer::Georeference place{options.crs, geometry::Vec3::Zero(), "--crs"};
    if (!options.offset.empty()) place.offset = geometry::Vec3(options.offset.data());
    return place;
  }
  std::optional<tile_writer::Georeference> place = tile_writer::find_georeference(first_file);
  std::error_code ignored;
  for (const std::string& mesh : options.meshes)
    if (!place && fs::is_directory(mesh, ignored)) place = tile_writer::find_georeference(fs::path(mesh) / "mesh");
  return place;
}

/// Finds the georeference of a mesh. `move` moves a mesh that is in map coordinates into a local frame, and returns
/// that frame.
MeshFrame place_on_earth(const TileOptions& options, const fs::path& first_file,
                         const std::function<geometry::LocalFrame(const tile_writer::Georeference&)>& move) {
  if (options.no_georeference) return {};
  if (!options.georeference.empty())
    return {geometry::LocalFrame({options.georeference[0], options.georeference[1],
                                  geometry::EllipsoidalHeight{options.georeference[2]}}),
            "--georeference"};
  const std::optional<tile_writer::Georeference> place = map_of(options, first_file);
  if (!place) return {};
  return {move(*place), place->stated_by};
}

nlohmann::json frame_json(const MeshFrame& place) {
  if (!place.frame) return nullptr;
  const geometry::Geodetic& origin = place.frame->origin();
  return {{"origin_lat", origin.latitude_deg},
          {"origin_lon", origin.longitude_deg},
          {"origin_height", origin.height.m},
          {"stated_by", place.stated_by}};
}

/// A tileset that has been written, and what the result says of it.
struct TiledMesh {
  tile_writer::MeshTilesetSummary summary;
  MeshFrame place;
  std::vector<std::string> warnings;
  bool out_of_core = false;
};

nlohmann::json result_of(const TileOptions& options, const TiledMesh& tiled) {
  nlohmann::json levels = nlohmann::json::array();
  for (const tile_writer::TilesetLevel& level : tiled.summary.levels)
    levels.push_back({{"tiles", level.tiles},
                      {"triangles", level.triangles},
                      {"texels", level.texels},
                      {"texel_m", level.texel_m},
                      {"geometric_error", level.geometric_error_m}});
  return {{"tileset", (fs::path(options.out) / "tileset.json").string()},
          {"bytes", tiled.summary.bytes},
          {"levels", levels},
          {"texture_scale", tiled.summary.texture_scale},
          {"out_of_core", tiled.out_of_core},
          {"frame", frame_json(tiled.place)},
          {"warnings", tiled.warnings}};
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

tile_writer::MeshTilesetOptions settings_of(const TileOptions& options, const MeshFrame& place,
                                            const std::vector<std::string>& copyrights) {
  tile_writer::MeshTilesetOptions settings = options.tileset;
  if (options.levels > 0) settings.levels = options.levels;
  if (place.frame) settings.T_ecef_local = place.frame->T_ecef_local();
  if (settings.copyright.empty() && !copyrights.empty()) settings.copyright = copyrights.front();
  settings.meshopt = options.compression == "meshopt";
  return settings;
}

TiledMesh tile_in_memory(const fs::path& folder, const std::vector<fs::path>& files, const TileOptions& options,
                         const Progress& progress) {
  report_progress(progress, 0, 0, "reading the mesh");
  mesh_files::MeshSource source = mesh_files::read_mesh_source(files, source_of(options));
  TiledMesh out;
  out.place = place_on_earth(options, files.front(), [&](const tile_writer::Georeference& place) {
    return tile_writer::reproject_to_local(place, source.meshes);
  });
  out.summary = tile_writer::write_mesh_tileset(folder, source.meshes,
                                                settings_of(options, out.place, source.copyrights), progress);
  out.warnings = std::move(source.warnings);
  return out;
}

/// Moves a mesh on disk from map coordinates into a local frame, and returns that frame.
geometry::LocalFrame move_to_local(const tile_writer::Georeference& place, mesh_files::MeshSpill& mesh) {
  geometry::Box3 extent;
  mesh.for_each_triangle([&](const mesh_files::SourceTriangle& t) {
    for (std::size_t k = 0; k < 3; ++k) extent.extend(t.corner(k));
  });
  const tile_writer::LocalPlacement placement = tile_writer::place_locally(place, extent);
  mesh.vertices.change(0, [&](mesh_files::SpilledVertex& vertex) {
    Eigen::Map<geometry::Vec3> position(vertex.position.data());
    position = placement.local_from_map(position);
  });
  return placement.frame;
}

// Tiling out of core takes this much of any mesh: its blocks have a fixed size (LargeMeshLimits).
constexpr std::uintmax_t kApartFromThreads_bytes = 1'200'000'000, kPerThread_bytes = 150'000'000, kFewestThreads = 2;
constexpr std::uintmax_t kMostOutOfCore_bytes = kApartFromThreads_bytes + kFewestThreads * kPerThread_bytes;

/// Memory that tiling out of core takes at most, bytes. A mesh that fits into the blocks takes no more than in memory.
std::uintmax_t out_of_core_bytes(std::uintmax_t in_memory_bytes) {
  return std::min(kMostOutOfCore_bytes, in_memory_bytes);
}

std::string gigabytes_text(std::uintmax_t bytes) { return rounded(static_cast<double>(bytes) / 1e9, 2) + " GB"; }

/// Throws InputError if the limit that was asked for is too small for either way.
void require_memory(const TileOptions& options, std::uintmax_t in_memory_bytes, std::uintmax_t memory_bytes) {
  const std::uintmax_t least = out_of_core_bytes(in_memory_bytes);
  if (!(options.memory_gb > 0.0) || least <= memory_bytes) return;
  throw InputError("--memory " + rounded(options.memory_gb, 3),
                   "is too little: this mesh would take about " + gigabytes_text(in_memory_bytes) +
                       " in memory and up to " + gigabytes_text(least) + " out of core; allow at least that");
}

TiledMesh tile_out_of_core(const fs::path& folder, const std::vector<fs::path>& files, const TileOptions& options,
                           std::uintmax_t memory_bytes, const Progress& progress) {
  // A triangle takes less space than in text; JPEG takes up to an eighth of the space of its pixels.
  const mesh_files::MeshFileSizes sizes = mesh_files::mesh_file_sizes(files, !options.no_textures);
  tile_writer::require_free_space(folder, 3 * sizes.meshes + 24 * sizes.images, "tiling a mesh of this size");
  TiledMesh out;
  out.out_of_core = true;
  fs::create_directories(folder);
  mesh_files::MeshSpill mesh(folder / "work");
  mesh_files::spill_mesh_source(files, source_of(options), mesh, progress);
  out.place = place_on_earth(options, files.front(),
                             [&](const tile_writer::Georeference& place) { return move_to_local(place, mesh); });
  tile_writer::LargeMeshLimits limits;
  limits.threads = static_cast<int>(std::clamp<std::uintmax_t>(
      (std::max(memory_bytes, kApartFromThreads_bytes) - kApartFromThreads_bytes) / kPerThread_bytes, kFewestThreads,
      256));
  out.summary = tile_writer::write_large_mesh_tileset(folder, mesh, settings_of(options, out.place, mesh.copyrights),
                                                      limits, progress);
  out.warnings = mesh.warnings;
  return out;
}

TiledMesh tile_files(const fs::path& folder, const TileOptions& options, const Progress& progress) {
  const std::vector<fs::path> files = mesh_files::list_mesh_files({options.meshes.begin(), options.meshes.end()});
  const std::uintmax_t memory_bytes =
      options.memory_gb > 0 ? static_cast<std::uintmax_t>(1e9 * options.memory_gb) : base::default_memory_bytes();
  constexpr std::uintmax_t kProgram_bytes = 40'000'000;
  const std::uintmax_t in_memory_bytes =
      kProgram_bytes + mesh_files::estimated_memory_bytes(files, !options.no_textures);
  require_memory(options, in_memory_bytes, memory_bytes);
  TiledMesh out = !options.out_of_core && in_memory_bytes <= memory_bytes
                      ? tile_in_memory(folder, files, options, progress)
                      : tile_out_of_core(folder, files, options, memory_bytes, progress);
  if (out.out_of_core && out_of_core_bytes(in_memory_bytes) > memory_bytes)
    out.warnings.push_back("tiling out of core takes up to " + gigabytes_text(out_of_core_bytes(in_memory_bytes)) +
                           ", more than half of this machine's memory");
  if (out.summary.texture_scale < 1.0)
    out.warnings.push_back("textures that did not fit into a tile's texture were scaled down, to " +
                           rounded(out.summary.texture_scale, 3) +
                           " of their size at the smallest; increase --texture-size to keep them");
  return out;
}

Output tile(const TileOptions& options, const CommonOptions& shared, const Progress& progress) {
  if (options.texture_format == "ktx2")
    throw InputError("--texture-format", "ktx2 cannot be written: no encoder for it is in Debian 12; use jpeg");
  nlohmann::json result;
  const base::OutputFolder output{.folder = options.out,
                                  .command = "tile",
                                  .replace = shared.force,
                                  .inputs = {options.meshes.begin(), options.meshes.end()}};
  base::write_folder(output, [&](const fs::path& temporary) {
    result = result_of(options, tile_files(temporary, options, progress));
  });
  return {result, text_of(result)};
}

void add_options(CLI::App& command, TileOptions& options) {
  command
      .add_option("MESH", options.meshes,
                  "mesh: .obj (with .mtl and textures), .glb, .gltf or .ply; several files, or folders of them, are "
                  "tiled as one mesh")
      ->required();
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
  command.add_flag("--no-textures", options.no_textures,
                   "read no textures: tiles show the colours of materials and vertices");
  command
      .add_option("--memory", options.memory_gb,
                  "memory limit, GB (default: half of the machine's); a mesh that needs more is tiled out of core, in "
                  "about 2 GB whatever its size, with temporary files beside the output; a limit below what that takes "
                  "(up to 1.5 GB) is refused")
      ->check(CLI::PositiveNumber);
  command.add_flag("--out-of-core", options.out_of_core, "tile out of core, also a mesh that fits into memory");
  command.add_flag("--implicit", options.tileset.implicit,
                   "implicit tiling: subtree files instead of a list of all tiles in tileset.json");
  command
      .add_option("--compression", options.compression,
                  "compression of geometry: none or meshopt (EXT_meshopt_compression, lossless; default: none)")
      ->check(CLI::IsMember({"none", "meshopt"}));
  command
      .add_option("--texture-format", options.texture_format,
                  "format of textures: jpeg (ktx2 cannot be written; default: jpeg)")
      ->check(CLI::IsMember({"jpeg", "ktx2"}));
}

}  // namespace

void add_tile(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<TileOptions>();
  CLI::App* command = app.add_subcommand("tile", "convert a mesh to 3D Tiles with levels of detail");
  command->footer(
      "Example:\n  tileflight tile odm_textured_model_geo.obj --out tiles\n"
      "  tileflight tile scan.glb --georeference 50.8231,14.2210,312.5 --out tiles\n"
      "  tileflight tile city/ --out tiles --memory 2 --implicit --compression meshopt");
  add_options(*command, *options);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      return tile(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
