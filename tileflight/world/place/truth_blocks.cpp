#include "tileflight/world/place/truth_blocks.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/world/ground_truth/ground_truth.h"
#include "tileflight/world/place/block_plan.h"
#include "tileflight/world/place/block_store.h"

namespace tileflight::place {
namespace {

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;

struct Surfaces {
  std::vector<imaging::TexturedMesh> meshes;
  std::vector<ground_truth::MeshOrigin> origins;  ///< of each mesh
  std::vector<geometry::PointCloud> clouds;
};

/// Place of a content's meshes in the order of the region.
void add_origins(std::size_t number, const tileset::LoadedContent& content,
                 std::vector<ground_truth::MeshOrigin>& origins) {
  std::size_t first = 0;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    origins.push_back({static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(first), {}});
    first += mesh.mesh.triangles.size();
  }
}

/// Reads contents; removes from the list the numbers of those that are left out.
std::vector<tileset::LoadedContent> read_contents(tileset::RegionReader& reader, std::vector<std::size_t>& numbers,
                                                  const Progress& progress) {
  std::vector<tileset::LoadedContent> loaded = reader.read(numbers, progress);
  std::erase_if(numbers, [&](const std::size_t number) { return reader.is_left_out(number); });
  return loaded;
}

/// Reads contents of the region; adds what was read to the counts.
Surfaces read_surfaces(tileset::RegionReader& reader, std::vector<std::size_t> contents, TruthCounts& counts,
                       const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  Surfaces surfaces;
  std::vector<tileset::LoadedContent> loaded = read_contents(reader, contents, progress);
  for (std::size_t k = 0; k < loaded.size(); ++k) {
    tileset::LoadedContent& content = loaded[k];
    for (const imaging::TexturedMesh& mesh : content.meshes) {
      for (const Vec3& vertex : mesh.mesh.vertices) counts.extent.extend(vertex);
    }
    for (const geometry::PointCloud& cloud : content.clouds) {
      for (const Vec3& point : cloud.positions) counts.extent.extend(point);
    }
    add_origins(contents[k], content, surfaces.origins);
    std::move(content.meshes.begin(), content.meshes.end(), std::back_inserter(surfaces.meshes));
    std::move(content.clouds.begin(), content.clouds.end(), std::back_inserter(surfaces.clouds));
  }
  counts.load_seconds += base::seconds_since(start);
  return surfaces;
}

void add(const ground_truth::GroundTruthSummary& part, TruthCounts& counts) {
  counts.triangles += part.triangles;
  counts.surface_points += part.surface_points;
  counts.cloud_points += part.cloud_points;
  counts.voxels_occupied += part.voxels.occupied.size();
  counts.voxel_dims = part.voxels.dims;
  counts.floor.add(part.quantization_floor_m);
}

ground_truth::GroundTruthOptions truth_options(const tileset::RegionReader& reader, const ExtractSettings& settings) {
  return {.voxel_m = settings.voxel_m,
          .samples_per_m2 = settings.samples_per_m2,
          .prisms = reader.placement().region.parts};
}

/// Throws InputError, with the cause, if nothing that was read reaches into the region.
void require_surface_in_region(const tileset::RegionReader& reader, const TruthCounts& counts) {
  const Box3 region = reader.placement().region.box();
  if (!counts.extent.isEmpty() && counts.extent.intersects(region)) return;
  const tileset::LoadedTiles read = reader.summary();
  if (!read.failures.empty()) {
    throw InputError(read.failures.front(), "nothing else is in the region: " + std::to_string(read.tiles_failed) +
                                                " of its " + std::to_string(read.tiles_wanted) +
                                                " tiles could not be read");
  }
  if (counts.extent.isEmpty()) throw InputError("region", "its tiles hold neither triangles nor points");
  throw InputError("region", "contains no triangle: it spans " + tileset::describe_extent(region) +
                                 ", and its tiles hold surface within " + tileset::describe_extent(counts.extent) +
                                 "; check its centre, size and height");
}

std::string part_text(const JobPart& part) { return std::to_string(part.number) + "-of-" + std::to_string(part.count); }

}  // namespace

