#include "tileflight/capture/events/event_pixels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::events {
namespace {

// Streams of random numbers; others are in render, sensors.
constexpr std::uint64_t kThresholdStream = 40, kNoiseStream = 41, kPhaseStream = 42;
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kNoiseAtWhite = 0.25;  // v2e: share of the dark noise rate

/// 64 random bits of a pixel's n-th number.
std::uint64_t random_bits(std::uint64_t key, std::uint64_t index, std::uint64_t count) {
  return base::splitmix64_hash(key ^ base::splitmix64_hash((index << 32U) + count));
}

/// Uniform in (0, 1], from the upper 40 bits.
double uniform_of(std::uint64_t bits) { return static_cast<double>((bits >> 24U) + 1U) * 0x1p-40; }

/// When a difference that grows by `slope` a second reaches a threshold; kNever if it does not.
double next_crossing_s(const PixelThresholds& thresholds, double difference, double slope, double now_s) {
  if (slope == 0.0) return kNever;
  const double way = slope > 0.0 ? thresholds.positive - difference : -thresholds.negative - difference;
  return now_s + std::max(0.0, way / slope);  // not before now, by rounding
}

float at_least(float value) { return std::max(value, static_cast<float>(kLeastThreshold)); }

}  // namespace

PixelThresholds pixel_thresholds(const EventOptions& options, std::uint64_t index) {
  const auto normal = base::normal_variates(base::stream_key(options.seed, kThresholdStream), index);
  const auto sigma = static_cast<float>(options.threshold_sigma);
  return {at_least(static_cast<float>(options.positive_threshold) + sigma * normal[0]),
          at_least(static_cast<float>(options.negative_threshold) + sigma * normal[1])};
}

/// From one sample to the next.
struct EventPixels::Step {
  double begin_s, end_s;
};

EventPixels::EventPixels(int width, int height, const EventOptions& options, std::size_t most_at_once)
    : width_(width),
      height_(height),
      options_(options),
      noise_key_(base::stream_key(options.seed, kNoiseStream)),
      leak_per_s_(options.leak_rate_hz * options.positive_threshold),
      most_at_once_(most_at_once),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
  for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i].thresholds = pixel_thresholds(options, i);
}

void EventPixels::start(const imaging::FloatImage& log_light, double time_s) {
  const std::uint64_t phase_key = base::stream_key(options_.seed, kPhaseStream);
  time_s_ = time_s;
  replace(log_light);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    Pixel& pixel = pixels_[i];
    const double phase = leak_per_s_ > 0.0 ? 1.0 - uniform_of(random_bits(phase_key, i, 0)) : 0.0;  // [0, 1)
    pixel.difference = phase * static_cast<double>(pixel.thresholds.positive);
    pixel.released_s = -kNever;
    pixel.noise_s = time_s;
    pixel.noise_count = 0;
    draw_next_noise(pixel, i);
  }
}

void EventPixels::replace(const imaging::FloatImage& log_light) {
  assert(log_light.pixels.size() == pixels_.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i].log_light = log_light.pixels[i];
}

/// Gaps between the times of a Poisson process are exponential. Each time has two numbers: of its gap and its kind.
void EventPixels::draw_next_noise(Pixel& pixel, std::uint64_t index) const {
  if (options_.shot_noise_rate_hz <= 0.0) {
    pixel.noise_s = kNever;
    return;
  }
  pixel.noise_s -=
      std::log(uniform_of(random_bits(noise_key_, index, 2ULL * pixel.noise_count))) / options_.shot_noise_rate_hz;
  ++pixel.noise_count;
}

/// Thinning (Lewis and Shedler, Naval Research Logistics Quarterly 26(3), 1979) of the process at the rate of the dark.
bool EventPixels::is_noise_accepted(const Pixel& pixel, std::uint64_t index, float log_light) const {
  const double light = std::clamp(std::exp(static_cast<double>(log_light)) - options_.dark_light, 0.0, 1.0);
  const double share = 1.0 - (1.0 - kNoiseAtWhite) * light;
  return uniform_of(random_bits(noise_key_, index, 2ULL * pixel.noise_count - 1)) <= share;
}

bool EventPixels::is_noise_positive(const Pixel& pixel, std::uint64_t index) const {
  return (random_bits(noise_key_, index, 2ULL * pixel.noise_count - 1) & 1U) != 0;
}

template <class Sink>
void EventPixels::advance_pixel(Pixel& pixel, std::uint64_t index, float log_light, const Step& step,
                                const Sink& sink) const {
  const double first = pixel.log_light, last = log_light;
  const double change_per_s = (last - first) / (step.end_s - step.begin_s), slope = change_per_s + leak_per_s_;
  pixel.log_light = log_light;
  double now_s = step.begin_s;
  while (true) {
    if (pixel.released_s > now_s) {
      pixel.difference = 0.0;
      if (pixel.released_s >= step.end_s) return;
      now_s = pixel.released_s;
    }
    while (pixel.noise_s < now_s) draw_next_noise(pixel, index);
    const double crossing_s = next_crossing_s(pixel.thresholds, pixel.difference, slope, now_s);
    const bool is_noise = pixel.noise_s < crossing_s;
    const double next_s = std::min(crossing_s, pixel.noise_s);
    if (next_s > step.end_s) {
      pixel.difference += slope * (step.end_s - now_s);
      return;
    }
    bool is_positive = slope > 0.0, is_event = true;
    if (is_noise) {
      const auto seen = static_cast<float>(first + change_per_s * (next_s - step.begin_s));
      is_event = is_noise_accepted(pixel, index, seen);
      is_positive = is_noise_positive(pixel, index);
      draw_next_noise(pixel, index);
    }
    if (is_event) {
      sink(next_s, is_positive);
      pixel.difference = 0.0;
      pixel.released_s = next_s + options_.refractory_s;
    } else {
      pixel.difference += slope * (next_s - now_s);
    }
    now_s = next_s;
  }
}

std::vector<Event> EventPixels::advance(const imaging::FloatImage& log_light, double time_s, double origin_s) {
  assert(log_light.pixels.size() == pixels_.size() && time_s > time_s_);
  const Step step{time_s_, time_s};
  std::vector<std::vector<Event>> rows(static_cast<std::size_t>(height_));
  std::atomic<std::size_t> count{0};
  tbb::parallel_for(0, height_, [&](int y) {
    std::vector<Event>& row = rows[static_cast<std::size_t>(y)];
    for (int x = 0; x < width_ && count < most_at_once_; ++x) {
      const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
      advance_pixel(pixels_[index], index, log_light.pixels[index], step, [&](double at_s, bool is_positive) {
        row.push_back({static_cast<std::uint32_t>(std::max(0.0, (at_s - origin_s) * 1e6)),
                       static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
                       static_cast<std::uint8_t>(is_positive ? 1 : 0)});
      });
    }
    count += row.size();
  });
  if (count >= most_at_once_)
    throw InputError("events", "more than " + std::to_string(most_at_once_) +
                                   " events between two samples of the light; raise the thresholds or the refractory "
                                   "time");
  time_s_ = time_s;
  std::vector<Event> events;
  events.reserve(count);
  for (const std::vector<Event>& row : rows) events.insert(events.end(), row.begin(), row.end());
  std::ranges::stable_sort(events, {}, &Event::t_us);
  return events;
}

}  // namespace tileflight::events
