#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tileflight::survey {

/// Optional inputs and outputs of the built-in odometry besides the images.
struct TrackOptions {
  std::filesystem::path camera;           ///< calibration that replaces the dataset's
  std::string camera_id;                  ///< which of several cameras in it
  std::filesystem::path mask;             ///< image of the frames' size; dark pixels are ignored
  std::optional<double> rectify_fov_deg;  ///< rectify to a pinhole of this horizontal field of view first
  std::filesystem::path init_from;        ///< TUM poses (a file), or depth/000000.exr by frame (a folder)
  bool colmap = false;                    ///< write colmap/ into the output folder
  std::filesystem::path debug_pictures;   ///< folder for an image of each keyframe with its points
  bool check_reversed = true;  ///< also track the images in reverse order, and report a doubt if the results disagree
};

}  // namespace tileflight::survey
