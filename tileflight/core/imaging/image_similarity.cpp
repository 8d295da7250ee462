#include "tileflight/core/imaging/image_similarity.h"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::imaging {
namespace {

constexpr int kRadius = 5;
constexpr double kSigma_px = 1.5;

std::array<double, 2 * kRadius + 1> gaussian() {
  std::array<double, 2 * kRadius + 1> weights{};
  double sum = 0.0;
  for (int i = -kRadius; i <= kRadius; ++i)
    sum += weights[i + kRadius] = std::exp(-0.5 * i * i / kSigma_px / kSigma_px);
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Weighted moments of a window.
struct Moments {
  double a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  void add(double weight, const Moments& other) {
    a += weight * other.a;
    b += weight * other.b;
    aa += weight * other.aa;
    bb += weight * other.bb;
    ab += weight * other.ab;
  }
};

Moments moments_of(double a, double b) { return {a, b, a * a, b * b, a * b}; }

/// Structural similarity by equation 13 of the paper.
double structural_similarity(const Moments& m) {
  constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;
  const double covariance = m.ab - m.a * m.b;
  const double variances = (m.aa - m.a * m.a) + (m.bb - m.b * m.b);
  return (2 * m.a * m.b + kC1) * (2 * covariance + kC2) / ((m.a * m.a + m.b * m.b + kC1) * (variances + kC2));
}

/// Prefix sums of invalid pixels along each row, so that a window is checked with a few sums.
class MaskIntegral {
 public:
  MaskIntegral(const GrayImage& mask, int width, int height) : stride_(width + 1) {
    if (mask.empty()) return;
    sums_.assign(static_cast<std::size_t>(stride_) * (height + 1), 0);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        at(x + 1, y + 1) = at(x, y + 1) + at(x + 1, y) - at(x, y) + (mask(x, y) == 0 ? 1 : 0);
    }
  }
  bool any_masked_around(int x, int y) const {
    if (sums_.empty()) return false;
    const int left = x - kRadius, right = x + kRadius + 1, top = y - kRadius, bottom = y + kRadius + 1;
    return at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top) != 0;
  }

 private:
  std::int32_t& at(int x, int y) { return sums_[static_cast<std::size_t>(y) * stride_ + x]; }
  std::int32_t at(int x, int y) const { return sums_[static_cast<std::size_t>(y) * stride_ + x]; }

  int stride_;
  std::vector<std::int32_t> sums_;
};

struct RowSum {
  double sum = 0.0;
  std::int64_t windows = 0;
};

/// Sums over the windows centred in row y: filters columns first, then along the row.
RowSum windows_of_row(const GrayImage& a, const GrayImage& b, const MaskIntegral& gaps, int y) {
  static const auto kWeights = gaussian();
  std::vector<Moments> columns(static_cast<std::size_t>(a.width));
  for (int j = -kRadius; j <= kRadius; ++j) {
    const std::uint8_t *row_a = a.row(y + j), *row_b = b.row(y + j);
    for (int x = 0; x < a.width; ++x) columns[x].add(kWeights[j + kRadius], moments_of(row_a[x], row_b[x]));
  }
  RowSum out;
  for (int x = kRadius; x + kRadius < a.width; ++x) {
    if (gaps.any_masked_around(x, y)) continue;
    Moments window;
    for (int i = -kRadius; i <= kRadius; ++i) window.add(kWeights[i + kRadius], columns[x + i]);
    out.sum += structural_similarity(window);
    ++out.windows;
  }
  return out;
}

double mean_structural_similarity(const GrayImage& a, const GrayImage& b, const GrayImage& mask) {
  const MaskIntegral gaps(mask, a.width, a.height);
  std::vector<RowSum> rows(static_cast<std::size_t>(a.height));
  tbb::parallel_for(kRadius, a.height - kRadius, [&](int y) { rows[y] = windows_of_row(a, b, gaps, y); });
  RowSum all;
  for (const RowSum& row : rows) {
    all.sum += row.sum;
    all.windows += row.windows;
  }
  return all.windows > 0 ? all.sum / static_cast<double>(all.windows) : std::numeric_limits<double>::quiet_NaN();
}

double correlation(const GrayImage& a, const GrayImage& b, const GrayImage& mask) {
  std::int64_t n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;  // exact: 2^24 terms up to 2^16
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    if (!mask.empty() && mask.pixels[i] == 0) continue;
    const std::int64_t p = a.pixels[i], q = b.pixels[i];
    ++n, sa += p, sb += q, saa += p * p, sbb += q * q, sab += p * q;
  }
  const auto cross = [n](std::int64_t xy, std::int64_t x, std::int64_t y) {
    return static_cast<double>(n) * static_cast<double>(xy) - static_cast<double>(x) * static_cast<double>(y);
  };
  const double product = cross(saa, sa, sa) * cross(sbb, sb, sb);
  return product > 0 ? cross(sab, sa, sb) / std::sqrt(product) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

ImageSimilarity compute_image_similarity(const GrayImage& a, const GrayImage& b, const GrayImage& mask) {
  const auto text = [](const GrayImage& i) { return std::to_string(i.width) + "x" + std::to_string(i.height); };
  if (a.width != b.width || a.height != b.height)
    throw InputError("images to compare", "have " + text(a) + " and " + text(b) + " pixels");
  if (!mask.empty() && (mask.width != a.width || mask.height != a.height))
    throw InputError("images to compare", "have " + text(a) + " pixels, their mask " + text(mask));
  return {correlation(a, b, mask), mean_structural_similarity(a, b, mask)};
}

}  // namespace tileflight::imaging
