#include "tileflight/evaluation/localization/sift_features.h"

#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "tileflight/core/base/simd.h"

// An octave is processed in tiles of kTileSize pixels, with a margin that contains what blurring and describing the
// features of the tile need. A tile fits into the cache, and tiles are processed in parallel.
// Sections are those of Lowe's paper (sift_features.h).

namespace tileflight::localization {

using imaging::FloatImage;

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// Angle of (x, y) from -pi to pi, accurate to about 1e-4. The standard library's results differ between processors.
inline float fast_atan2(float x, float y) {
  const float ax = std::abs(x), ay = std::abs(y);
  const float high = std::max(ax, ay), low = std::min(ax, ay);
  if (!(high > 0.0F)) return 0.0F;
  const float t = low / high, s = t * t;
  // Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.47.
  float angle = t * (0.9998660F + s * (-0.3302995F + s * (0.1801410F + s * (-0.0851330F + s * 0.0208351F))));
  if (ay > ax) angle = 0.5F * kPi - angle;
  if (x < 0.0F) angle = kPi - angle;
  return y < 0.0F ? -angle : angle;
}

/// Samples grey values on an `N` x `N` grid around (x, y), along (c, s) and perpendicular to it, `step` pixels apart.
template <int N>
void sample_grid(const FloatImage& image, float x, float y, float c, float s, float step,
                 std::array<float, N * N>& grid) {
  const float half = 0.5F * static_cast<float>(N - 1);
  const auto right = static_cast<float>(image.width) - 1.001F, bottom = static_cast<float>(image.height) - 1.001F;
  for (int j = 0; j < N; ++j) {
    const float v = (static_cast<float>(j) - half) * step;
    for (int i = 0; i < N; ++i) {
      const float u = (static_cast<float>(i) - half) * step;
      const float px = std::clamp(x + c * u - s * v, 0.0F, right), py = std::clamp(y + s * u + c * v, 0.0F, bottom);
      const int ix = static_cast<int>(px), iy = static_cast<int>(py);
      const float a = px - static_cast<float>(ix), b = py - static_cast<float>(iy);
      const float* p = image.row(iy) + ix;
      const float* q = p + image.width;
      const float upper = p[0] + a * (p[1] - p[0]), lower = q[0] + a * (q[1] - q[0]);
      grid[static_cast<std::size_t>(j * N + i)] = upper + b * (lower - upper);
    }
  }
}

}  // namespace

std::vector<float> dominant_orientations(const FloatImage& image, float x, float y, float sigma) {
  constexpr int kBins = 36, kGrid = 15;
  constexpr float kStep = 0.75F, kWindow = 1.5F;  // in sigmas
  constexpr std::size_t kMost = 2;
  std::array<float, kGrid * kGrid> grid;
  sample_grid<kGrid>(image, x, y, 1.0F, 0.0F, kStep * sigma, grid);
  static const std::array<float, kGrid* kGrid> kWeights = [] {
    std::array<float, kGrid * kGrid> weights{};
    for (int j = 1; j + 1 < kGrid; ++j) {
      for (int i = 1; i + 1 < kGrid; ++i) {
        const double u = kStep * (i - kGrid / 2), v = kStep * (j - kGrid / 2), r2 = u * u + v * v;
        constexpr double kReach = 3.0 * kWindow;
        if (r2 <= kReach * kReach)
          weights[j * kGrid + i] = static_cast<float>(std::exp(-0.5 * r2 / (kWindow * kWindow)));
      }
    }
    return weights;
  }();
  std::array<float, kBins> histogram{};
  for (int j = 1; j + 1 < kGrid; ++j) {
    for (int i = 1; i + 1 < kGrid; ++i) {
      const int k = j * kGrid + i;
      const float dx = grid[k + 1] - grid[k - 1], dy = grid[k + kGrid] - grid[k - kGrid];
      const float bin = (fast_atan2(dx, dy) + kPi) * (kBins / (2.0F * kPi)) - 0.5F;
      const float low = std::floor(bin), part = bin - low, weight = kWeights[k] * std::sqrt(dx * dx + dy * dy);
      const int first = (static_cast<int>(low) + kBins) % kBins;
      histogram[first] += (1.0F - part) * weight;
      histogram[(first + 1) % kBins] += part * weight;
    }
  }
  std::array<float, kBins> smooth{};
  for (int k = 0; k < kBins; ++k) {
    const auto h = [&](int d) { return histogram[(k + d + kBins) % kBins]; };
    smooth[k] = 0.375F * h(0) + 0.25F * (h(-1) + h(1)) + 0.0625F * (h(-2) + h(2));
  }
  const float highest = *std::ranges::max_element(smooth);
  std::vector<std::pair<float, float>> peaks;  // minus height, angle
  constexpr float kAlsoPeak = 0.8F;
  for (int k = 0; k < kBins; ++k) {
    const float here = smooth[k], before = smooth[(k + kBins - 1) % kBins], after = smooth[(k + 1) % kBins];
    if (!(here > before && here >= after && here >= kAlsoPeak * highest)) continue;
    const float offset = 0.5F * (before - after) / (before - 2.0F * here + after);
    peaks.emplace_back(-here, (static_cast<float>(k) + 0.5F + offset) * (2.0F * kPi / kBins) - kPi);
  }
  std::ranges::stable_sort(peaks, {}, [](const auto& peak) { return peak.first; });
  std::vector<float> angles;
  for (std::size_t k = 0; k < std::min(kMost, peaks.size()); ++k) angles.push_back(peaks[k].second);
  return angles;
}

