#include "tileflight/live/publishing/place_glb.h"

#include <algorithm>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/tiles/simplification/place_model.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/ground_truth/truth_folder.h"

namespace tileflight::publishing {
namespace {

namespace fs = std::filesystem;

constexpr double kSurroundings_m = 100.0;  ///< around the path
/// Tiles are read at an error of this share of the extent: a pixel of a large window.
constexpr double kErrorShare = 1.0 / 1000.0;
constexpr std::uintmax_t kMaxMemoryBytes = std::uintmax_t{2} << 30U;

bool has_triangles(const std::vector<imaging::TexturedMesh>& meshes) {
  return std::ranges::any_of(meshes, [](const auto& one) { return !one.mesh.triangles.empty(); });
}

PlaceGlb packed(const simplification::PlaceModel& model, const std::vector<std::string>& attribution) {
  std::string line;
  for (const std::string& one : attribution) line += (line.empty() ? "" : "; ") + one;
  return {imaging::write_glb({model.mesh}, {.copyright = line}), attribution};
}

bool is_truth_folder(const fs::path& place) {
  return fs::is_regular_file(place / "index.json") || fs::is_regular_file(place / "mesh.glb");
}

PlaceGlb of_truth(const fs::path& folder) {
  const ground_truth::TruthFolder truth(folder);
  std::vector<fs::path> files;
  for (std::size_t part = 0; part < truth.size(); ++part) {
    if (truth.has_mesh(part)) files.push_back(truth.folder_of(part) / "mesh.glb");
  }
  if (files.empty()) throw InputError(folder.string(), "holds no triangles to show");
  return packed(simplification::read_place_model(files), {});
}

double metadata_number(const dataset::Dataset& dataset, const std::string& key) {
  const auto at = dataset.metadata.find(key);
  const std::optional<double> value =
      at == dataset.metadata.end() ? std::nullopt : base::parse_finite_number(at->second);
  if (!value) throw InputError((dataset.folder / "dataset.yaml").string(), key + " is missing or not a number");
  return *value;
}

/// The local frame that dataset.yaml names; nullopt: the tileset's own.
std::optional<geometry::Geodetic> origin_of(const dataset::Dataset& dataset) {
  const auto kind = dataset.metadata.find("frame.kind");
  if (kind == dataset.metadata.end() || kind->second != "east-north-up") return std::nullopt;
  return geometry::Geodetic{metadata_number(dataset, "frame.origin_lat"),
                            metadata_number(dataset, "frame.origin_lon"),
                            {metadata_number(dataset, "frame.origin_height")}};
}

/// Around the true path, with the height of the tileset.
tileset::LoadOptions surroundings(const dataset::Dataset& dataset) {
  if (!dataset.groundtruth)
    throw InputError(dataset.folder.string(), "has no true path (groundtruth.txt) whose surroundings could be shown");
  geometry::Box3 box;
  for (const geometry::StampedPose& pose : dataset.groundtruth->poses) box.extend(pose.T_local_camera.translation);
  const double unspecified = std::numeric_limits<double>::quiet_NaN();
  tileset::LoadOptions load;
  load.origin = origin_of(dataset);
  load.center_local = geometry::Vec3(box.center().x(), box.center().y(), unspecified);
  load.size = geometry::Vec3(box.sizes().x() + 2 * kSurroundings_m, box.sizes().y() + 2 * kSurroundings_m, unspecified);
  load.error_m = load.size->head<2>().maxCoeff() * kErrorShare;
  load.allow_large_area = load.allow_incomplete = true;
  load.max_memory_bytes = kMaxMemoryBytes;
  return load;
}

}  // namespace

std::optional<PlaceGlb> make_place_glb(const std::vector<imaging::TexturedMesh>& meshes,
                                       const std::vector<std::string>& attribution) {
  if (!has_triangles(meshes)) return std::nullopt;
  return packed(simplification::make_place_model(meshes), attribution);
}

PlaceGlb read_place_glb(const std::string& place, const fetch::SourceOptions& source, const dataset::Dataset& dataset,
                        const Progress& progress) {
  if (is_truth_folder(place)) return of_truth(place);
  tileset::LoadOptions load = surroundings(dataset);
  load.source = source;
  const tileset::LoadedTiles loaded = tileset::load_region(place, load, progress);
  std::optional<PlaceGlb> glb = make_place_glb(loaded.meshes, loaded.attribution);
  if (!glb) throw InputError(place, "has no triangles around the dataset's path");
  return *std::move(glb);
}

}  // namespace tileflight::publishing
