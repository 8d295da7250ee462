#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/localization/flight_localizer.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::scoring {

/// Inputs and settings of localize().
struct LocalizeSettings {
  std::filesystem::path dataset;
  std::string place;                 ///< tileset, as extract() takes it, or a folder that extract() wrote
  tileset::LoadOptions load;         ///< of a tileset: region, geometric error, origin
  std::filesystem::path odometry;    ///< folder of an odometry of these images; empty: the built-in one tracks them
  odometry::TrackOptions track;      ///< of the built-in odometry
  std::filesystem::path transform;   ///< that align() wrote for this odometry; empty: its map is registered here
  alignment::AlignMapOptions align;  ///< registration of the odometry's map, from which the images are located
  int width = 640;                   ///< images are compared with the place at this width at most, pixels
};

/// A part of the flight without a known pose.
struct LostPart {
  double from_s = 0.0, to_s = 0.0;
  std::size_t images = 0;
};

/// States how the receiver's positions differ from the located path.
struct ReceiverComparison {
  std::size_t positions = 0;
  double rms_m = 0.0;                              ///< of the distances
  geometry::Vec3 mean_m = geometry::Vec3::Zero();  ///< located minus recorded, east, north, up
  double stated_sigma_m = 0.0;  ///< of a position by the receiver, root mean square, three axes together
};

/// Result of localize().
struct LocalizeResult {
  std::vector<std::string> frame_ids;
  std::vector<double> times_s;
  localization::LocatedFlight flight;
  geometry::Sim3 T_local_map;  ///< registration of the odometry's map
  std::vector<LostPart> lost;
  std::optional<ReceiverComparison> receiver;
  std::optional<geometry::Geodetic> origin;  ///< of the local frame
  double locate_seconds = 0.0, seconds = 0.0;
  Warnings warnings;

  std::size_t count(localization::PoseSource source) const;
};

/// Returns the content of localize.json (docs/formats.md).
nlohmann::json to_json(const LocalizeResult& result);

/// Locates every image of a dataset in a place, and atomically writes a folder with trajectory.txt (local frame),
/// quality.csv (a line for each image) and localize.json; unless they are given, also odometry/, transform.json and
/// place/ (the ground truth of the region). Without a region, the place is the surroundings of the receiver's
/// positions, or the whole tileset without them. Throws InputError, also if no image was found in the place.
LocalizeResult localize(const LocalizeSettings& settings, const std::filesystem::path& out, bool replace,
                        const Progress& progress = {});

/// Reads the positions of the images from a folder that localize() wrote, with their standard deviations. Throws
/// InputError.
std::vector<alignment::PositionFix> read_located_positions(const std::filesystem::path& folder);

}  // namespace tileflight::scoring
