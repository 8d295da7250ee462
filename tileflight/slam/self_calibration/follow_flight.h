#pragma once

// Reads the images of a flight, and follows corners through segments of it.

#include <filesystem>
#include <optional>

#include "tileflight/core/base/progress.h"
#include "tileflight/slam/self_calibration/corner_segments.h"

namespace tileflight::self_calibration {

/// Selects which images of a flight are read, and how.
struct FlightImages {
  double from_s = 0.0;                  ///< after the first image; of images without times, 1/30 s apart
  std::optional<double> to_s;           ///< exclusive
  int every = 1;                        ///< each n-th image
  std::optional<double> image_rate_hz;  ///< of a folder of images; none: their times are unknown
  std::filesystem::path mask;           ///< image of the images' size; dark pixels are ignored
};

/// Returns whether a folder is a dataset of any layout, rather than a folder of images.
bool is_dataset(const std::filesystem::path& source);

/// Follows corners through the segments of a video, of a dataset folder, or of a folder of images in the order of their
/// names. Segments begin at even distances; one that is longer makes the next one begin later. Throws InputError as
/// estimate_lens().
FollowedFlight follow_flight(const std::filesystem::path& source, const FlightImages& images,
                             const SegmentOptions& options, const Progress& progress = {});

}  // namespace tileflight::self_calibration
