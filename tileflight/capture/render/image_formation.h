#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/photometric.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::render {

/// Returns T_local_camera at any time, seconds. May be called from several threads at once.
using PoseFunction = std::function<geometry::SE3(double time_s)>;

/// A change of the exposure time: from `time_s` on, it is multiplied by `gain`.
struct ExposureStep {
  double time_s = 0.0;
  double gain = 1.0;
};

/// Automatic exposure (auto_exposure.h): adjusts the exposure time so that the image's mean light approaches `target`,
/// with a lag.
struct AutoExposure {
  double target = 0.0;           ///< mean linear light of the image, 0..1 (0.18: middle grey); 0: off
  double time_constant_s = 0.5;  ///< of the control; 0: a frame gets the gain that the previous one required
  double min_gain = 0.125;       ///< limits of the gain
  double max_gain = 8.0;
};

/// Effects of air, lens and camera on the image. All are off by default; then frames show the textures' own colours.
/// They apply in physical order: sun and sky -> haze -> lens (lateral chromatic aberration) -> exposure integration
/// (motion blur; each row at its own time) -> vignetting -> exposure -> photon and read noise -> full well -> response
/// curve -> sharpening -> 8 bits.
struct ImageFormation {
  std::uint64_t seed = 1;  ///< of the noise; deterministic

  std::optional<DaylightOptions> light{};  ///< instead of the light baked into the textures; constant during a flight
  bool light_is_chosen = false;            ///< the settings name a light, or that of the textures

  /// Distance at which contrast has fallen to 2 %, metres: light that reaches the camera is L T + A (1 - T), T =
  /// exp(-3.912 d / haze_visibility_m) (Koschmieder 1924), where A is the colour of the haze. 0: clear air.
  double haze_visibility_m = 0.0;
  std::optional<imaging::Rgb8> haze_color{};  ///< default: the background's, or that of the sky at the horizon

  // Lateral chromatic aberration: the red (blue) image is magnified by this fraction relative to the green one, about
  // the principal point.
  double chromatic_red = 0.0;
  double chromatic_blue = 0.0;

  // Shutter.
  double exposure_time_s = 0.0;  ///< at gain 1; centred on the frame's time. 0: instantaneous, no motion blur
  int exposure_samples = 9;      ///< times of the exposure that are averaged; odd
  double line_delay_s = 0.0;     ///< time from one row to the next; the middle row is exposed at the frame's time

  // Optics: V(r) = 1 - vignetting (r / r_corner)^2, r from the image's centre.
  double vignetting = 0.0;  ///< fraction of light lost in the corners, 0..1

  // Exposure: a slow drift, steps, and automatic exposure; their gains multiply the exposure time.
  AutoExposure auto_exposure{};
  double exposure_drift = 0.0;                 ///< amplitude of the gain's oscillation, 0..1
  double exposure_drift_period_s = 8.0;        ///< of the oscillation, which increases from time 0
  std::vector<ExposureStep> exposure_steps{};  ///< in time order; each holds until the next

  // Sensor.
  double white_electrons = 0.0;       ///< electrons of a pixel at white; shot noise is Poisson-like. 0: no noise
  double read_noise_electrons = 0.0;  ///< standard deviation; requires white_electrons

  // Response: sRGB, as in the textures, or a power law.
  double gamma = 0.0;  ///< value = light^(1 / gamma); 0: sRGB's curve

  // In-camera sharpening: an unsharp mask on the luma of the response's values.
  double sharpening = 0.0;            ///< multiple of the difference to the Gaussian blur that is added; 0: none
  double sharpening_radius_px = 1.0;  ///< standard deviation of the Gaussian
};

/// Throws InputError (option, cause) if a value is out of range.
void validate_image_formation(const ImageFormation& formation);

/// Tells whether every effect is off, so that frames are the textures' own colours.
bool is_ideal(const ImageFormation& formation);

/// Sets the light by which a place without textures is shown (relief_light()), unless a light was chosen.
void light_by_relief(bool lacks_textures, ImageFormation& formation);

/// Returns the extinction coefficient of the haze, 1/m.
double haze_per_m(const ImageFormation& formation);

/// Returns the lens of one colour channel, whose image is magnified by the fraction `larger` about the principal point.
imaging::Camera scale_focal_length(const imaging::Camera& camera, double larger);

/// Returns the gain on the exposure time for a frame at `time_s`, without automatic exposure.
double exposure_gain(const ImageFormation& formation, double time_s);

/// Returns the upper bound of the gain: drift, steps and automatic exposure together.
double max_exposure_gain(const ImageFormation& formation);

/// Computes the poses at all moments and rows of a frame at `time_s`: row y is centred at time_s + (y - (height - 1) /
/// 2) line_delay_s. The shutter is open for `gain` times the exposure time.
ShutterPoses shutter_poses(const ImageFormation& formation, const PoseFunction& pose_at, double time_s, int height,
                           double gain = 1.0);

/// Computes the vignetting factor V of every pixel, in (0, 1]; empty without vignetting.
imaging::FloatImage make_vignette(const ImageFormation& formation, int width, int height);

/// Converts light to 8-bit pixels. `vignette`: from make_vignette; `frame`: frame number, which selects the noise.
imaging::RgbImage develop(const LinearImage& light, const imaging::FloatImage& vignette,
                          const ImageFormation& formation, double gain, std::uint64_t frame);

/// A function that converts the light of pixels of a row, from (x, y) on, to 8-bit pixels of the image.
using Developer = std::function<void(int x, int y, std::span<const LinearRgb> light, imaging::RgbImage& image)>;

/// Makes a function that does develop() for a few pixels at a time, in any order and from several threads at once.
/// `vignette` must outlive it. Precondition: no sharpening, which needs a pixel's neighbours.
Developer make_developer(const imaging::FloatImage& vignette, const ImageFormation& formation, double gain,
                         std::uint64_t frame);

/// Returns the photometric calibration that inverts response and vignetting: I = G(t V B) as in
/// core/imaging/photometric.h. Noise and sharpening are not inverted.
imaging::PhotometricCalibration photometric_calibration(const ImageFormation& formation, int width, int height);

/// Reads an ImageFormation from a section with the keys: light {model, time, turbidity, ground_albedo, exposure,
/// white_balance}, haze_visibility (m), haze_color, chromatic_red, chromatic_blue, exposure_time, exposure_samples,
/// line_delay (s), vignetting, auto_exposure {target, time_constant (s), min_gain, max_gain}, exposure_drift,
/// exposure_drift_period (s), exposure_steps [{time, gain}], white_electrons, read_noise_electrons, gamma, sharpening,
/// sharpening_radius (px). Keys that are not there keep the values of `defaults`. Unknown keys are errors that name the
/// nearest known key. Throws InputError (file, line, key).
ImageFormation read_image_formation(base::StrictSection& section, const ImageFormation& defaults = {});

}  // namespace tileflight::render
