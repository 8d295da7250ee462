#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tileflight::experiment {

/// What may be given to our odometry and asked of it beside the pictures; all of it optional.
struct TrackExtras {
  std::filesystem::path camera;           ///< a calibration instead of the dataset's
  std::string camera_id;                  ///< which of several cameras in it
  std::filesystem::path mask;             ///< picture of the frames' size; dark where there is nothing of the scene
  std::optional<double> rectify_fov_deg;  ///< rectify to a pinhole of this horizontal field of view first
  std::filesystem::path init_from;        ///< TUM poses (a file), or depth/000000.exr by frame (a folder)
  bool colmap = false;                    ///< write colmap/ into the output folder
  std::filesystem::path debug_pictures;   ///< folder for a picture of each keyframe with its points
  bool second_opinion = true;  ///< track the pictures in the other direction too, and doubt what does not agree
};

}  // namespace tileflight::experiment