TruthCounts write_whole_truth(tileset::RegionReader& reader, const ExtractSettings& settings,
                              const std::filesystem::path& folder, const Progress& progress) {
  TruthCounts counts(settings.voxel_m);
  Surfaces surfaces = read_surfaces(reader, reader.all_contents(), counts, progress);
  require_surface_in_region(reader, counts);
  require_memory(surfaces.meshes, surfaces.clouds, reader.placement().region.box(), 0.0, settings);
  add(ground_truth::write_ground_truth(std::move(surfaces.meshes), reader.placement().region.box(),
                                       truth_options(reader, settings), folder, progress, surfaces.clouds),
      counts);
  return counts;
}

struct TruthBlocks::Impl {
  Impl(tileset::RegionReader& reader, const ExtractSettings& settings, const std::filesystem::path& output,
       const Progress& progress)
      : reader_(reader),
        settings_(settings),
        progress_(progress),
        options_(truth_options(reader, settings)),
        keeps_(settings.resume || settings.part || BlockStore::exists(output)),
        grid_(prepare(output)),
        store_(output, settings.part ? part_text(*settings.part) : "all", share()) {}
  ~Impl() {
    if (!keeps_) store_.remove();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  jobs::Share share() const { return settings_.part ? jobs::Share::kPart : jobs::Share::kWhole; }

  /// Prepares the store for blocks of one grid.
  BlockGrid prepare(const std::filesystem::path& output) {
    json inputs = truth_inputs(reader_, settings_);
    const std::int32_t edge = choose_edge(reader_, settings_, inputs, BlockStore::folder_for(output));
    BlockGrid grid(reader_.placement().region.box(), settings_.voxel_m, edge);
    inputs["block"] = edge;
    note_ = BlockStore::prepare(output, inputs, share());
    return grid;
  }

  void make() {
    const std::vector<std::size_t> missing = find_missing();
    const std::vector<double> costs = block_costs(reader_, grid_);
    reused_ = grid_.size() - missing.size();
    make(own_share(missing, costs));
    // A tile may hold more than its bounding volume says; now that all are read, it is known where.
    if (!settings_.part) make(find_missed());
  }

  TruthCounts join() {
    TruthCounts counts(settings_.voxel_m);
    json index = json::array();
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      const std::string name = grid_.name(i);
      const std::optional<BlockRecord> block = store_.read(name);
      if (!block) throw InputError(store_.folder().path().string(), "lacks block " + name + ": run the command again");
      learn(*block);
      counts.triangles += block->triangles;
      counts.surface_points += block->surface_points;
      counts.cloud_points += block->cloud_points;
      counts.voxels_occupied += block->voxels_occupied;
      store_.add_floor(name, counts.floor);
      if (block->has_files) index.push_back(index_entry(i, *block));
    }
    if (counts.triangles == 0 && counts.cloud_points == 0) {
      store_.remove();
      require_surface_in_region(reader_, reading_);
      throw InputError("region", "contains no triangle: check its centre, size and height");
    }
    for (std::size_t i = 0; i < reader_.content_count(); ++i) {
      if (const auto& content = reader_.found(i); content && !content->bounds.isEmpty())
        counts.extent.extend(content->bounds);
    }
    counts.voxel_dims = grid_.dims();
    counts.load_seconds = reading_.load_seconds;
    base::write_file(store_.truth_folder() / "index.json",
                     json{{"block", grid_.edge_m()}, {"blocks", index}}.dump(2) + "\n");
    return counts;
  }

  json index_entry(std::size_t i, const BlockRecord& block) const {
    const Box3 bounds = grid_.bounds(i);
    const Vec3 low = bounds.min(), high = bounds.max();
    return {{"folder", "blocks/" + grid_.name(i)},
            {"min", {low.x(), low.y(), low.z()}},
            {"max", {high.x(), high.y(), high.z()}},
            {"triangles", block.triangles},
            {"voxels_occupied", block.voxels_occupied}};
  }

  /// Those of the missing blocks that this process makes.
  std::vector<std::size_t> own_share(const std::vector<std::size_t>& missing, const std::vector<double>& costs) const {
    if (!settings_.part) return missing;
    const jobs::IndexRange part = jobs::balanced_ranges(
        costs, static_cast<std::size_t>(settings_.part->count))[static_cast<std::size_t>(settings_.part->number - 1)];
    std::vector<std::size_t> own;
    std::ranges::copy_if(missing, std::back_inserter(own), [&](std::size_t block) { return part.contains(block); });
    return own;
  }

