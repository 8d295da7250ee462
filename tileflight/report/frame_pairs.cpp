#include "tileflight/report/frame_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/imaging/image_files.h"
#include "tileflight/report/html.h"

namespace tileflight::report {
namespace {

/// How many metres apart count as much as a turn by a degree, when pairs are chosen.
constexpr double kMetresPerDegree = 0.5;
/// Pictures of each part of a flight that are looked at; pairs need not be the very best.
constexpr std::size_t kMostCandidates = 300;
constexpr int kJpegQuality = 82;

struct PosedFrame {
  FrameFile file;
  geometry::SE3 T_local_camera;
};

std::vector<PosedFrame> posed(const FlightRun& flight) {
  std::vector<PosedFrame> result;
  for (const FrameFile& frame : flight.frames) {
    std::optional<geometry::SE3> pose;
    if (flight.estimate) pose = geometry::interpolate(*flight.estimate, frame.time_s);
    if (!flight.estimate && flight.truth) pose = geometry::interpolate(*flight.truth, frame.time_s);
    if (pose) result.push_back({frame, *pose});
  }
  return result;
}

FramePair pair_of(const PosedFrame& a, const PosedFrame& b) {
  const double angle_deg = a.T_local_camera.rotation.angularDistance(b.T_local_camera.rotation) * 180 / std::numbers::pi;
  return {a.file, b.file, (a.T_local_camera.translation - b.T_local_camera.translation).norm(), angle_deg};
}

double unlikeness(const FramePair& pair) { return *pair.distance_m + kMetresPerDegree * *pair.angle_deg; }

/// The most alike pair with the first picture from [begin, end).
FramePair best_pair(const std::vector<PosedFrame>& first, std::size_t begin, std::size_t end, const std::vector<PosedFrame>& second) {
  const std::size_t step = std::max<std::size_t>(1, (end - begin) / kMostCandidates);
  const std::size_t other_step = std::max<std::size_t>(1, second.size() / kMostCandidates);
  FramePair best = pair_of(first[begin], second[0]);
  for (std::size_t i = begin; i < end; i += step) {
    for (std::size_t j = 0; j < second.size(); j += other_step) {
      const FramePair candidate = pair_of(first[i], second[j]);
      if (unlikeness(candidate) < unlikeness(best)) best = candidate;
    }
  }
  return best;
}

}  // namespace

std::vector<FrameFile> spread(const std::vector<FrameFile>& frames, std::size_t count) {
  std::vector<FrameFile> result;
  for (std::size_t i = 0; i < std::min(count, frames.size()); ++i) {
    result.push_back(frames[(2 * i + 1) * frames.size() / (2 * std::min(count, frames.size()))]);
  }
  return result;
}

std::vector<FramePair> frame_pairs(const FlightRun& first, const FlightRun& second, std::size_t count) {
  const std::vector<PosedFrame> a = posed(first), b = posed(second);
  std::vector<FramePair> pairs;
  if (a.size() >= count && !b.empty()) {
    for (std::size_t part = 0; part < count; ++part) pairs.push_back(best_pair(a, part * a.size() / count, (part + 1) * a.size() / count, b));
    return pairs;
  }
  const std::vector<FrameFile> left = spread(first.frames, count), right = spread(second.frames, count);
  for (std::size_t i = 0; i < std::min(left.size(), right.size()); ++i) pairs.push_back({left[i], right[i], {}, {}});
  return pairs;
}

imaging::RgbImage scaled_down(const imaging::RgbImage& image, int width) {
  if (image.width <= width) return image;
  const int height = std::max(1, static_cast<int>(std::lround(static_cast<double>(image.height) * width / image.width)));
  imaging::RgbImage result(width, height);
  for (int y = 0; y < height; ++y) {
    const int top = static_cast<int>(std::int64_t{y} * image.height / height);
    const int bottom = std::max(top + 1, static_cast<int>((std::int64_t{y} + 1) * image.height / height));
    for (int x = 0; x < width; ++x) {
      const int left = static_cast<int>(std::int64_t{x} * image.width / width);
      const int right = std::max(left + 1, static_cast<int>((std::int64_t{x} + 1) * image.width / width));
      std::array<int, 3> sum{};
      for (int v = top; v < bottom; ++v) {
        for (int u = left; u < right; ++u) {
          for (std::size_t c = 0; c < 3; ++c) sum[c] += image(u, v)[c];
        }
      }
      const int area = (bottom - top) * (right - left);
      for (std::size_t c = 0; c < 3; ++c) result(x, y)[c] = static_cast<std::uint8_t>((sum[c] + area / 2) / area);
    }
  }
  return result;
}

std::string thumbnail_uri(const std::filesystem::path& image, int width) {
  const std::vector<std::byte> jpeg = imaging::encode_jpeg(scaled_down(imaging::read_rgb(image), width), kJpegQuality);
  return data_uri("image/jpeg", {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
}

}  // namespace tileflight::report
