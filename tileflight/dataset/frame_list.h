#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"

namespace tileflight::dataset {

/// Frame period where no times are known, seconds.
inline constexpr double kDefaultPeriod_s = 1.0 / 30.0;

/// Name of a frame's files in the contract's layout, without ending: "000007".
std::string frame_id(std::size_t index);

/// Image files (.jpg, .jpeg, .png, .webp) of a folder, by name. Throws InputError when there are none.
std::vector<std::filesystem::path> list_images(const std::filesystem::path& folder);

/// Images with the times of `times_file`: lines "id seconds [exposure_ms]" (DSO, TUM monoVO) matched by the image's
/// name without extension, or bare seconds (KITTI) in the images' order. What is put up with goes to `warnings`. Throws
/// InputError: malformed lines, a line without its image, times that do not increase.
std::vector<Frame> frames_with_times(const std::vector<std::filesystem::path>& images,
                                     const std::filesystem::path& times_file, std::vector<std::string>& warnings);

/// Images `period_s` apart, the first at 0.
std::vector<Frame> frames_at_rate(const std::vector<std::filesystem::path>& images, double period_s);

/// Throws InputError unless times strictly increase.
void require_increasing_times(const std::vector<Frame>& frames, const std::filesystem::path& file);

}  // namespace tileflight::dataset
