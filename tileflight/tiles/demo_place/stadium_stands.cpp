#include <cmath>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/materials.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

// Dimensions of one row, from its front edge: walkway, seat, back rest.
constexpr double kWalkway_m = 0.45, kSeat_m = 0.35, kBack_m = 0.05, kBackHeight_m = 0.33;
constexpr double kWall_m = 0.25, kWallHeight_m = 0.9, kBackWallHeight_m = 1.1;
constexpr double kAisle_m = 1.2, kSeatWidth_m = 0.52;
constexpr int kSections = 10;

/// Axes of a stand: `out` away from the field and up the rows, `along` such that along x up points to the field.
struct StandFrame {
  Vec3 start, along, out;
  double length_m = 0.0, depth_m = 0.0;
};

StandFrame frame_of(const Grandstand& stand) {
  const Rect& f = stand.footprint;
  const bool west = stand.toward_field > 0;
  return {{west ? f.x1 : f.x0, west ? f.y0 : f.y1, 0.0},
          {0.0, stand.toward_field, 0.0},
          {-stand.toward_field, 0.0, 0.0},
          f.y1 - f.y0,
          f.x1 - f.x0};
}

/// Profile points (out, up) of the rows: with back rests of `back_height_m`, or (seats false) bare steps.
std::vector<Vec2> row_profile(const Grandstand& stand, bool seats, double back_height_m) {
  std::vector<Vec2> profile;
  for (int row = 0; row < stand.rows; ++row) {
    const double out = kWall_m + row * Grandstand::kRowDepth_m,
                 up = stand.front_height_m + row * Grandstand::kRowRise_m;
    const double step = up + Grandstand::kRowRise_m, back = out + kWalkway_m + kSeat_m;
    profile.insert(profile.end(), {{out, up}, {out + kWalkway_m, up}, {out + kWalkway_m, step}});
    if (seats)
      profile.insert(profile.end(),
                     {{back, step}, {back, step + back_height_m}, {back + kBack_m, step + back_height_m}});
  }
  profile.emplace_back(kWall_m + stand.rows * Grandstand::kRowDepth_m, stand.top_m());
  return profile;
}

/// Unrolled length of a row's strips: walkway, riser, seat, back rest's front, top and rear.
constexpr double kRowLength_m = kWalkway_m + Grandstand::kRowRise_m + kSeat_m + 2 * kBackHeight_m + kBack_m;

Color person_color(float choice) {
  if (choice < 0.25F) return {0.86F, 0.84F, 0.80F};
  if (choice < 0.45F) return {0.12F, 0.34F, 0.22F};
  if (choice < 0.6F) return {0.70F, 0.15F, 0.13F};
  if (choice < 0.75F) return {0.16F, 0.22F, 0.45F};
  if (choice < 0.88F) return {0.85F, 0.68F, 0.22F};
  return {0.22F, 0.20F, 0.20F};
}

/// Seat colours of a section: green, partly gold by pattern, individually bleached, some occupied.
Color seat_color(double s_m, double row, int section, bool on_back, std::uint32_t seed) {
  const double seat = s_m / kSeatWidth_m;
  const float one = base::cell_random(seat, row, seed);
  const bool gold = std::fabs(row - 14.5) < 3.0 && (section % 3) == 1;
  Color color = gold ? Color(0.74F, 0.60F, 0.26F) : Color(0.10F, 0.35F, 0.24F);
  color *= 0.75F + 0.55F * base::cell_random(seat, row, seed + 1);
  const float crowd = 0.16F + 0.22F * base::value_noise(s_m / 5.0, row / 5.0, seed + 2);
  if (one < crowd)
    color = person_color(base::cell_random(seat, row, seed + 3)) *
            (0.7F + 0.5F * base::cell_random(9 * seat, 7 * row, seed + 4));
  const float gap = band_coverage(s_m, kSeatWidth_m, on_back ? 0.09 : 0.07);
  return mix_colors(color, {0.24F, 0.24F, 0.24F}, 0.8F * gap);
}

