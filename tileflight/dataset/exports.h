#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/progress.h"

/// One writer for each layout that export_dataset knows: fills an empty folder. `notes` takes what the layout has no
/// place for. All throw InputError.
namespace tileflight::dataset::exports {

using Writer = std::function<void(const Dataset& dataset, const std::filesystem::path& folder,
                                  std::vector<std::string>& notes, const Progress& progress)>;

void write_tum_mono(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                    const Progress& progress);
void write_euroc(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_kitti(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_colmap_folder(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                         const Progress& progress);

/// A file name for each frame.
using NameOf = std::function<std::string(std::size_t index)>;

/// Frames' files as they are, under other names (without the ending) in `folder`, which is made.
void copy_frames(const Dataset& dataset, const std::filesystem::path& folder, const NameOf& stem_of,
                 const Progress& progress);
/// The same as PNG, encoded anew where they are not.
void write_png_frames(const Dataset& dataset, const std::filesystem::path& folder, const NameOf& stem_of,
                      const Progress& progress);

/// "000042"
std::string numbered(std::size_t index);

}  // namespace tileflight::dataset::exports
