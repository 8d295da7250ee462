#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::dataset {

/// Object that a segmentation id stands for; a line of segmentation.csv.
struct SegmentedObject {
  std::string tile;
  std::uint32_t mesh = 0;  ///< mesh of the tile: the first one whose feature ids have the same meaning as this one's
  std::optional<std::uint32_t> feature;
  std::string name;  ///< empty if it has none

  auto operator<=>(const SegmentedObject&) const = default;
};

/// Outputs of a SegmentationWriter.
struct SegmentationOptions {
  bool segmentation = true;  ///< segmentation/000000.png
  bool infrared = false;     ///< infrared/000000.png
  /// Folder of the frames' intermediate files until finish(). Empty: inside the dataset's folder, removed by finish();
  /// otherwise the files are kept.
  std::filesystem::path runs_folder{};
};

/// Writes the segmentation of a flight: 16-bit grey images of object ids, 0 for no object, and segmentation.csv
/// (id,tile,mesh,feature,name). Ids 1, 2, ... are given to the objects seen, ordered by tile, mesh and feature: they do
/// not depend on the order of frames, on threads, or on how the place was read. Infrared is AirSim's image of that
/// name, 8-bit grey by object id: (id - 1) mod 255 + 1, 0 for no object.
class SegmentationWriter {
 public:
  /// Writes into an existing dataset folder. Frames added there by another writer that was not finished are included.
  SegmentationWriter(std::filesystem::path dataset_folder, const SegmentationOptions& options);

  /// Adds a frame. `labels`: 0, or 1 + index into `objects`, which may differ between calls. Several threads (and
  /// processes, each with its own writer) may add at once. Throws InputError.
  void add(std::size_t index, const imaging::Image<std::uint32_t>& labels,
           std::span<const SegmentedObject> objects) const;
  /// Numbers the objects of all frames and writes the files. Throws InputError: more than 65535 objects were seen.
  void finish() const;

 private:
  using Ids = std::map<SegmentedObject, std::uint16_t>;

  std::vector<std::string> list_frames() const;
  Ids assign_ids(const std::vector<std::string>& frames) const;
  void write_frame(const std::string& name, const Ids& ids) const;
  void write_table(const Ids& ids) const;

  std::filesystem::path folder_, runs_folder_;
  SegmentationOptions options_;
};

}  // namespace tileflight::dataset