Color row_color(const Texel& texel, int section, std::uint32_t seed) {
  const double row = std::floor(texel.t_m / kRowLength_m);
  const double t = texel.t_m - row * kRowLength_m;
  const double along = texel.s_m + 30.0 * section;
  if (t < kWalkway_m + Grandstand::kRowRise_m) {
    const Color concrete = material::concrete(along, texel.t_m, 4.0, seed + 5);
    const float litter = base::cell_random(along / 0.2, texel.t_m / 0.2, seed + 6);
    const float dirt = t > kWalkway_m ? 0.66F : 0.92F;
    return litter > 0.985F ? Color(0.85F, 0.83F, 0.78F) : Color(concrete * dirt);
  }
  const bool on_back = t > kWalkway_m + Grandstand::kRowRise_m + kSeat_m;
  const bool on_rear = t > kRowLength_m - kBackHeight_m;
  const Color color = seat_color(along, row, section, on_back, seed);
  return on_rear ? Color(0.7F * color) : color;
}

Color aisle_color(const Texel& texel, int section, std::uint32_t seed) {
  constexpr double kLength_m = Grandstand::kRowDepth_m + Grandstand::kRowRise_m;
  const double t = std::fmod(texel.t_m, kLength_m);
  Color color = material::concrete(texel.s_m + 17.0 * section, texel.t_m, 3.0, seed + 7);
  if (std::fabs(t - kWalkway_m - Grandstand::kRowRise_m) < 0.08) color = {0.83F, 0.70F, 0.22F};
  return t > kWalkway_m && t < kWalkway_m + Grandstand::kRowRise_m ? Color(0.72F * color) : color;
}

/// One block of seats between aisles. The back rests taper to zero at both ends, so that the surface is closed there.
Chart make_section(const Grandstand& stand, const StandFrame& frame, double from_m, double to_m, int section,
                   std::uint32_t seed) {
  const auto paint = [section, seed](const Texel& texel) { return row_color(texel, section, seed); };
  const double length_m = to_m - from_m;
  const Vec3 start = frame.start + from_m * frame.along;
  Chart chart = make_sweep(start, length_m * frame.along, frame.out, row_profile(stand, true, kBackHeight_m), paint,
                           length_m / 6);
  const std::vector<Vec2> ends = row_profile(stand, true, 0.0);
  chart.s_m[1] = 0.12;
  chart.s_m[5] = length_m - 0.12;
  for (std::size_t row = 0; row < chart.rows(); ++row) {
    Vec3* vertex = &chart.vertices[row * chart.columns()];
    vertex[1] = vertex[0] + chart.s_m[1] * frame.along;
    vertex[5] = vertex[0] + chart.s_m[5] * frame.along;
    vertex[0].z() = vertex[6].z() = ends[row].y();
  }
  return chart;
}

void add_rows(const Grandstand& stand, const StandFrame& frame, std::uint32_t seed, std::vector<Chart>& charts) {
  const double pitch_m = (frame.length_m - kAisle_m) / kSections;
  for (int section = 0; section <= kSections; ++section) {
    const double aisle_m = section * pitch_m;
    const auto paint = [section, seed](const Texel& texel) { return aisle_color(texel, section, seed); };
    charts.push_back(make_sweep(frame.start + aisle_m * frame.along, kAisle_m * frame.along, frame.out,
                                row_profile(stand, false, 0.0), paint, kAisle_m));
    if (section < kSections)
      charts.push_back(make_section(stand, frame, aisle_m + kAisle_m, aisle_m + pitch_m, section, seed));
  }
}

/// The wall between field and stand: padded panels, some with the site's name.
Color field_wall_color(const Texel& texel, std::uint32_t seed) {
  const double panel = std::floor(texel.s_m / 2.5);
  const float one = base::cell_random(panel, 1.0, seed);
  Color color = one < 0.5F    ? Color(0.09F, 0.28F, 0.19F)
                : one < 0.75F ? Color(0.15F, 0.17F, 0.18F)
                              : Color(0.85F, 0.83F, 0.77F);
  color *= 0.9F + 0.25F * base::fractal_noise(texel.s_m / 0.8, texel.t_m / 0.8, seed + 1, 4, 0.6F);
  if (texel.t_m > 2.5) return material::concrete(texel.s_m, texel.t_m, 2.5, seed);
  const double s = std::fmod(texel.s_m, 20.0);
  const bool ink = is_ink("TILEFLIGHT", (s - 3.0) / 0.2, (texel.t_m - 0.6) / 0.2);
  if (ink) color = one < 0.75F ? Color(0.93F, 0.92F, 0.88F) : Color(0.10F, 0.28F, 0.20F);
  return color * (1.0F - 0.5F * band_coverage(texel.s_m, 2.5, 0.07));
}

