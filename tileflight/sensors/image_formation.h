#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/sensors/daylight.h"
#include "tileflight/sensors/light.h"
#include "tileflight/sensors/render.h"

namespace tileflight::sensors {

/// T_local_camera at any time, seconds. May be asked from several threads at once.
using PoseFunction = std::function<geometry::SE3(double time_s)>;

/// From `time_s` on, the exposure is `gain` times as long.
struct ExposureStep {
  double time_s = 0.0;
  double gain = 1.0;
};

/// An automatic exposure (auto_exposure.h): the shutter stays open so long that the picture's mean light comes near
/// `target`, with a lag.
struct AutoExposure {
  double target = 0.0;           ///< mean linear light of the picture, 0..1 (0.18: middle grey); 0: off
  double time_constant_s = 0.5;  ///< of the control's lag; 0: each frame gets what the one before it wanted
  double min_gain = 0.125;       ///< limits of the factor on the exposure
  double max_gain = 8.0;
};

/// What air and a real camera do to light on its way into a file. Every effect is off by default; then frames are the
/// textures' own colours. The order is that of nature: sun and sky -> haze -> lens (lateral chromatic aberration)
/// -> light gathered while the shutter is open (motion blur; each row at its own time) -> vignetting -> exposure
/// -> photon and read noise
/// -> full well -> response curve -> sharpening -> 8 bits.
struct ImageFormation {
  std::uint64_t seed = 1;  ///< of the noise; the same seed gives the same bytes

  std::optional<SunAndSky> light{};  ///< instead of what is baked into the textures; does not move during a flight

  /// Distance at which contrast has fallen to 2 %, metres: light that reaches the camera is L T + A (1 - T),
  /// T = exp(-3.912 d / haze_visibility_m) (Koschmieder 1924), A being the haze's colour. 0: clear air.
  double haze_visibility_m = 0.0;
  std::optional<imaging::Rgb8> haze_color{};  ///< none: the background's, or that of the sky at the horizon

  // Lateral chromatic aberration: the red (blue) image is larger than the green one by this share, about the principal
  // point.
  double chromatic_red = 0.0;
  double chromatic_blue = 0.0;

  // Shutter.
  double exposure_time_s = 0.0;  ///< at gain 1; centred on the frame's time. 0: an instant, no motion blur
  int exposure_samples = 9;      ///< moments of the exposure that are averaged; odd
  double line_delay_s = 0.0;     ///< time from one row to the next; the middle row is taken at the frame's time

  // Optics: V(r) = 1 - vignetting (r / r_corner)^2, r from the image's centre.
  double vignetting = 0.0;  ///< share of the light that is lost in the corners, 0..1

  // Exposure: a slow drift, steps, and an automatic exposure, which all multiply the time that the shutter is open.
  AutoExposure auto_exposure{};
  double exposure_drift = 0.0;                 ///< amplitude of the gain's oscillation, 0..1
  double exposure_drift_period_s = 8.0;        ///< of the oscillation, which starts rising at time 0
  std::vector<ExposureStep> exposure_steps{};  ///< in time order; each holds until the next

  // Sensor.
  double white_electrons = 0.0;       ///< electrons of a pixel at white; their number is Poisson-like. 0: no noise
  double read_noise_electrons = 0.0;  ///< standard deviation; needs white_electrons

  // Response: sRGB, as the textures are encoded, or a power.
  double gamma = 0.0;  ///< value = light^(1 / gamma); 0: sRGB's curve

  // Sharpening of the camera's own: an unsharp mask on the luma of the response's values.
  double sharpening = 0.0;            ///< amount: how many times what a Gaussian takes away is added; 0: none
  double sharpening_radius_px = 1.0;  ///< standard deviation of the Gaussian
};

/// Throws InputError (option, cause) where a value is out of its range.
void check(const ImageFormation& formation);

/// Whether every effect is off, so that frames are the textures' own colours.
bool is_ideal(const ImageFormation& formation);

/// Share of the light that the haze takes on a metre of air (its natural logarithm).
double haze_per_m(const ImageFormation& formation);

/// The lens through which one colour is seen: its image is larger by the share `larger`, about the principal point.
imaging::Camera magnified(const imaging::Camera& camera, double larger);

/// Factor on the time that the shutter is open, for a frame at `time_s`, without the automatic exposure's.
double exposure_gain(const ImageFormation& formation, double time_s);

/// The largest factor that the formation can come to, drift, steps and automatic exposure together.
double max_exposure_gain(const ImageFormation& formation);

/// The moments and rows of a frame at `time_s`: row y is taken around time_s + (y - (height - 1) / 2) line_delay_s. The
/// shutter is open for `gain` times the exposure time.
ShutterPoses shutter_poses(const ImageFormation& formation, const PoseFunction& pose_at, double time_s, int height,
                           double gain = 1.0);

/// V of every pixel, in (0, 1]; empty where there is no vignetting.
imaging::FloatImage vignette_of(const ImageFormation& formation, int width, int height);

/// From light to the file's bytes. `vignette` as vignette_of gives it; `frame` tells the noise of frames apart.
imaging::RgbImage develop(const LightImage& light, const imaging::FloatImage& vignette, const ImageFormation& formation,
                          double gain, std::uint64_t frame);

/// The photometric calibration that undoes response and vignetting: I = G(t V B) as in imaging/photometric.h. Noise and
/// sharpening are not undone by any.
imaging::PhotometricCalibration photometric_calibration(const ImageFormation& formation, int width, int height);

}  // namespace tileflight::sensors
