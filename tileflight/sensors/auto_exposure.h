#pragma once

#include <optional>
#include <span>
#include <vector>

#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/image_formation.h"
#include "tileflight/sensors/render.h"

namespace tileflight::sensors {

/// Where an automatic exposure stands between two frames.
struct ExposureState {
  double time_s = 0.0;
  double log_gain = 0.0;    ///< of the last frame
  double log_wanted = 0.0;  ///< what the last frame's light asks for
};

/// The gains of frames whose mean light (at gain 1) was metered as `mean_light`, one each: the controller sees a frame
/// only after it was taken, and then closes the share 1 - exp(-dt / time constant) of the gap to what that frame wanted
/// (in logarithms, as exposure steps are). Without `before`, the camera has had time to settle on the first frame;
/// `before` is moved on past the last one.
std::vector<double> exposure_gains(const AutoExposure& options, std::span<const double> times_s,
                                   std::span<const double> mean_light, std::optional<ExposureState>& before);

/// The same lens over an image of about `width` pixels across, for metering; other sizes than those of its aspect ratio
/// stretch the pixels.
imaging::Camera metering_camera(const imaging::Camera& camera, int width = 64);

/// Mean of the linear light (Rec. 709 luminance, vignetting included) of each pose's picture within the lens's valid
/// cone, at gain 1. Small pictures are rendered for it; the same for any number of threads.
std::vector<double> metered_light(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                                  const imaging::Camera& camera, const RenderOptions& options,
                                  const ImageFormation& formation, std::span<const geometry::StampedPose> frames);

}  // namespace tileflight::sensors