/// Field wall, and at the top the walkway with the wall behind it, in pieces small enough for single tiles.
void add_long_walls(const Grandstand& stand, const StandFrame& frame, const Terrain& terrain, std::uint32_t seed,
                    std::vector<Chart>& charts) {
  const double front = stand.front_height_m, top = stand.top_m(), last = kWall_m + stand.rows * Grandstand::kRowDepth_m;
  const std::vector<Vec2> field_wall{
      {0, -0.3}, {0, front + kWallHeight_m}, {kWall_m, front + kWallHeight_m}, {kWall_m, front}};
  const double depth = frame.depth_m;
  const int pieces = 5;
  const double length_m = frame.length_m / pieces;
  for (int i = 0; i < pieces; ++i) {
    const Vec3 start = frame.start + i * length_m * frame.along;
    const Vec3 back = start + depth * frame.out;
    const double ground = std::min(terrain.height_m(back.x(), back.y()),
                                   terrain.height_m(back.x(), back.y() + length_m * frame.along.y())) -
                          0.5;
    const std::vector<Vec2> walkway{{last, top},
                                    {depth - kWall_m, top},
                                    {depth - kWall_m, top + kBackWallHeight_m},
                                    {depth, top + kBackWallHeight_m},
                                    {depth, ground}};
    const double from_m = i * length_m;
    charts.push_back(make_sweep(
        start, length_m * frame.along, frame.out, field_wall,
        [seed, from_m](Texel texel) {
          texel.s_m += from_m;
          return field_wall_color(texel, seed + 11);
        },
        2.75));
    charts.push_back(make_sweep(
        start, length_m * frame.along, frame.out, walkway,
        [seed, from_m](const Texel& texel) {
          return material::concrete(texel.s_m + from_m, texel.t_m, 2.0, seed + 12);
        },
        2.75));
  }
}

/// Sloping wall at one end, from the ground outside over its top to slightly below the rows inside.
Chart make_end_wall(const Grandstand& stand, const StandFrame& frame, const Terrain& terrain, bool far_end,
                    std::uint32_t seed) {
  Chart chart;
  const Vec3 outer = frame.start + (far_end ? frame.length_m : 0.0) * frame.along;
  const Vec3 inner = outer + (far_end ? -kWall_m : kWall_m) * frame.along;
  constexpr int kCells = 18;
  chart.s_m = even_positions(1.15 * frame.depth_m, kCells);
  chart.t_m = {0.0, 2.6, 2.6 + kWall_m, 2.6 + kWall_m + 1.4};
  chart.vertices.resize(4 * (kCells + 1));
  for (int i = 0; i <= kCells; ++i) {
    const double out = frame.depth_m * (far_end ? kCells - i : i) / kCells;  // s runs so that the outside is in front
    const double rows_out = std::clamp(out - kWall_m, 0.0, stand.rows * Grandstand::kRowDepth_m);
    const double slope = stand.front_height_m + rows_out * Grandstand::kRowRise_m / Grandstand::kRowDepth_m;
    const Vec3 foot = outer + out * frame.out, inside = inner + out * frame.out;
    const Vec3 up(0, 0, slope + kWallHeight_m);
    Vec3* column = &chart.vertices[static_cast<std::size_t>(i)];
    const std::size_t row = kCells + 1;
    column[0] = foot + Vec3(0, 0, std::min(terrain.height_m(foot.x(), foot.y()) - 0.5, slope));
    column[row] = foot + up;
    column[2 * row] = inside + up;
    column[3 * row] = inside + Vec3(0, 0, slope - 0.5);
  }
  chart.paint = [seed](const Texel& texel) { return material::concrete(texel.s_m, texel.t_m, 2.4, seed + 13); };
  return chart;
}

}  // namespace

std::vector<Chart> make_stands(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts;
  std::uint32_t seed = plan.seed ^ 0x57a2dU;
  for (const Grandstand& stand : plan.stands) {
    seed = base::murmur3_mix(seed + 1);
    const StandFrame frame = frame_of(stand);
    add_rows(stand, frame, seed, charts);
    add_long_walls(stand, frame, terrain, seed, charts);
    charts.push_back(make_end_wall(stand, frame, terrain, false, seed));
    charts.push_back(make_end_wall(stand, frame, terrain, true, seed));
  }
  return charts;
}

}  // namespace tileflight::demo_place
