#include "tileflight/evaluation/localization/sift_descriptor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

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

}  // namespace tileflight::localization
