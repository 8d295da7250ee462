#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::imaging {

/// A mode of a camera: the size, frame rate and readout of what it records.
struct LensMode {
  int width = 0, height = 0;       ///< pixels, as recorded
  double frames_per_second = 0.0;  ///< 0: not stated
  std::optional<double>
      readout_s;           ///< of the rolling shutter, first row to last, negative from below; nullopt: unknown
  std::string identifier;  ///< Gyroflow's own word for camera and mode; empty: none
};

/// A lens profile of Gyroflow: a camera's lens in one of its modes (https://docs.gyroflow.xyz, Lens calibration).
struct LensProfile {
  std::string where;          ///< the file, for messages
  std::string brand, model;   ///< of the camera: "GoPro", "HERO10 Black"
  std::string lens;           ///< the lens, or the field of view that the camera calls so: "Wide"
  std::string setting, note;  ///< what else the mode depends on: "NO-EIS"
  bool is_official = false;
  double reprojection_error_px = 0.0;  ///< of the calibration; 0: not stated
  /// The modes with this lens: that of the calibration, then those of `compatible_settings`.
  std::vector<LensMode> modes;
  bool is_global_shutter = false;
  Camera camera;                   ///< for images of the first mode
  std::vector<std::string> notes;  ///< what may make the camera wrong; a sentence each, without the file's name
};

/// Reads a lens profile from its text. The camera is that of the recorded images: where the profile was made of images
/// stretched to undo an anamorphic lens, the stretch is undone. The principal point is that of the calibration, which
/// Gyroflow itself replaces by the image's centre unless `asymmetrical` is true. `where`: the file, for messages.
/// Throws InputError (file, key, cause): no lens profile, numbers that are no lens, a lens without a counterpart here
/// (a digital lens such as GoPro's SuperView, models of Sony, Insta360, lensfun).
LensProfile parse_lens_profile(std::string_view text, const std::string& where);

/// Reads a file if it is a lens profile; nullopt: it is something else. Throws InputError as parse_lens_profile.
std::optional<LensProfile> read_if_lens_profile(const std::filesystem::path& file);

/// Returns the calibration of a profile's first mode, with notes that name camera and mode.
Calibration calibration_of(const LensProfile& profile);

/// Returns the calibration of one of the profile's modes, with such notes.
Calibration calibration_of(const LensProfile& profile, const LensMode& mode);

/// Returns the calibration for images of a size: of the profile's mode of that size, else the first mode's lens scaled.
/// A note says which it is, and whether modes of that size have different readout times by frame rate; then the first
/// one is taken. Throws InputError for another aspect ratio.
Calibration calibration_for_size(const LensProfile& profile, int width, int height);

/// Describes a mode: "3840x2160 at 29.97 frames per second".
std::string describe(const LensMode& mode);

/// Names a profile's camera and lens: "GoPro HERO10 Black, Wide, NO-EIS".
std::string describe(const LensProfile& profile);

}  // namespace tileflight::imaging
