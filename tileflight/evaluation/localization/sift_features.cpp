#include "tileflight/evaluation/localization/sift_features.h"

#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "tileflight/core/base/simd.h"
#include "tileflight/evaluation/localization/sift_descriptor.h"

// An octave is processed in tiles of kTileSize pixels, with a margin that contains what blurring and describing the
// features of the tile need. A tile fits into the cache, and tiles are processed in parallel.
namespace tileflight::localization {

using imaging::FloatImage;
using imaging::GrayImage;

namespace {

constexpr int kScales = 3;  // per octave, section 3.2 of Lowe's paper
constexpr int kLevels = kScales + 3;
constexpr float kFirstSigma = 1.6F;   // section 3.3
constexpr float kCameraSigma = 0.5F;  // blur of an input image, as Lowe assumes (section 3.3)
constexpr int kTileSize = 512;
constexpr int kMargin = 64;

// ---- blur ----

std::vector<float> gaussian(float sigma) {
  const int reach = static_cast<int>(std::ceil(3.0F * sigma));
  std::vector<float> weights;
  double sum = 0.0;
  for (int k = -reach; k <= reach; ++k) sum += std::exp(-0.5 * k * k / (static_cast<double>(sigma) * sigma));
  for (int k = 0; k <= reach; ++k)
    weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (static_cast<double>(sigma) * sigma)) / sum));
  return weights;  // centre and one side
}

/// sum_k weights[|k|] source[x + k stride] for x in [0, n).
TILEFLIGHT_WIDE_VECTORS void convolve(const float* source, std::ptrdiff_t stride, const float* weights, int reach,
                                      int n, float* result) {
  for (int x = 0; x < n; ++x) result[x] = weights[0] * source[x];
  for (int k = 1; k <= reach; ++k) {
    const float* before = source - k * stride;
    const float* after = source + k * stride;
    const float w = weights[k];
    for (int x = 0; x < n; ++x) result[x] += w * (before[x] + after[x]);
  }
}

/// Blurs `image` into `result`; border pixels are repeated outside. `memory` is scratch storage.
void blur(const FloatImage& image, float sigma, FloatImage& result, FloatImage& memory) {
  const std::vector<float> weights = gaussian(sigma);
  const int reach = static_cast<int>(weights.size()) - 1, width = image.width, height = image.height;
  // Vertical pass, row by row; border rows are repeated outside.
  memory = FloatImage();
  memory.width = width + 2 * reach, memory.height = height;
  memory.pixels.resize(static_cast<std::size_t>(memory.width) * height);
  std::vector<float> padded(static_cast<std::size_t>(width) * (height + 2 * static_cast<std::size_t>(reach)));
  for (int y = -reach; y < height + reach; ++y)
    std::copy_n(image.row(std::clamp(y, 0, height - 1)), width,
                padded.begin() + static_cast<std::ptrdiff_t>(y + reach) * width);
  result.width = width, result.height = height;
  result.pixels.resize(static_cast<std::size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    float* row = memory.row(y);
    convolve(padded.data() + static_cast<std::ptrdiff_t>(y + reach) * width, width, weights.data(), reach, width,
             row + reach);
    std::fill_n(row, reach, row[reach]);
    std::fill_n(row + reach + width, reach, row[reach + width - 1]);
    convolve(row + reach, 1, weights.data(), reach, width, result.row(y));
  }
}

float sigma_of_level(int level) { return kFirstSigma * std::exp2(static_cast<float>(level) / kScales); }

// ---- one tile ----

/// Part of an octave with its margin: pixel (x, y) of the levels is (x0 + x, y0 + y) of the octave.
struct Tile {
  int x0 = 0, y0 = 0;
  std::array<FloatImage, kLevels> blurred;
  std::array<FloatImage, kLevels - 1> difference;
};

void subtract(const FloatImage& a, const FloatImage& b, FloatImage& difference) {
  difference.width = a.width, difference.height = a.height;
  difference.pixels.resize(a.pixels.size());
  for (std::size_t k = 0; k < a.pixels.size(); ++k) difference.pixels[k] = b.pixels[k] - a.pixels[k];
}