  std::vector<std::size_t> find_missing() const {
    std::vector<std::size_t> missing;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      if (!store_.read(grid_.name(i))) missing.push_back(i);
    }
    return missing;
  }

  void learn(const BlockRecord& block) {
    for (const auto& [content, record] : block.contents) {
      if (content < reader_.content_count()) reader_.learn(content, record);
    }
    for (const fetch::CountedFile& file : block.files) reader_.count_file(file);
  }

  /// The records of all blocks, whose contents are then known to this process.
  std::vector<BlockRecord> learn_all() {
    std::vector<BlockRecord> blocks;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      blocks.push_back(store_.read(grid_.name(i)).value_or(BlockRecord()));
      learn(blocks.back());
    }
    return blocks;
  }

  /// The blocks that lack a content which is now known to reach into them.
  std::vector<std::size_t> find_missed() {
    const std::vector<BlockRecord> blocks = learn_all();
    std::vector<std::size_t> missed;
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      const std::vector<std::size_t> wanted = reader_.contents_in(grid_.reach(i, blocks[i].border));
      const bool has_all = std::ranges::all_of(wanted, [&](std::size_t c) { return blocks[i].contents.contains(c); });
      if (!has_all) missed.push_back(i);
    }
    return missed;
  }

  void make(const std::vector<std::size_t>& blocks) {
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      report_progress(progress_, static_cast<std::int64_t>(k), static_cast<std::int64_t>(blocks.size()), "blocks");
      const auto make_files = [&](const std::filesystem::path& folder) { return write(blocks[k], folder); };
      store_.add(grid_.name(blocks[k]), make_files);
      ++made_;
    }
  }

  std::pair<BlockRecord, ground_truth::QuantizationFloor> write(std::size_t block,
                                                                const std::filesystem::path& folder) {
    // Contents that were read for this block before count as read.
    BlockRecord record = store_.read(grid_.name(block)).value_or(BlockRecord());
    learn(record);
    ground_truth::GroundTruthSummary part;
    for (std::int32_t border = 1;; border *= 2) {
      const std::vector<std::size_t> contents = reader_.contents_in(grid_.reach(block, border));
      Surfaces surfaces = read_surfaces(reader_, contents, reading_, {});
      require_memory(surfaces.meshes, surfaces.clouds, grid_.reach(block, border), grid_.edge_m(), settings_);
      options_.block = {grid_.cells(block), border, std::move(surfaces.origins)};
      part = write_ground_truth(std::move(surfaces.meshes), reader_.placement().region.box(), options_, folder, {},
                                surfaces.clouds);
      for (const std::size_t content : contents) record.contents.try_emplace(content, *reader_.found(content));
      if (part.border_too_narrow) continue;
      record.border = border;
      break;
    }
    for (fetch::CountedFile& file : reader_.take_new_files()) record.files.push_back(std::move(file));
    record.triangles = part.triangles;
    record.surface_points = part.surface_points;
    record.cloud_points = part.cloud_points;
    record.voxels_occupied = part.voxels.occupied.size();
    ground_truth::QuantizationFloor floor(settings_.voxel_m);
    floor.add(part.quantization_floor_m);
    return {std::move(record), std::move(floor)};
  }

  tileset::RegionReader& reader_;
  const ExtractSettings& settings_;
  const Progress& progress_;
  ground_truth::GroundTruthOptions options_;
  bool keeps_;
  std::string note_;
  BlockGrid grid_;
  BlockStore store_;
  TruthCounts reading_{1.0};  ///< time spent reading
  std::size_t reused_ = 0, made_ = 0;
};

TruthBlocks::TruthBlocks(tileset::RegionReader& reader, const ExtractSettings& settings,
                         const std::filesystem::path& output, const Progress& progress)
    : impl_(std::make_unique<Impl>(reader, settings, output, progress)) {}

TruthBlocks::~TruthBlocks() = default;

void TruthBlocks::make() { impl_->make(); }

TruthCounts TruthBlocks::join() { return impl_->join(); }

std::filesystem::path TruthBlocks::truth_folder() const { return impl_->store_.truth_folder(); }

void TruthBlocks::remove() { impl_->store_.remove(); }

double TruthBlocks::edge_m() const { return impl_->grid_.edge_m(); }
std::size_t TruthBlocks::count() const { return impl_->grid_.size(); }
std::size_t TruthBlocks::reused() const { return impl_->reused_; }
std::size_t TruthBlocks::made() const { return impl_->made_; }
const std::string& TruthBlocks::note() const { return impl_->note_; }

std::filesystem::path block_build_folder(const std::filesystem::path& output) { return BlockStore::folder_for(output); }

}  // namespace tileflight::place
