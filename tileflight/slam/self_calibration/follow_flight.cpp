#include "tileflight/slam/self_calibration/follow_flight.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/video/video.h"
#include "tileflight/slam/keyframes/valid_region.h"

namespace tileflight::self_calibration {
namespace fs = std::filesystem;
namespace {

using OnImage = std::function<bool(double time_s, const imaging::RgbImage& image)>;

/// Images in the order of time.
struct ImageSource {
  double from_s = 0.0, to_s = 0.0;
  int width = 0, height = 0;
  bool has_times = true;
  /// Reads images from a time on until the last, or until the call returns false.
  std::function<void(double from_s, const OnImage& on_image)> read;
};

ImageSource video_source(const fs::path& file, const FlightImages& images) {
  const video::VideoInfo info = video::probe_video(file);
  ImageSource source{.from_s = images.from_s,
                     .to_s = std::min(images.to_s.value_or(info.duration_s), info.duration_s),
                     .width = info.width,
                     .height = info.height,
                     .has_times = true,
                     .read = {}};
  source.read = [file, every = images.every, to_s = images.to_s](double from_s, const OnImage& on_image) {
    video::read_video(
        file, {.from_s = from_s, .to_s = to_s, .every = every},
        [&](std::int64_t, double time_s, const imaging::RgbImage& image) { return on_image(time_s, image); });
  };
  return source;
}

/// Reads a frame, of the size that the flight's first has; nullopt if it is broken.
std::optional<imaging::RgbImage> read_image(const fs::path& file, int width, int height) {
  std::optional<imaging::RgbImage> image;
  try {
    image = imaging::read_rgb(file);
  } catch (const InputError&) {
    return std::nullopt;
  }
  if (image->width == width && image->height == height) return image;
  throw InputError(file.string(), "is " + std::to_string(image->width) + "x" + std::to_string(image->height) +
                                      ", the images before it are " + std::to_string(width) + "x" +
                                      std::to_string(height) + "; images of one lens have one size");
}

ImageSource frames_source(const std::vector<dataset::Frame>& all, bool has_times, const FlightImages& images) {
  const double first_s = all.front().time_s;
  std::vector<dataset::Frame> frames;
  std::size_t in_range = 0;
  for (const dataset::Frame& frame : all) {
    const double time_s = frame.time_s - first_s;
    if (time_s < images.from_s || (images.to_s && time_s >= *images.to_s)) continue;
    if (in_range++ % static_cast<std::size_t>(std::max(1, images.every)) == 0) frames.push_back(frame);
  }
  if (frames.empty())
    throw InputError(all.front().image.parent_path().string(), "has no images from " + std::to_string(images.from_s) +
                                                                   " s on; choose another part (--from, --to)");
  const imaging::RgbImage first = imaging::read_rgb(frames.front().image);
  ImageSource source{.from_s = frames.front().time_s,
                     .to_s = frames.back().time_s,
                     .width = first.width,
                     .height = first.height,
                     .has_times = has_times,
                     .read = {}};
  source.read = [frames, width = first.width, height = first.height](double from_s, const OnImage& on_image) {
    for (const dataset::Frame& frame : frames) {
      if (frame.time_s < from_s) continue;
      const auto image = read_image(frame.image, width, height);
      if (image && !on_image(frame.time_s, *image)) return;
    }
  };
  return source;
}

ImageSource open_source(const fs::path& source, const FlightImages& images) {
  if (!fs::is_directory(source)) return video_source(source, images);
  if (is_dataset(source)) return frames_source(dataset::read_dataset(source).frames, true, images);
  const double period_s = images.image_rate_hz ? 1.0 / *images.image_rate_hz : dataset::kDefaultFramePeriod_s;
  return frames_source(dataset::make_uniform_frames(dataset::list_images(source), period_s),
                       images.image_rate_hz.has_value(), images);
}

/// Sizes of an image and of those that are halved from it, for keyframes::mask_rays.
keyframes::LensPyramid rays_everywhere(int width, int height, int halvings) {
  keyframes::LensPyramid lens;
  for (int level = 0; level <= halvings; ++level) {
    lens.rays.push_back({width, height, {}});
    lens.rays.back().rays.assign(static_cast<std::size_t>(width) * height, Eigen::Vector3f::UnitZ());
    width /= 2;
    height /= 2;
  }
  return lens;
}

std::shared_ptr<const keyframes::Pyramid> halved_pyramid(const imaging::RgbImage& image, int halvings) {
  constexpr int kSmallest_px = 40;
  int levels = halvings + 1;
  while ((std::min(image.width, image.height) >> levels) >= kSmallest_px) ++levels;
  auto pyramid = keyframes::build_pyramid(keyframes::luminance(image, nullptr), levels);
  pyramid.levels.erase(pyramid.levels.begin(), pyramid.levels.begin() + halvings);
  return std::make_shared<keyframes::Pyramid>(std::move(pyramid));
}

}  // namespace

bool is_dataset(const fs::path& source) {
  return fs::is_directory(source) && (fs::is_directory(source / "images") || dataset::has_foreign_layout(source));
}

FollowedFlight follow_flight(const fs::path& path, const FlightImages& images, const SegmentOptions& options,
                             const Progress& progress) {
  const ImageSource source = open_source(path, images);
  FollowedFlight flight{.full_width = source.width,
                        .full_height = source.height,
                        .width = source.width,
                        .height = source.height,
                        .halvings = 0,
                        .has_times = source.has_times,
                        .segments = {}};
  while (flight.width > options.width_px) {
    ++flight.halvings;
    flight.width /= 2;
    flight.height /= 2;
  }
  const imaging::GrayImage mask = images.mask.empty() ? imaging::GrayImage() : imaging::read_gray(images.mask);
  constexpr double kShortest = 0.02;  // a segment is not begun so close to the end, as a share of the flight
  double next_s = source.from_s;
  for (std::size_t i = 0; i < options.segments; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(options.segments);
    next_s = std::max(next_s, source.from_s + share * (source.to_s - source.from_s));
    if (i > 0 && source.to_s - next_s <= kShortest * (source.to_s - source.from_s)) break;
    report_progress(progress, static_cast<std::int64_t>(i), static_cast<std::int64_t>(options.segments),
                    "following corners");
    std::optional<SegmentFollower> follower;
    source.read(next_s, [&](double time_s, const imaging::RgbImage& image) {
      if (!follower) {
        keyframes::LensPyramid lens = rays_everywhere(image.width, image.height, flight.halvings);
        keyframes::mask_rays(lens, keyframes::find_valid_region(image, mask));
        follower.emplace(options, std::move(lens.rays.back()));
      }
      next_s = time_s;
      return follower->add(time_s, halved_pyramid(image, flight.halvings));
    });
    if (!follower) break;
    flight.segments.push_back(follower->finish());
  }
  return flight;
}

}  // namespace tileflight::self_calibration