void blur_levels(Tile& square) {
  FloatImage memory;
  for (int level = 1; level < kLevels; ++level) {
    const float from = sigma_of_level(level - 1), to = sigma_of_level(level);
    blur(square.blurred[level - 1], std::sqrt(to * to - from * from), square.blurred[level], memory);
    subtract(square.blurred[level - 1], square.blurred[level], square.difference[level - 1]);
  }
}

bool is_extremum(const Tile& square, int level, int x, int y) {
  const float value = square.difference[level](x, y);
  for (int l = level - 1; l <= level + 1; ++l) {
    for (int dy = -1; dy <= 1; ++dy) {
      const float* p = square.difference[l].row(y + dy) + x;
      const float low = std::min({p[-1], p[0], p[1]}), high = std::max({p[-1], p[0], p[1]});
      if (value > 0.0F ? high > value : low < value) return false;
    }
  }
  return true;
}

/// A keypoint of an octave.
struct Keypoint {
  float x, y;      ///< of the octave
  float level;     ///< fractional level in the octave
  float contrast;  ///< value of the difference of Gaussians there
};

/// Derivatives of the differences of Gaussians by (x, y, level) at a sample.
struct Derivatives {
  Eigen::Vector3f gradient;
  Eigen::Matrix3f hessian;
};

Derivatives derivatives_at(const Tile& square, int level, int x, int y) {
  const auto d = [&](int dx, int dy, int dl) { return square.difference[level + dl](x + dx, y + dy); };
  const auto mixed = [&](int ax, int ay, int al, int bx, int by, int bl) {
    return 0.25F * (d(ax + bx, ay + by, al + bl) - d(ax - bx, ay - by, al - bl) - d(bx - ax, by - ay, bl - al) +
                    d(-ax - bx, -ay - by, -al - bl));
  };
  const float middle = 2.0F * d(0, 0, 0);
  Derivatives result;
  result.gradient << 0.5F * (d(1, 0, 0) - d(-1, 0, 0)), 0.5F * (d(0, 1, 0) - d(0, -1, 0)),
      0.5F * (d(0, 0, 1) - d(0, 0, -1));
  const float xy = mixed(1, 0, 0, 0, 1, 0), xl = mixed(1, 0, 0, 0, 0, 1), yl = mixed(0, 1, 0, 0, 0, 1);
  result.hessian << d(1, 0, 0) + d(-1, 0, 0) - middle, xy, xl,  //
      xy, d(0, 1, 0) + d(0, -1, 0) - middle, yl,                //
      xl, yl, d(0, 0, 1) + d(0, 0, -1) - middle;
  return result;
}

bool is_edge(const Eigen::Matrix3f& hessian, float most_ratio) {
  const float trace = hessian(0, 0) + hessian(1, 1);
  const float determinant = hessian(0, 0) * hessian(1, 1) - hessian(0, 1) * hessian(0, 1);
  return !(determinant > 0.0F) || trace * trace * most_ratio >= (most_ratio + 1.0F) * (most_ratio + 1.0F) * determinant;
}

/// Section 4: extremum of a quadratic through the samples; nullopt for edges (section 4.1).
std::optional<Keypoint> refine_extremum(const Tile& square, int level, int x, int y, const SiftOptions& options) {
  constexpr int kMoves = 5;
  const int width = square.blurred[0].width, height = square.blurred[0].height;
  for (int move = 0; move < kMoves; ++move) {
    const Derivatives d = derivatives_at(square, level, x, y);
    const Eigen::Vector3f offset = -d.hessian.partialPivLu().solve(d.gradient);
    if (!offset.allFinite()) return std::nullopt;
    if (offset.cwiseAbs().maxCoeff() <= 0.5F) {
      const float contrast = square.difference[level](x, y) + 0.5F * d.gradient.dot(offset);
      if (std::abs(contrast) < options.min_contrast) return std::nullopt;
      if (is_edge(d.hessian, static_cast<float>(options.max_edge_ratio))) return std::nullopt;
      return Keypoint{static_cast<float>(square.x0 + x) + offset.x(), static_cast<float>(square.y0 + y) + offset.y(),
                      static_cast<float>(level) + offset.z(), contrast};
    }
    x += static_cast<int>(std::lround(std::clamp(offset.x(), -1.0F, 1.0F)));
    y += static_cast<int>(std::lround(std::clamp(offset.y(), -1.0F, 1.0F)));
    level += static_cast<int>(std::lround(std::clamp(offset.z(), -1.0F, 1.0F)));
    if (level < 1 || level > kScales || x < 1 || y < 1 || x >= width - 1 || y >= height - 1) return std::nullopt;
  }
  return std::nullopt;
}

