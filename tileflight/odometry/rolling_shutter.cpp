#include "tileflight/odometry/rolling_shutter.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tileflight::odometry {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;
using geometry::SE3;
using geometry::Vec6;

constexpr int kCell_px = 16;

/// Sums of inverse distances by cell.
struct CellDepth {
  int columns = 0;
  int rows = 0;
  std::vector<float> weighted_rho;
  std::vector<float> weight;

  CellDepth(int c, int r) : columns(c), rows(r), weighted_rho(static_cast<std::size_t>(c) * r), weight(weighted_rho) {}
  std::size_t index(int c, int r) const { return static_cast<std::size_t>(r) * columns + c; }
  float rho(int c, int r) const { return weighted_rho[index(c, r)] / weight[index(c, r)]; }
};

CellDepth halved(const CellDepth& fine) {
  CellDepth half((fine.columns + 1) / 2, (fine.rows + 1) / 2);
  for (int r = 0; r < fine.rows; ++r) {
    for (int c = 0; c < fine.columns; ++c) {
      half.weighted_rho[half.index(c / 2, r / 2)] += fine.weighted_rho[fine.index(c, r)];
      half.weight[half.index(c / 2, r / 2)] += fine.weight[fine.index(c, r)];
    }
  }
  return half;
}

/// Empty cells take the mean of the smallest block of cells that has one (Gortler et al. 1996, push and pull).
CellDepth filled(CellDepth depth) {
  const bool full = std::all_of(depth.weight.begin(), depth.weight.end(), [](float w) { return w > 0; });
  if (full) return depth;
  if (depth.columns == 1 && depth.rows == 1) {
    depth.weight[0] = 1.0F;  // nothing is known at all: far away
    return depth;
  }
  const CellDepth coarse = filled(halved(depth));
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

CellDepth cell_depths(int columns, int rows, const std::vector<DepthSample>& samples) {
  CellDepth depth(columns, rows);
  for (const DepthSample& sample : samples) {
    const int c = static_cast<int>(std::floor((sample.pixel.x() + 0.5F) / kCell_px));
    const int r = static_cast<int>(std::floor((sample.pixel.y() + 0.5F) / kCell_px));
    if (c < 0 || r < 0 || c >= columns || r >= rows) continue;
    depth.weighted_rho[depth.index(c, r)] += sample.rho;
    depth.weight[depth.index(c, r)] += 1.0F;
  }
  return filled(std::move(depth));
}

/// Where the rows' cameras have a pixel of the middle row's one.
Vector2f displacement(const Lens& lens, int height, const Vec6& twist, const Vector2f& pixel, float rho) {
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

/// Weights of four neighbours at `t` between the second and the third.
std::array<float, 4> cubic_weights(float t) {
  const float t2 = t * t, t3 = t2 * t;
  return {0.5F * (-t + 2 * t2 - t3), 0.5F * (2 - 5 * t2 + 3 * t3), 0.5F * (t + 4 * t2 - 3 * t3), 0.5F * (t3 - t2)};
}

using Four = float __attribute__((vector_size(16)));

/// The four pixels from (x, y) to the right; the edge goes on outside.
template <class Pixel>
Four four_pixels(int width, int height, int x, int y, const Pixel& pixel) {
  const int row = std::clamp(y, 0, height - 1);
  if (x >= 0 && x + 3 < width) return Four{pixel(x, row), pixel(x + 1, row), pixel(x + 2, row), pixel(x + 3, row)};
  Four out{};
  for (int i = 0; i < 4; ++i) out[i] = pixel(std::clamp(x + i, 0, width - 1), row);
  return out;
}

/// `pixel(x, y)` interpolated.
template <class Pixel>
float sample_cubic(int width, int height, const Vector2f& at, const Pixel& pixel) {
  const float x = std::clamp(at.x(), 0.0F, static_cast<float>(width - 1));
  const float y = std::clamp(at.y(), 0.0F, static_cast<float>(height - 1));
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const std::array<float, 4> across = cubic_weights(x - static_cast<float>(ix));
  const std::array<float, 4> down = cubic_weights(y - static_cast<float>(iy));
  Four sum{};
  for (int j = 0; j < 4; ++j) sum += down[j] * four_pixels(width, height, ix - 1, iy - 1 + j, pixel);
  return (across[0] * sum[0] + across[1] * sum[1]) + (across[2] * sum[2] + across[3] * sum[3]);
}

/// The same for the three colours at once.
imaging::Rgb8 color_cubic(const imaging::RgbImage& picture, const Vector2f& at) {
  const float x = std::clamp(at.x(), 0.0F, static_cast<float>(picture.width - 1));
  const float y = std::clamp(at.y(), 0.0F, static_cast<float>(picture.height - 1));
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const std::array<float, 4> across = cubic_weights(x - static_cast<float>(ix));
  const std::array<float, 4> down = cubic_weights(y - static_cast<float>(iy));
  Four sum{};
  for (int j = 0; j < 4; ++j) {
    const imaging::Rgb8* row = picture.row(std::clamp(iy - 1 + j, 0, picture.height - 1));
    for (int i = 0; i < 4; ++i) {
      const imaging::Rgb8& from = row[std::clamp(ix - 1 + i, 0, picture.width - 1)];
      const Four color{static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(from[2]), 0.0F};
      sum += (down[j] * across[i]) * color;
    }
  }
  imaging::Rgb8 out;
  for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(std::clamp(sum[c] + 0.5F, 0.0F, 255.0F));
  return out;
}

/// Displacements between the centres of cells: the left or upper one of two, and the share of the other.
struct BetweenCells {
  int cell = 0;
  float share = 0.0F;
};
BetweenCells between_cells(int pixel, int cells) {
  const float at =
      std::clamp((static_cast<float>(pixel) + 0.5F) / kCell_px - 0.5F, 0.0F, static_cast<float>(cells - 1));
  const int cell = std::min(static_cast<int>(at), std::max(0, cells - 2));
  return {cell, at - static_cast<float>(cell)};
}

/// A row's displacements at the columns of cells.
std::vector<Vector2f> row_displacements(const std::vector<Vector2f>& cells, int columns, int rows, int y) {
  const BetweenCells at = between_cells(y, rows);
  const Vector2f* top = cells.data() + static_cast<std::size_t>(at.cell) * columns;
  const Vector2f* bottom = rows > 1 ? top + columns : top;
  std::vector<Vector2f> out(columns);
  for (int c = 0; c < columns; ++c) out[c] = top[c] + at.share * (bottom[c] - top[c]);
  return out;
}

Vector2f displaced(const std::vector<Vector2f>& row, int x, int y) {
  const int columns = static_cast<int>(row.size());
  const BetweenCells at = between_cells(x, columns);
  const Vector2f &left = row[at.cell], &right = row[std::min(at.cell + 1, columns - 1)];
  return Vector2f(x, y) + left + at.share * (right - left);
}

}  // namespace

RollingShutter rolling_shutter(double readout_s, const PathBefore& path) {
  RollingShutter out;
  if (readout_s == 0.0 || path.interval_s == 0.0) return out;
  out.T_previous_reference = path.T_previous_reference;
  out.share = readout_s / path.interval_s;
  if (!(path.earlier_s * path.interval_s > 0.0)) return out;
  // Mean velocities belong to the middles of their intervals; the line through both, at the picture's time.
  const double ahead = path.interval_s / (path.interval_s + path.earlier_s);
  out.share *= 1.0 + ahead;
  out.offset = -ahead * readout_s / path.earlier_s * path.T_previous_earlier.log();
  return out;
}

RowRectifier::RowRectifier(const Lens& lens, int width, int height, const Vec6& twist,
                           const std::vector<DepthSample>& samples)
    : width_(width),
      height_(height),
      columns_((width + kCell_px - 1) / kCell_px),
      rows_((height + kCell_px - 1) / kCell_px),
      displacement_px_(static_cast<std::size_t>(columns_) * rows_) {
  const CellDepth depth = cell_depths(columns_, rows_, samples);
  tbb::parallel_for(0, rows_, [&](int r) {
    for (int c = 0; c < columns_; ++c) {
      const Vector2f centre(static_cast<float>((c + 0.5) * kCell_px - 0.5),
                            static_cast<float>((r + 0.5) * kCell_px - 0.5));
      displacement_px_[depth.index(c, r)] = displacement(lens, height, twist, centre, depth.rho(c, r));
    }
  });
}

Vector2f RowRectifier::source(int x, int y) const {
  return displaced(row_displacements(displacement_px_, columns_, rows_, y), x, y);
}

imaging::FloatImage RowRectifier::operator()(const PyramidLevel& picture) const {
  imaging::FloatImage out(width_, height_);
  const auto grey = [&](int x, int y) { return picture.row(y)[x]; };
  tbb::parallel_for(0, height_, [&](int y) {
    const std::vector<Vector2f> row = row_displacements(displacement_px_, columns_, rows_, y);
    for (int x = 0; x < width_; ++x)
      out(x, y) = std::max(sample_cubic(width_, height_, displaced(row, x, y), grey), 0.0F);
  });
  return out;
}

imaging::RgbImage RowRectifier::operator()(const imaging::RgbImage& picture) const {
  imaging::RgbImage out(width_, height_);
  tbb::parallel_for(0, height_, [&](int y) {
    const std::vector<Vector2f> row = row_displacements(displacement_px_, columns_, rows_, y);
    for (int x = 0; x < width_; ++x) out(x, y) = color_cubic(picture, displaced(row, x, y));
  });
  return out;
}

std::vector<DepthSample> seen_from(const Lens& lens, const SE3& T_target_reference,
                                   const std::array<std::vector<float>, 3>& rays, const std::vector<float>& rho,
                                   std::size_t count) {
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

}  // namespace tileflight::odometry
