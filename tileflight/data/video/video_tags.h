#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace tileflight::video {

/// Returns what a video's container and first video track say of themselves, as libavformat names it: make, model,
/// encoder, firmware, com.apple.quicktime.model and others. Throws InputError (file, cause) for a file that is no
/// video.
std::map<std::string, std::string> read_video_tags(const std::filesystem::path& file);

}  // namespace tileflight::video
