#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

/// Frame period used if times are unknown, seconds.
inline constexpr double kDefaultFramePeriod_s = 1.0 / 30.0;

/// Returns the stem of a frame's file names in our own layout: "000007".
std::string frame_id(std::size_t index);

/// Lists the image files (imaging::is_image_name) of a folder, in the natural order of their names: frame_2 before
/// frame_10. Throws InputError if there are none.
std::vector<std::filesystem::path> list_images(const std::filesystem::path& folder);

/// Adds a note if the natural order of listed images is not that of their bytes, by which other programs sort.
void note_order_by_numbers(const std::vector<std::filesystem::path>& images, std::vector<std::string>& notes);

/// Adds a warning if frames in time order are not in the natural order of their names. `where`: what states the times.
void warn_of_order(const std::vector<Frame>& frames, const std::string& where, std::vector<std::string>& warnings);

/// Gives images the times of `times_file`: lines "id seconds [exposure_ms]" (DSO, TUM monoVO) are matched by the
/// image's stem, bare seconds (KITTI) in the order of the images. Tolerated problems are added to `warnings`. Throws
/// InputError: malformed lines, a line without its image, times that do not increase.
std::vector<Frame> read_timed_frames(const std::vector<std::filesystem::path>& images,
                                     const std::filesystem::path& times_file, std::vector<std::string>& warnings);

/// Gives images times that are `period_s` apart, the first at 0.
std::vector<Frame> make_uniform_frames(const std::vector<std::filesystem::path>& images, double period_s);

/// Throws InputError unless times strictly increase.
void require_increasing_times(const std::vector<Frame>& frames, const std::filesystem::path& file);

}  // namespace tileflight::dataset
