#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// State of an automatic exposure between two frames.
struct AutoExposureState {
  double time_s = 0.0;
  double log_gain = 0.0;         ///< natural logarithm of the last frame's gain
  double log_target_gain = 0.0;  ///< logarithm of the gain that the last frame's light requires
};

/// Computes the gains for frames with metered mean light `mean_light` (at gain 1), one each. The controller sees a
/// frame only after it was taken, and then closes the fraction 1 - exp(-dt / time constant) of the gap to the gain
/// which that frame required (in logarithms, as exposure steps). Without `before`, the camera has settled on the first
/// frame; `before` is updated to the state after the last frame.
std::vector<double> exposure_gains(const AutoExposure& options, std::span<const double> times_s,
                                   std::span<const double> mean_light, std::optional<AutoExposureState>& before);

/// Scales a lens to an image about `width` pixels wide, for metering; if the aspect ratio cannot be kept exactly, the
/// pixels are stretched.
imaging::Camera metering_camera(const imaging::Camera& camera, int width = 64);

/// Computes the mean linear light (Rec. 709 luminance, including vignetting) of the image at each pose, at gain 1,
/// within the lens's valid cone. Each image is rendered small (metering_camera()) and without exposure. Results do not
/// depend on the number of threads.
std::vector<double> meter_light(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                                const imaging::Camera& camera, const RenderOptions& options,
                                const ImageFormation& formation, std::span<const geometry::StampedPose> frames);

}  // namespace tileflight::render
