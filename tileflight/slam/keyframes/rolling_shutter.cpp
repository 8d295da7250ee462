#include "tileflight/slam/keyframes/rolling_shutter.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "tileflight/core/base/simd.h"

namespace tileflight::keyframes {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;
using geometry::SE3;
using geometry::Vec6;

constexpr int kCell_px = 16;

/// Sums of inverse distances by cell.
struct DepthGrid {
  int columns = 0;
  int rows = 0;
  std::vector<float> weighted_rho;
  std::vector<float> weight;

  DepthGrid(int c, int r) : columns(c), rows(r), weighted_rho(static_cast<std::size_t>(c) * r), weight(weighted_rho) {}
  std::size_t index(int c, int r) const { return static_cast<std::size_t>(r) * columns + c; }
  float rho(int c, int r) const { return weighted_rho[index(c, r)] / weight[index(c, r)]; }
};

DepthGrid downsample(const DepthGrid& fine) {
  DepthGrid half((fine.columns + 1) / 2, (fine.rows + 1) / 2);
  for (int r = 0; r < fine.rows; ++r) {
    for (int c = 0; c < fine.columns; ++c) {
      half.weighted_rho[half.index(c / 2, r / 2)] += fine.weighted_rho[fine.index(c, r)];
      half.weight[half.index(c / 2, r / 2)] += fine.weight[fine.index(c, r)];
    }
  }
  return half;
}

/// Fills empty cells with the mean of the smallest surrounding block of cells that has a value (push-pull: Gortler et
/// al. 1996).
DepthGrid fill_empty_cells(DepthGrid depth) {
  const bool full = std::all_of(depth.weight.begin(), depth.weight.end(), [](float w) { return w > 0; });
  if (full) return depth;
  if (depth.columns == 1 && depth.rows == 1) {
    depth.weight[0] = 1.0F;  // no depth at all: assume infinity
    return depth;
  }
  const DepthGrid coarse = fill_empty_cells(downsample(depth));
  for (int r = 0; r < depth.rows; ++r) {
    for (int c = 0; c < depth.columns; ++c) {
      const std::size_t i = depth.index(c, r);
      if (depth.weight[i] > 0) continue;
      depth.weight[i] = 1.0F;
      depth.weighted_rho[i] = coarse.rho(c / 2, r / 2);
    }
  }
  return depth;
}

DepthGrid bin_depths(int columns, int rows, const std::vector<DepthSample>& samples) {
  DepthGrid depth(columns, rows);
  for (const DepthSample& sample : samples) {
    const int c = static_cast<int>(std::floor((sample.pixel.x() + 0.5F) / kCell_px));
    const int r = static_cast<int>(std::floor((sample.pixel.y() + 0.5F) / kCell_px));
    if (c < 0 || r < 0 || c >= columns || r >= rows) continue;
    depth.weighted_rho[depth.index(c, r)] += sample.rho;
    depth.weight[depth.index(c, r)] += 1.0F;
  }
  return fill_empty_cells(std::move(depth));
}

/// Displacement from a pixel of the middle row's camera to its pixel in the rolling-shutter image.
Vector2f solve_displacement(const Lens& lens, int height, const Vec6& twist, const Vector2f& pixel, float rho) {
  constexpr int kIterations = 3;
  const auto ray = lens.unproject(pixel.cast<double>());
  if (!ray) return Vector2f::Zero();
  Vector2f found = pixel;
  for (int i = 0; i < kIterations; ++i) {
    const double share = std::clamp((found.y() - 0.5 * (height - 1)) / height, -0.5, 0.5);
    const SE3 T_row_middle = SE3::exp(share * twist);
    const Vector3f X = (T_row_middle.rotation * *ray + rho * T_row_middle.translation).cast<float>();
    Vector2f landed;
    if (!lens.project<float>(X, landed)) return Vector2f::Zero();
    found = landed;
  }
  return found - pixel;
}

/// Weights of four neighbours at the position `t` between the second and the third.
std::array<float, 4> cubic_weights(float t) {
  const float t2 = t * t, t3 = t2 * t;
  return {0.5F * (-t + 2 * t2 - t3), 0.5F * (2 - 5 * t2 + 3 * t3), 0.5F * (t + 4 * t2 - 3 * t3), 0.5F * (t3 - t2)};
}

using base::Float4;
using Bytes16 = std::uint8_t __attribute__((vector_size(16)));

/// Four pixels from (x, y) to the right; border pixels are repeated outside.
template <class Pixel>
Float4 load_pixels4(int width, int height, int x, int y, const Pixel& pixel) {
  const int row = std::clamp(y, 0, height - 1);
  if (x >= 0 && x + 3 < width) return Float4{pixel(x, row), pixel(x + 1, row), pixel(x + 2, row), pixel(x + 3, row)};
  Float4 out{};
  for (int i = 0; i < 4; ++i) out[i] = pixel(std::clamp(x + i, 0, width - 1), row);
  return out;
}

/// Cubic interpolation of `pixel(x, y)`.
template <class Pixel>
float sample_cubic(int width, int height, const Vector2f& at, const Pixel& pixel) {
  const float x = std::clamp(at.x(), 0.0F, static_cast<float>(width - 1));
  const float y = std::clamp(at.y(), 0.0F, static_cast<float>(height - 1));
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const std::array<float, 4> across = cubic_weights(x - static_cast<float>(ix));
  const std::array<float, 4> down = cubic_weights(y - static_cast<float>(iy));
  Float4 sum{};
  for (int j = 0; j < 4; ++j) sum += down[j] * load_pixels4(width, height, ix - 1, iy - 1 + j, pixel);
  return (across[0] * sum[0] + across[1] * sum[1]) + (across[2] * sum[2] + across[3] * sum[3]);
}

/// Interpolates the three colours at once.
imaging::Rgb8 color_cubic(const imaging::RgbImage& picture, const Vector2f& at) {
  const float x = std::clamp(at.x(), 0.0F, static_cast<float>(picture.width - 1));
  const float y = std::clamp(at.y(), 0.0F, static_cast<float>(picture.height - 1));
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const std::array<float, 4> across = cubic_weights(x - static_cast<float>(ix));
  const std::array<float, 4> down = cubic_weights(y - static_cast<float>(iy));
  Float4 sum{};
  for (int j = 0; j < 4; ++j) {
    const imaging::Rgb8* row = picture.row(std::clamp(iy - 1 + j, 0, picture.height - 1));
    for (int i = 0; i < 4; ++i) {
      const imaging::Rgb8& from = row[std::clamp(ix - 1 + i, 0, picture.width - 1)];
      const Float4 color{static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(from[2]), 0.0F};
      sum += (down[j] * across[i]) * color;
    }
  }
  imaging::Rgb8 out;
  for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::clamp(sum[c] + 0.5F, 0.0F, 255.0F));
  return out;
}

