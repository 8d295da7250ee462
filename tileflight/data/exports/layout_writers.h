#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/rig.h"

/// One writer per layout of export_dataset; each fills an empty folder. `notes` receives the data that the layout
/// cannot store. All throw InputError.
namespace tileflight::exports {

using LayoutWriter = std::function<void(const dataset::Rig& rig, const std::filesystem::path& folder,
                                        std::vector<std::string>& notes, const Progress& progress)>;

void write_euroc(const dataset::Rig& rig, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_kitti(const dataset::Rig& rig, const std::filesystem::path& folder, std::vector<std::string>& notes,
                 const Progress& progress);
void write_vslam_lab(const dataset::Rig& rig, const std::filesystem::path& folder, std::vector<std::string>& notes,
                     const Progress& progress);
void write_colmap_folder(const dataset::Rig& rig, const std::filesystem::path& folder, std::vector<std::string>& notes,
                         const Progress& progress);

/// Adds the warnings that reading the rig's cameras gave. Every layout begins its notes with them.
void note_reading_warnings(const dataset::Rig& rig, std::vector<std::string>& notes);

/// Adds a note for each camera beyond the first `held`, which the layout has no place for.
void note_cameras_left_out(const dataset::Rig& rig, std::size_t held, std::vector<std::string>& notes);

/// Adds one note that names the dataset's files and folders besides images, calibration and true poses that are not in
/// `held`: "depth", "lidar", "imu.csv", … (docs/formats.md, A dataset).
void note_data_left_out(const dataset::Rig& rig, const std::vector<std::string>& held, std::vector<std::string>& notes);

/// Returns the frames of the first two cameras at each instant at which both took one. Precondition: there are two.
std::vector<std::array<std::size_t, 2>> stereo_pairs(const dataset::Rig& rig);

/// Returns the file name of a frame.
using FrameNamer = std::function<std::string(std::size_t index)>;

/// Copies the frames' files under other names (without extension) into `folder`, which is created.
void copy_frames(const dataset::Dataset& dataset, const std::filesystem::path& folder, const FrameNamer& stem_of,
                 const Progress& progress);
/// Copies the frames as copy_frames() does, but writes PNG; other formats are re-encoded.
void write_png_frames(const dataset::Dataset& dataset, const std::filesystem::path& folder, const FrameNamer& stem_of,
                      const Progress& progress);

/// Returns the mean rate of the frames, rounded to a millionth; 1 for a single frame.
double frame_rate_hz(const dataset::Dataset& dataset);

}  // namespace tileflight::exports
