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

#include "tileflight/imaging/image.h"

namespace tileflight::dataset {

/// What an id of a segmentation stands for; a line of segmentation.csv.
struct SegmentedObject {
  std::string tile;
  std::uint32_t mesh = 0;  ///< of the tile: the first one whose feature ids mean the same as this one's
  std::optional<std::uint32_t> feature;
  std::string name;  ///< empty where there is none

  auto operator<=>(const SegmentedObject&) const = default;
};

struct SegmentationOptions {
  bool segmentation = true;  ///< segmentation/000000.png
  bool infrared = false;     ///< infrared/000000.png
  /// Where frames are kept until finish(). Empty: in the dataset's folder, and gone after finish(); else they stay.
  std::filesystem::path runs{};
};

/// The segmentation of a flight: 16-bit grey pictures of object ids, 0 where there is nothing, and segmentation.csv
/// (id,tile,mesh,feature,name). Ids are 1, 2, ... of the objects that are seen, ordered by tile, mesh and feature: they
/// do not depend on the order of the frames, on threads, or on how the place was read. Infrared is AirSim's picture of
/// that name, 8-bit grey by object number: (id - 1) mod 255 + 1, 0 where there is nothing.
class SegmentationWriter {
 public:
  /// Into a dataset's folder, which must be there. Frames that another writer added there and did not finish count.
  SegmentationWriter(std::filesystem::path dataset_folder, const SegmentationOptions& options);

  /// `labels`: 0, or 1 + index into `objects`, which may be other ones each time. Several threads (and processes, each
  /// with a writer of its own) may add at once. Throws InputError.
  void add(std::size_t index, const imaging::Image<std::uint32_t>& labels,
           std::span<const SegmentedObject> objects) const;
  /// Numbers the objects of all frames and writes the files. Throws InputError: more than 65535 objects were seen.
  void finish() const;

 private:
  using Ids = std::map<SegmentedObject, std::uint16_t>;

  std::vector<std::string> frames() const;
  Ids ids_of(const std::vector<std::string>& frames) const;
  void write_frame(const std::string& name, const Ids& ids) const;
  void write_table(const Ids& ids) const;

  std::filesystem::path folder_, runs_;
  SegmentationOptions options_;
};

}  // namespace tileflight::dataset