/// Linear interpolation between cell centres: index of the left or upper cell, and the weight of the other.
struct CellInterpolation {
  int cell = 0;
  float share = 0.0F;
};
TILEFLIGHT_LANE_INLINE CellInterpolation locate_between_cells(int pixel, int cells) {
  const float at =
      std::clamp((static_cast<float>(pixel) + 0.5F) / kCell_px - 0.5F, 0.0F, static_cast<float>(cells - 1));
  const int cell = std::min(static_cast<int>(at), std::max(0, cells - 2));
  return {cell, at - static_cast<float>(cell)};
}

/// A row's displacements at the columns of cells.
void interpolate_row(const std::vector<Vector2f>& cells, int columns, int rows, int y, std::vector<Vector2f>& out) {
  const CellInterpolation at = locate_between_cells(y, rows);
  const Vector2f* top = cells.data() + static_cast<std::size_t>(at.cell) * columns;
  const Vector2f* bottom = rows > 1 ? top + columns : top;
  out.resize(columns);
  for (int c = 0; c < columns; ++c) out[c] = top[c] + at.share * (bottom[c] - top[c]);
}

Vector2f apply_displacement(const std::vector<Vector2f>& row, int x, int y) {
  const int columns = static_cast<int>(row.size());
  const CellInterpolation at = locate_between_cells(x, columns);
  const Vector2f &left = row[at.cell], &right = row[std::min(at.cell + 1, columns - 1)];
  return Vector2f(x, y) + left + at.share * (right - left);
}

/// cubic_weights() for eight positions at once.
TILEFLIGHT_LANE_INLINE void cubic_weights(const base::Float8& t, std::array<base::Float8, 4>& out) {
  const base::Float8 t2 = t * t, t3 = t2 * t;
  out = {0.5F * (-t + 2 * t2 - t3), 0.5F * (2 - 5 * t2 + 3 * t3), 0.5F * (t + 4 * t2 - 3 * t3), 0.5F * (t3 - t2)};
}

TILEFLIGHT_LANE_INLINE void clamp8(float most, base::Float8& x) {
  x = x < 0.0F ? base::Float8{} : x;
  x = x > most ? base::Float8{} + most : x;
}

/// First pixels of eight 4x4 neighbourhoods, and their weights.
struct BicubicSupport8 {
  base::Mask8 column, row;
  std::array<base::Float8, 4> weights_x, weights_y;
};