/// Keypoints of the tile without its margin, those of highest contrast.
std::vector<Keypoint> find_keypoints(const Tile& square, int left, int top, int right, int bottom,
                                     const SiftOptions& options) {
  const auto threshold = static_cast<float>(0.8 * options.min_contrast);
  const int width = square.blurred[0].width, height = square.blurred[0].height;
  std::vector<Keypoint> keypoints;
  for (int level = 1; level <= kScales; ++level) {
    const FloatImage& difference = square.difference[level];
    for (int y = std::max(1, top - square.y0); y < std::min(height - 1, bottom - square.y0); ++y) {
      const float* row = difference.row(y);
      for (int x = std::max(1, left - square.x0); x < std::min(width - 1, right - square.x0); ++x) {
        const float value = row[x];
        if (std::abs(value) < threshold) continue;
        if (value > 0.0F ? value < row[x - 1] || value < row[x + 1] : value > row[x - 1] || value > row[x + 1])
          continue;
        if (!is_extremum(square, level, x, y)) continue;
        if (const auto keypoint = refine_extremum(square, level, x, y, options)) keypoints.push_back(*keypoint);
      }
    }
  }
  if (keypoints.size() > options.max_per_tile) {
    std::ranges::stable_sort(keypoints,
                             [](const auto& a, const auto& b) { return std::abs(a.contrast) > std::abs(b.contrast); });
    keypoints.resize(options.max_per_tile);
  }
  return keypoints;
}

// ---- octaves ----

/// Whether the support of a descriptor at (x, y) of the full image was seen.
bool is_seen_around(const GrayImage& seen, float x, float y, float sigma) {
  if (seen.empty()) return true;
  constexpr int kAround = 12;
  constexpr float kReach = 4.0F;
  static const std::array<std::pair<float, float>, kAround> kCircle = [] {
    std::array<std::pair<float, float>, kAround> circle;
    for (int k = 0; k < kAround; ++k)
      circle[k] = {static_cast<float>(std::cos(2.0 * std::numbers::pi * k / kAround)),
                   static_cast<float>(std::sin(2.0 * std::numbers::pi * k / kAround))};
    return circle;
  }();
  const auto is_seen = [&](float px, float py) {
    const auto i = static_cast<int>(std::lround(px)), j = static_cast<int>(std::lround(py));
    return i >= 0 && j >= 0 && i < seen.width && j < seen.height && seen(i, j) != 0;
  };
  if (!is_seen(x, y)) return false;
  return std::ranges::all_of(
      kCircle, [&](const auto& p) { return is_seen(x + kReach * sigma * p.first, y + kReach * sigma * p.second); });
}

/// One octave: the image itself, then repeatedly blurred and halved.
struct Octave {
  const GrayImage* bytes = nullptr;  ///< first octave
  FloatImage grey;                   ///< other octaves, blurred by kFirstSigma
  int index = 0;

  int width() const { return bytes != nullptr ? bytes->width : grey.width; }
  int height() const { return bytes != nullptr ? bytes->height : grey.height; }
};

/// Factor from coordinates of an octave to image pixels: pixel k of an octave is pixel 2 k of the previous one.
float octave_scale(int index) { return std::exp2(static_cast<float>(index)); }