namespace {

constexpr int kCells = 4, kDirections = 8;
constexpr int kGrid = 22;           // samples per side; the outermost are used for differences only
constexpr float kCellWidth = 3.0F;  // in sigmas
constexpr float kGridStep = 0.75F;  // in sigmas

/// Cells that a grid sample contributes to, with weights (section 6.1: Gaussian of half the window's width, bilinear
/// between cells).
struct CellShare {
  std::array<int, 4> cell{};
  std::array<float, 4> weight{};
};

const std::array<CellShare, kGrid * kGrid>& cell_shares() {
  static const std::array<CellShare, kGrid* kGrid> kShares = [] {
    std::array<CellShare, kGrid * kGrid> shares{};
    for (int j = 1; j + 1 < kGrid; ++j) {
      for (int i = 1; i + 1 < kGrid; ++i) {
        const double u = (i - 0.5 * (kGrid - 1)) * kGridStep / kCellWidth,
                     v = (j - 0.5 * (kGrid - 1)) * kGridStep / kCellWidth;
        const double window = std::exp(-0.5 * (u * u + v * v) / (0.25 * kCells * kCells));
        const double cu = u + 0.5 * kCells - 0.5, cv = v + 0.5 * kCells - 0.5;
        const int left = static_cast<int>(std::floor(cu)), top = static_cast<int>(std::floor(cv));
        for (int k = 0; k < 4; ++k) {
          const int column = left + k % 2, row = top + k / 2;
          if (column < 0 || row < 0 || column >= kCells || row >= kCells) continue;
          const double part = (k % 2 == 0 ? 1.0 - (cu - left) : cu - left) * (k / 2 == 0 ? 1.0 - (cv - top) : cv - top);
          shares[j * kGrid + i].cell[k] = (row * kCells + column) * kDirections;
          shares[j * kGrid + i].weight[k] = static_cast<float>(part * window);
        }
      }
    }
    return shares;
  }();
  return kShares;
}

/// Converts the histogram to bytes: clipped (section 6.1), then square roots (RootSIFT).
SiftDescriptor as_bytes(std::array<float, 128> histogram) {
  float squares = 0.0F;
  for (const float h : histogram) squares += h * h;
  constexpr float kClip = 0.2F, kTiny = 1e-12F;
  const float most = kClip * std::sqrt(squares);
  float sum = kTiny;
  for (float& h : histogram) sum += h = std::min(h, most);
  SiftDescriptor descriptor;
  for (std::size_t k = 0; k < histogram.size(); ++k)
    descriptor[k] = static_cast<std::uint8_t>(std::min(255.0F, 512.0F * std::sqrt(histogram[k] / sum) + 0.5F));
  return descriptor;
}

}  // namespace

SiftDescriptor compute_descriptor(const FloatImage& image, float x, float y, float sigma, float angle_rad) {
  std::array<float, kGrid * kGrid> grid;
  sample_grid<kGrid>(image, x, y, std::cos(angle_rad), std::sin(angle_rad), kGridStep * sigma, grid);
  const auto& shares = cell_shares();
  std::array<float, 128> histogram{};
  for (int j = 1; j + 1 < kGrid; ++j) {
    for (int i = 1; i + 1 < kGrid; ++i) {
      const int k = j * kGrid + i;
      const float dx = grid[k + 1] - grid[k - 1], dy = grid[k + kGrid] - grid[k - kGrid];
      const float length = std::sqrt(dx * dx + dy * dy);
      const float bin = (fast_atan2(dx, dy) + kPi) * (kDirections / (2.0F * kPi));
      const int low = static_cast<int>(bin);
      const float part = bin - static_cast<float>(low);
      const int first = low % kDirections, second = (low + 1) % kDirections;
      for (int c = 0; c < 4; ++c) {
        const float weight = shares[k].weight[c] * length;
        histogram[shares[k].cell[c] + first] += (1.0F - part) * weight;
        histogram[shares[k].cell[c] + second] += part * weight;
      }
    }
  }
  return as_bytes(histogram);
}

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
