#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::video {

/// A track of a video that holds neither images nor sound nor text.
struct DataTrack {
  std::string kind;                       ///< its four letters: "gpmd"
  std::vector<base::TimedBytes> samples;  ///< in the order of time, which is that after the first frame
};

/// Reads the track of an MP4 or MOV file whose four letters are the first of `kinds` that it has; nullopt if it has
/// none. A last sample that would outlast the images ends with them: cameras write a whole second for what they
/// collected in a part of it. Throws InputError (file, cause) for a file that is no video and for a track of more than
/// 1 GiB.
std::optional<DataTrack> read_data_track(const std::filesystem::path& file, std::span<const std::string_view> kinds);

/// Reads the box `moov/udta/NAME` of an MP4 or MOV file, in which cameras keep what holds for a whole recording; empty
/// if there is none, or more than 16 MiB.
std::vector<std::byte> read_user_data(const std::filesystem::path& file, std::string_view name);

/// Returns what a video's container and first video track say of themselves, as libavformat names it: make, model,
/// encoder, firmware, com.apple.quicktime.model and others. Throws InputError (file, cause) for a file that is no
/// video.
std::map<std::string, std::string> read_video_tags(const std::filesystem::path& file);

}  // namespace tileflight::video