/// Supports of the pixels x ... x + 7 of row y; x is a multiple of 8, so all lie between the same columns of cells.
TILEFLIGHT_LANE_INLINE void bicubic_support(const std::vector<Vector2f>& displacements, int width, int height, int x,
                                            int y, BicubicSupport8& out) {
  static_assert(kCell_px == 2 * base::kLanes);
  const int columns = static_cast<int>(displacements.size());
  const base::Float8 ramp{0, 1, 2, 3, 4, 5, 6, 7};
  const int cell = locate_between_cells(x, columns).cell;
  base::Float8 share = (ramp + static_cast<float>(x) + 0.5F) / kCell_px - 0.5F;
  clamp8(static_cast<float>(columns - 1), share);
  share -= static_cast<float>(cell);
  const Vector2f left = displacements[cell], step = displacements[std::min(cell + 1, columns - 1)] - left;
  base::Float8 u = (ramp + static_cast<float>(x) + left.x()) + share * step.x();
  base::Float8 v = (base::Float8{} + static_cast<float>(y) + left.y()) + share * step.y();
  clamp8(static_cast<float>(width - 1), u);
  clamp8(static_cast<float>(height - 1), v);
  const base::Mask8 iu = __builtin_convertvector(u, base::Mask8), iv = __builtin_convertvector(v, base::Mask8);
  cubic_weights(u - __builtin_convertvector(iu, base::Float8), out.weights_x);
  cubic_weights(v - __builtin_convertvector(iv, base::Float8), out.weights_y);
  out.column = iu - 1;
  out.row = iv - 1;
}

/// One row of the rectified (global-shutter) image.
TILEFLIGHT_WIDE_VECTORS
void rectify_row(const PyramidLevel& picture, const std::vector<Vector2f>& displacements, int y, float* out) {
  const int width = picture.width, height = picture.height;
  const auto grey = [&](int x, int row) { return picture.row(row)[x]; };
  int x = 0;
  for (; x + base::kLanes <= width; x += base::kLanes) {
    BicubicSupport8 at;
    bicubic_support(displacements, width, height, x, y, at);
    for (int i = 0; i < base::kLanes; ++i) {
      const int column = at.column[i], row = at.row[i];
      Float4 sum{};
      if (column >= 0 && row >= 0 && column + 3 < width && row + 3 < height) {
        const float* from = picture.row(row) + column;
        for (int j = 0; j < 4; ++j) {
          Float4 four;
          std::memcpy(&four, from + static_cast<std::size_t>(j) * width, sizeof(four));
          sum += at.weights_y[j][i] * four;
        }
      } else {
        for (int j = 0; j < 4; ++j) sum += at.weights_y[j][i] * load_pixels4(width, height, column, row + j, grey);
      }
      const float value = (at.weights_x[0][i] * sum[0] + at.weights_x[1][i] * sum[1]) +
                          (at.weights_x[2][i] * sum[2] + at.weights_x[3][i] * sum[3]);
      out[x + i] = std::max(value, 0.0F);
    }
  }
  for (; x < width; ++x)
    out[x] = std::max(sample_cubic(width, height, apply_displacement(displacements, x, y), grey), 0.0F);
}

/// The colour at the `i`-th of the pixels of which these are the first 16 bytes; the fourth part is a byte of the next.
template <int i>
TILEFLIGHT_LANE_INLINE void color_of_bytes(const Bytes16& bytes, Float4& color) {
  constexpr int k = 3 * i, o = 16;  // o: of the zeros
  const Bytes16 parts =
      __builtin_shufflevector(bytes, Bytes16{}, k, o, o, o, k + 1, o, o, o, k + 2, o, o, o, k + 3, o, o, o);
  color = __builtin_convertvector(reinterpret_cast<base::Int4>(parts), Float4);
}

/// One row of the rectified picture: color_cubic() of its pixels, to the bit.
TILEFLIGHT_WIDE_VECTORS
void rectify_color_row(const imaging::RgbImage& picture, const std::vector<Vector2f>& displacements, int y,
                       imaging::Rgb8* out) {
  constexpr int kLoaded = 6;  // pixels that 16 bytes reach into
  const int width = picture.width, height = picture.height;
  int x = 0;
  for (; x + base::kLanes <= width; x += base::kLanes) {
    BicubicSupport8 at;
    bicubic_support(displacements, width, height, x, y, at);
    for (int i = 0; i < base::kLanes; ++i) {
      const int column = at.column[i], row = at.row[i];
      if (column < 0 || row < 0 || column + kLoaded > width || row + 4 > height) {
        out[x + i] = color_cubic(picture, apply_displacement(displacements, x + i, y));
        continue;
      }
      Float4 sum{};
      for (int j = 0; j < 4; ++j) {
        Bytes16 bytes;
        std::memcpy(&bytes, picture.row(row + j) + column, sizeof(bytes));
        std::array<Float4, 4> colors;
        color_of_bytes<0>(bytes, colors[0]);
        color_of_bytes<1>(bytes, colors[1]);
        color_of_bytes<2>(bytes, colors[2]);
        color_of_bytes<3>(bytes, colors[3]);
        for (std::size_t k = 0; k < 4; ++k) sum += (at.weights_y[j][i] * at.weights_x[k][i]) * colors[k];
      }
      sum += 0.5F;
      sum = sum < 0.0F ? Float4{} : sum;
      sum = sum > 255.0F ? Float4{} + 255.0F : sum;
      const auto values = __builtin_convertvector(sum, base::Int4);
      for (std::size_t c = 0; c < 3; ++c) out[x + i][c] = static_cast<std::uint8_t>(values[c]);
    }
  }
  for (; x < width; ++x) out[x] = color_cubic(picture, apply_displacement(displacements, x, y));
}

}  // namespace

