#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::events {

/// An event camera: pixels that each report when the logarithm of their light has changed by a threshold (Lichtsteiner,
/// Posch, Delbruck, IEEE J. Solid-State Circuits 43(2), 2008), simulated from pictures sampled adaptively (Rebecq,
/// Gehrig, Scaramuzza, "ESIM: an open event camera simulator", CoRL 2018) with the noise of v2e (Hu, Liu, Delbruck,
/// "v2e: from video frames to realistic DVS events", CVPR workshops 2021). Defaults: docs/events.md says where they are
/// from.
struct EventOptions {
  std::uint64_t seed = 1;  ///< of thresholds and noise; deterministic

  // Thresholds: change of the natural logarithm of light.
  double positive_threshold = 0.2;
  double negative_threshold = 0.2;
  double threshold_sigma = 0.03;  ///< standard deviation of both thresholds from pixel to pixel
  /// Added to light (1: white) before its logarithm is taken: dark current, below which contrast fades.
  double dark_light = 0.001;
  double refractory_s = 0.0005;  ///< after an event a pixel sees nothing for so long

  // Background activity of each pixel.
  double leak_rate_hz = 0.01;         ///< ON events of a still picture, from the leak of the pixel's reset switch
  double shot_noise_rate_hz = 0.001;  ///< ON and OFF events in the dark; a quarter of it at white

  // Sampling.
  double max_motion_px = 0.5;  ///< largest motion of a pixel's content between two samples
  double max_change = 0.0;     ///< largest change of log light between two samples, of all but 1 of 1000 pixels; 0: any
  double max_step_s = 0.01;    ///< longest time between two samples

  /// More events per second and pixel than this, averaged over the picture and from one frame to the next, are an
  /// error.
  double max_rate_hz = 1000.0;
};

/// Limits of the thresholds in the options. The threshold of a single pixel is at least kLeastThreshold, too.
inline constexpr double kLeastThreshold = 0.01, kMostThreshold = 10.0;

/// Throws InputError (option, cause) if a value is out of range.
void validate_event_options(const EventOptions& options);

/// Reads the section `events:` of a FLIGHT file, or of one of its cameras; its keys are named as the options. Returns
/// nullopt without one. Throws
/// InputError (file, line, key).
std::optional<EventOptions> read_event_options(base::StrictSection& camera);

/// Describes all options but the seed, for a dataset's metadata: "positive_threshold: 0.2, …".
std::string describe_event_options(const EventOptions& options);

}  // namespace tileflight::events
