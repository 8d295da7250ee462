#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/report/run_folder.h"

namespace tileflight::report {

/// Pictures of two flights that look at the place from about the same pose.
struct FramePair {
  FrameFile first, second;
  std::optional<double> distance_m;  ///< between the cameras, where both poses are known
  std::optional<double> angle_deg;
};

/// At most `count` pairs whose poses (aligned estimates, else true poses) are most alike, in the order of the first
/// flight; a picture is in one pair only, and so are its neighbours. Pictures that look in quite other directions are
/// no pair: there may be fewer. Without poses, or without any pair, pictures at the same share of both flights.
std::vector<FramePair> frame_pairs(const FlightRun& first, const FlightRun& second, std::size_t count);

/// `count` pictures spread evenly over a flight.
std::vector<FrameFile> spread(const std::vector<FrameFile>& frames, std::size_t count);

/// The image scaled down to at most `width` pixels across (mean of the pixels that fall into one; never up).
imaging::RgbImage scaled_down(const imaging::RgbImage& image, int width);

/// The picture scaled down, as a JPEG in a data URI.
std::string thumbnail_uri(const std::filesystem::path& image, int width);

}  // namespace tileflight::report