RollingShutter make_rolling_shutter(double readout_s, const MotionHistory& path) {
  RollingShutter out;
  if (readout_s == 0.0 || path.interval_s == 0.0) return out;
  out.T_previous_reference = path.T_previous_reference;
  out.motion_share = readout_s / path.interval_s;
  if (!(path.earlier_interval_s * path.interval_s > 0.0)) return out;
  // Mean velocities belong to the middles of their intervals; they are extrapolated linearly to the image's time.
  const double ahead = path.interval_s / (path.interval_s + path.earlier_interval_s);
  out.motion_share *= 1.0 + ahead;
  out.offset = -ahead * readout_s / path.earlier_interval_s * path.T_previous_earlier.log();
  return out;
}

RowRectifier::RowRectifier(const Lens& lens, int width, int height, const Vec6& twist,
                           const std::vector<DepthSample>& samples)
    : width_(width),
      height_(height),
      columns_((width + kCell_px - 1) / kCell_px),
      rows_((height + kCell_px - 1) / kCell_px),
      displacement_px_(static_cast<std::size_t>(columns_) * rows_) {
  const DepthGrid depth = bin_depths(columns_, rows_, samples);
  tbb::parallel_for(0, rows_, [&](int r) {
    for (int c = 0; c < columns_; ++c) {
      const Vector2f centre(static_cast<float>((c + 0.5) * kCell_px - 0.5),
                            static_cast<float>((r + 0.5) * kCell_px - 0.5));
      displacement_px_[depth.index(c, r)] = solve_displacement(lens, height, twist, centre, depth.rho(c, r));
    }
  });
}

template <class Row>
void RowRectifier::for_rows(const Row& row) const {
  constexpr int kRowsPerTask = 32;
  tbb::parallel_for(tbb::blocked_range<int>(0, height_, kRowsPerTask), [&](const tbb::blocked_range<int>& range) {
    std::vector<Vector2f> displacements;
    for (int y = range.begin(); y < range.end(); ++y) {
      interpolate_row(displacement_px_, columns_, rows_, y, displacements);
      row(y, displacements);
    }
  });
}

Vector2f RowRectifier::source_pixel(int x, int y) const {
  std::vector<Vector2f> row;
  interpolate_row(displacement_px_, columns_, rows_, y, row);
  return apply_displacement(row, x, y);
}

imaging::FloatImage RowRectifier::operator()(const PyramidLevel& picture, imaging::FloatImage memory) const {
  imaging::FloatImage out = make_image_in(std::move(memory), width_, height_);
  for_rows([&](int y, const std::vector<Vector2f>& row) { rectify_row(picture, row, y, out.row(y)); });
  return out;
}

imaging::RgbImage RowRectifier::operator()(const imaging::RgbImage& picture) const {
  imaging::RgbImage out(width_, height_);
  for_rows([&](int y, const std::vector<Vector2f>& row) { rectify_color_row(picture, row, y, out.row(y)); });
  return out;
}

std::vector<DepthSample> transform_depth_samples(const Lens& lens, const SE3& T_target_reference,
                                                 const std::array<std::vector<float>, 3>& rays,
                                                 const std::vector<float>& rho, std::size_t count) {
  const Eigen::Matrix3f R = T_target_reference.rotation.toRotationMatrix().cast<float>();
  const Vector3f t = T_target_reference.translation.cast<float>();
  std::vector<DepthSample> samples;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3f X = R * Vector3f(rays[0][i], rays[1][i], rays[2][i]) + rho[i] * t;
    Vector2f pixel;
    if (lens.project<float>(X, pixel)) samples.push_back({pixel, rho[i] / X.norm()});
  }
  return samples;
}

}  // namespace tileflight::keyframes
