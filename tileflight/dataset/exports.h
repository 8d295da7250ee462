#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/dataset/dataset.h"

/// One writer per layout of export_dataset; each fills an empty folder. `notes` receives the data that the layout
/// cannot store. All throw InputError.
namespace tileflight::dataset::exports {

using LayoutWriter = std::function<void(const Dataset& dataset, const std::filesystem::path& folder,
                                        std::vector<std::string>& notes, const Progress& progress)>;

void write_tum_mono(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                    const Progress& progress);
void write_euroc(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_kitti(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_vslam_lab(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                     const Progress& progress);
void write_colmap_folder(const Dataset& dataset, const std::filesystem::path& folder, std::vector<std::string>& notes,
                         const Progress& progress);

/// Returns the file name of a frame.
using FrameNamer = std::function<std::string(std::size_t index)>;

/// Copies the frames' files under other names (without extension) into `folder`, which is created.
void copy_frames(const Dataset& dataset, const std::filesystem::path& folder, const FrameNamer& stem_of,
                 const Progress& progress);
/// As copy_frames(), but writes PNG; other formats are re-encoded.
void write_png_frames(const Dataset& dataset, const std::filesystem::path& folder, const FrameNamer& stem_of,
                      const Progress& progress);

/// Mean rate of the frames, rounded to a millionth; 1 for a single frame.
double frame_rate_hz(const Dataset& dataset);

/// "000042"
std::string frame_stem(std::size_t index);

}  // namespace tileflight::dataset::exports
