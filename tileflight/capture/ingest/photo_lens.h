#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/data/flight_logs/photo_log.h"

namespace tileflight::ingest {

/// A lens as the tags of a flight's photos state it.
struct PhotoLens {
  imaging::Calibration calibration;  ///< for images of the size at which the photos were taken
  std::filesystem::path photo;       ///< one of those that state it
  std::string source;     ///< the tag: DewarpData, DewarpDataK6, CalibratedFocalLength, FocalLengthIn35mmFilm,
                          ///< FocalPlaneXResolution
  bool is_guess = false;  ///< one of the last two
  std::vector<std::string> warnings;  ///< which tag was taken, and what makes it doubtful; a line each
};

/// Returns the lens of a flight's photos by the first of these tags that they have: DJI's calibration of the camera
/// (DewarpData, else DewarpDataK6; without its distortion where DewarpFlag says that the camera has removed it), DJI's
/// design of the lens (CalibratedFocalLength), EXIF's FocalLengthIn35mmFilm, EXIF's FocalPlaneXResolution. Only the
/// first have distortion. EXIF's are guesses: CIPA DCG-001 defines the film's by the diagonal of the image, 43.27 mm.
/// Numbers that cannot be of these images are passed over, with a warning. `folder`: for messages. Throws InputError:
/// no tag of these, photos with different lenses.
PhotoLens lens_of_photos(const flight_logs::PhotoLog& photos, const std::filesystem::path& folder);

/// Returns what the photos' tags say against a calibration that was given for them; a line each.
std::vector<std::string> find_lens_warnings(const flight_logs::PhotoLog& photos,
                                            const imaging::Calibration& calibration);

}  // namespace tileflight::ingest
