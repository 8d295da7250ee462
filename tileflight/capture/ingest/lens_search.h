#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/lens_profile.h"

namespace tileflight::ingest {

/// Holds what a recording says of its camera and mode.
struct RecordingIdentity {
  std::string camera;        ///< make and model, "GoPro HERO5 Black"; empty: it does not say
  std::string stated_by;     ///< the tag that names the camera: "firmware HD5.02.02.00.00"
  imaging::LensMode mode{};  ///< size and frame rate; readout unknown
  std::string lens{};        ///< lens mode, "Wide", "SuperView" or "Linear"; empty: it does not say
};

/// Reads size, frame rate and camera of a video, or of a folder of photos. The camera is that of the tags
/// com.apple.quicktime.make and .model, make and model, or DJI's encoder; GoPro's by the model's number in the version
/// of the firmware (KonradIT/gopro-firmware-archive lists them), which also writes the lens mode. Throws InputError as
/// video::probe_video and read_photo_log.
RecordingIdentity identify_recording(const std::filesystem::path& video);

/// States how a profile's mode suits images of a recording's size.
enum class SizeMatch { kSame, kScaled };

/// A lens profile that may be a recording's.
struct LensMatch {
  std::filesystem::path file;
  imaging::LensProfile profile;
  imaging::LensMode mode;  ///< the profile's that fits best; if `size` is kScaled, it has another size
  SizeMatch size = SizeMatch::kSame;
  bool has_rate = false;             ///< mode and recording have one frame rate
  bool has_other_rate = false;       ///< they state different ones
  std::vector<std::string> reasons;  ///< for and against it, a few words each
};

/// Chooses among the profiles of a folder.
struct LensSearch {
  RecordingIdentity recording;
  std::filesystem::path folder;  ///< of profiles, searched with the folders in it
  std::string lens;              ///< word that lens, setting or note must have ("Linear"); empty: that of the recording
};

/// The profiles that fit, best first.
struct LensSearchResult {
  std::vector<LensMatch> matches;
  std::size_t profiles = 0;          ///< read
  std::size_t of_other_size = 0;     ///< of the camera, but of another aspect ratio
  std::size_t of_other_lens = 0;     ///< of the camera, without the word
  std::vector<std::string> skipped;  ///< files that are no profiles or not supported, with the cause
  std::vector<std::string> similar;  ///< cameras whose name contains the recording's or is contained in it
  /// These make the choice doubtful, a line each: profiles that fit as well and are of other lenses.
  std::vector<std::string> warnings;
  bool is_ambiguous = false;  ///< the best ones fit equally well, and their focal lengths differ by more than 5 %
};

/// Finds the profiles of a recording's camera for images of its size. If the recording states its lens mode, these are
/// the profiles that name it, else those that name none, else all, with a warning. They are ordered by size (its own,
/// or another of the same aspect ratio), frame rate, whether the images are stabilised (EIS), Gyroflow's mark
/// `official`, and the reprojection error. Files are read in parallel; the result does not depend on the number of
/// threads. Throws InputError: no such folder, a recording that does not name its camera, no profile in the folder.
LensSearchResult find_lenses(const LensSearch& search, const Progress& progress = {});

/// Returns the calibration of a match for images of the recording's size, with notes that name camera and mode.
imaging::Calibration calibration_of(const LensMatch& match, const RecordingIdentity& recording);

/// The result as `tileflight lens --json` prints it, with at most `most` matches.
nlohmann::json to_json(const RecordingIdentity& recording, const LensSearchResult& result, std::size_t most);

}  // namespace tileflight::ingest
