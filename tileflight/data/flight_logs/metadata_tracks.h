#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Holds what a video says about its metadata track.
struct MetadataSource {
  std::string where;                      ///< the file, for messages
  std::span<const std::byte> settings{};  ///< GoPro: the box moov/udta/GPMF, which holds for the whole recording
  int quarter_turns = 0;                  ///< clockwise, by which the frames are turned for display
};

/// Reads the samples of GoPro's metadata track (`gpmd`, GPMF), of cameras and of the Karma. Times are the video's: the
/// samples of a stream are spread over its packets, or follow its time stamps (gpmf.cpp). Positions are those of GPS9,
/// else GPS5, else the Karma's own; those without a three-dimensional fix or with a dilution of precision of 5 or more
/// are dropped and counted. Heights are above the ellipsoid unless GPSA says that they are above sea level. Readings of
/// the inertial unit are left out, with a warning, where their axes are not known or stabilisation turned the frames
/// against the camera. The result may have no positions. Throws InputError (file, cause) if nothing can be read.
Telemetry read_gpmf(std::span<const base::TimedBytes> samples, const MetadataSource& source);

/// Returns the lens mode that GoPro's settings (MetadataSource) state by VFOV: "Wide", "SuperView" or "Linear"; empty:
/// none of these.
std::string gopro_lens_mode(std::span<const std::byte> settings);

/// Reads the samples of DJI's metadata track (`djmd`), one for each frame, by the layouts of the models that
/// docs/formats.md lists: positions, heights, attitude of vehicle and gimbal, exposures, focal length and zoom. Times
/// are the video's. Frames whose receiver states no fix are dropped and counted. Heights are above the ellipsoid if
/// every position says so (`gps_altitude_type`); else their reference is unknown. The result may have no positions.
/// Throws InputError (file, cause) for a model whose layout is not known, which it names, and if nothing can be read.
Telemetry read_dji_metadata(std::span<const base::TimedBytes> samples, const MetadataSource& source);

}  // namespace tileflight::flight_logs