Tile extract_tile(const Octave& octave, int left, int top, int right, int bottom) {
  Tile square;
  square.x0 = std::max(0, left - kMargin), square.y0 = std::max(0, top - kMargin);
  const int width = std::min(octave.width(), right + kMargin) - square.x0;
  const int height = std::min(octave.height(), bottom + kMargin) - square.y0;
  FloatImage cut(width, height);
  for (int y = 0; y < height; ++y) {
    if (octave.bytes != nullptr) {
      std::copy_n(octave.bytes->row(square.y0 + y) + square.x0, width, cut.row(y));
    } else {
      std::copy_n(octave.grey.row(square.y0 + y) + square.x0, width, cut.row(y));
    }
  }
  if (octave.bytes == nullptr) {
    square.blurred[0] = std::move(cut);
  } else {
    FloatImage memory;
    blur(cut, std::sqrt(kFirstSigma * kFirstSigma - kCameraSigma * kCameraSigma), square.blurred[0], memory);
  }
  return square;
}

void describe_keypoints(const Tile& square, const std::vector<Keypoint>& keypoints, const Octave& octave,
                        const GrayImage& seen, LocalFeatures& found) {
  const float factor = octave_scale(octave.index);
  for (const Keypoint& keypoint : keypoints) {
    const float sigma = kFirstSigma * std::exp2(keypoint.level / kScales);
    LocalFeature feature{factor * keypoint.x, factor * keypoint.y, factor * sigma, 0.0F, keypoint.contrast};
    if (!is_seen_around(seen, feature.x, feature.y, feature.sigma)) continue;
    const FloatImage& image = square.blurred[static_cast<std::size_t>(std::lround(keypoint.level))];
    const float x = keypoint.x - static_cast<float>(square.x0), y = keypoint.y - static_cast<float>(square.y0);
    for (const float angle_rad : dominant_orientations(image, x, y, sigma)) {
      feature.angle_rad = angle_rad;
      found.features.push_back(feature);
      found.descriptors.push_back(compute_descriptor(image, x, y, sigma, angle_rad));
    }
  }
}

/// Writes every second pixel of the level with twice the blur.
void downsample_into(const Tile& square, int left, int top, int right, int bottom, FloatImage& next) {
  const FloatImage& image = square.blurred[kScales];
  for (int y = top; y < bottom; y += 2) {
    for (int x = left; x < right; x += 2)
      if (x / 2 < next.width && y / 2 < next.height) next(x / 2, y / 2) = image(x - square.x0, y - square.y0);
  }
}

void append(LocalFeatures& all, const LocalFeatures& part) {
  all.features.insert(all.features.end(), part.features.begin(), part.features.end());
  all.descriptors.insert(all.descriptors.end(), part.descriptors.begin(), part.descriptors.end());
}

/// Appends the features of an octave to `all`; returns the next octave.
Octave process_octave(const Octave& octave, const GrayImage& seen, const SiftOptions& options, LocalFeatures& all) {
  const int width = octave.width(), height = octave.height();
  const int columns = (width + kTileSize - 1) / kTileSize, rows = (height + kTileSize - 1) / kTileSize;
  Octave next;
  next.index = octave.index + 1;
  next.grey = FloatImage(width / 2, height / 2);
  std::vector<LocalFeatures> parts(static_cast<std::size_t>(columns) * rows);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
    const int left = static_cast<int>(k) % columns * kTileSize, top = static_cast<int>(k) / columns * kTileSize;
    const int right = std::min(width, left + kTileSize), bottom = std::min(height, top + kTileSize);
    Tile square = extract_tile(octave, left, top, right, bottom);
    blur_levels(square);
    downsample_into(square, left, top, right, bottom, next.grey);
    describe_keypoints(square, find_keypoints(square, left, top, right, bottom, options), octave, seen, parts[k]);
  });
  for (const LocalFeatures& part : parts) append(all, part);
  return next;
}

}  // namespace

LocalFeatures find_sift_features(const GrayImage& image, const GrayImage& seen, const SiftOptions& options) {
  LocalFeatures all;
  Octave octave;
  octave.bytes = &image;
  constexpr int kSmallest = 16;
  while (std::min(octave.width(), octave.height()) >= kSmallest) octave = process_octave(octave, seen, options, all);
  return all;
}

}  // namespace tileflight::localization
