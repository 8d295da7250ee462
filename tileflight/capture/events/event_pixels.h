#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/capture/events/event_options.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::events {

/// A change of one pixel's brightness by a threshold.
struct Event {
  std::uint32_t t_us = 0;  ///< microseconds since the start of the recording
  std::uint16_t x = 0, y = 0;
  std::uint8_t polarity = 0;  ///< 1: brighter (ON), 0: darker (OFF), as in DSEC

  bool operator==(const Event&) const = default;
};

/// Thresholds of one pixel, as changes of the natural logarithm of light.
struct PixelThresholds {
  float positive = 0.0F, negative = 0.0F;
};

/// Draws the thresholds of pixel `index` (y * width + x), which are normally distributed about those of the options
/// with threshold_sigma, and at least kLeastThreshold.
PixelThresholds pixel_thresholds(const EventOptions& options, std::uint64_t index);

/// The pixels of an event camera, which turn the light that they see into events.
///
/// A pixel holds the difference D of log light to its last reset. It sends an ON event when D reaches its positive
/// threshold, an OFF event when -D reaches its negative one, and is reset: D = 0. During the refractory time that
/// follows it is held in reset, so it counts from the light at the end of that time (Lichtsteiner et al. 2008, section
/// III). Between two samples log light is linear in time (ESIM, section 3.1), so that an event's time is exact for
/// samples of linear log light. The reset switch leaks: D rises by leak_rate_hz * positive_threshold a second besides
/// (v2e, section 4.2). Shot noise makes events at random times of a Poisson process, as likely ON as OFF, whose rate
/// falls linearly with light from shot_noise_rate_hz in the dark to a quarter of it at white (v2e's factor); they reset
/// the pixel as others do. A camera that leaks has run before: D is anywhere within the positive threshold at first.
///
/// All random numbers are functions of seed, pixel and a count alone, and samples are used pixel by pixel: events do
/// not depend on the number of threads.
class EventPixels {
 public:
  /// The options are checked already. `most_at_once`: events that advance() makes at most.
  EventPixels(int width, int height, const EventOptions& options, std::size_t most_at_once = std::size_t{1} << 24U);

  /// Starts all pixels at a time, seconds. `log_light`: the natural logarithm of light + dark_light.
  void start(const imaging::FloatImage& log_light, double time_s);
  /// Replaces the light of the last sample, as other tiles show it, without causing events.
  void replace(const imaging::FloatImage& log_light);
  /// Returns the events from the last sample to a later one, in the order of their times, then of rows and columns.
  /// Event times are microseconds, rounded down, since `origin_s`. Throws InputError for `most_at_once` or more.
  std::vector<Event> advance(const imaging::FloatImage& log_light, double time_s, double origin_s);

 private:
  struct Pixel {
    PixelThresholds thresholds;
    float log_light = 0.0F;
    double difference = 0.0;
    double released_s = 0.0;  ///< end of the refractory time
    double noise_s = 0.0;     ///< next time of the noise process
    std::uint32_t noise_count = 0;
  };
  struct Step;

  void draw_next_noise(Pixel& pixel, std::uint64_t index) const;
  bool is_noise_accepted(const Pixel& pixel, std::uint64_t index, float log_light) const;
  bool is_noise_positive(const Pixel& pixel, std::uint64_t index) const;
  template <class Sink>
  void advance_pixel(Pixel& pixel, std::uint64_t index, float log_light, const Step& step, const Sink& sink) const;

  int width_, height_;
  EventOptions options_;
  std::uint64_t noise_key_;
  double leak_per_s_;
  std::size_t most_at_once_;
  double time_s_ = 0.0;
  std::vector<Pixel> pixels_;
};

}  // namespace tileflight::events
