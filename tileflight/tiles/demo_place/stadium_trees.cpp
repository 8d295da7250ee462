#include <cmath>
#include <numbers>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

/// Radius of a crown's outline at relative height h (0 bottom, 1 top), as a fraction of the crown's radius.
double outline(TreeKind kind, double h) {
  if (kind == TreeKind::kConifer) return (1.02 - h) * (0.82 + 0.18 * std::sin(19.0 * h));
  return std::sqrt(std::max(0.0, 1.0 - (2 * h - 1) * (2 * h - 1)));
}

struct CrownShape {
  double bottom_m = 0.0, top_m = 0.0;  ///< above the foot
  int around = 20, rows = 12;
};

/// Whether the tree is near the flight area, which is seen closely.
bool is_near(const Tree& tree) { return tree.position.norm() < 135.0; }

CrownShape crown_shape(const Tree& tree) {
  if (tree.kind == TreeKind::kBush) return {-0.2, tree.height_m, 12, 7};
  if (tree.kind == TreeKind::kConifer) return {0.12 * tree.height_m, tree.height_m, 14, is_near(tree) ? 16 : 10};
  return {0.26 * tree.height_m, tree.height_m, is_near(tree) ? 20 : 14, is_near(tree) ? 13 : 9};
}

/// Bumps of the crown: factor on the radius.
double boughs(const Vec3& direction, const Tree& tree) {
  const Vec3 p = 1.9 * direction;
  return 1.0 + 0.36 * base::fractal_noise_3d(p.x(), p.y(), p.z(), tree.seed, 3, 0.6F);
}

Vec3 crown_point(const Tree& tree, const CrownShape& shape, double h, double angle_rad) {
  const double radius = tree.radius_m * outline(tree.kind, h);
  const Vec3 round(std::cos(angle_rad) * radius, std::sin(angle_rad) * radius, 0);
  const double middle_m = 0.5 * (shape.bottom_m + shape.top_m), half_m = 0.5 * (shape.top_m - shape.bottom_m);
  const Vec3 direction =
      round / tree.radius_m + Vec3(0, 0, (2 * h - 1) * (tree.kind == TreeKind::kConifer ? 2.5 : 1.0));
  const double factor = boughs(direction, tree);
  return factor * round + Vec3(0, 0, middle_m + (2 * h - 1) * half_m * (0.5 + 0.5 * factor));
}

/// Normals of a grid that is closed around the trunk.
std::vector<Vec3> crown_normals(const std::vector<Vec3>& vertices, int around, int rows, const Vec3& middle) {
  const auto at = [&](int row, int i) -> const Vec3& {
    return vertices[static_cast<std::size_t>(std::clamp(row, 0, rows) * (around + 1) + (i + around) % around)];
  };
  std::vector<Vec3> normals;
  for (int row = 0; row <= rows; ++row) {
    for (int i = 0; i <= around; ++i) {
      const Vec3 across = at(row, i + 1) - at(row, i - 1), up = at(row + 1, i) - at(row - 1, i);
      const Vec3 normal = across.cross(up), out = (at(row, i) - middle).normalized();
      normals.push_back(normal.squaredNorm() > 1e-12 ? (normal.normalized() + 0.4 * out).normalized() : out);
    }
  }
  return normals;
}

Color leaf_color(const Tree& tree) {
  base::HashRandom random(tree.seed ^ 0x1eafU);
  const float brightness = static_cast<float>(random.uniform(0.8, 1.2));
  const double hue = random.uniform();
  if (tree.kind == TreeKind::kConifer) return Color(0.22F, 0.31F, 0.19F) * brightness;
  if (hue < 0.12) return Color(0.52F, 0.38F, 0.17F) * brightness;  // early autumn
  if (hue < 0.20) return Color(0.46F, 0.24F, 0.18F) * brightness;
  if (hue < 0.60) return Color(0.30F, 0.40F, 0.17F) * brightness;
  return Color(0.38F, 0.45F, 0.20F) * brightness;
}

Chart make_crown(const Tree& tree, const Vec3& foot) {
  Chart chart;
  const CrownShape shape = crown_shape(tree);
  const double girth_m = 2 * std::numbers::pi * tree.radius_m, rise_m = shape.top_m - shape.bottom_m;
  chart.s_m = even_positions(girth_m, static_cast<std::size_t>(shape.around));
  chart.t_m = even_positions(1.3 * rise_m, static_cast<std::size_t>(shape.rows));
  for (int row = 0; row <= shape.rows; ++row) {
    const double share = static_cast<double>(row) / shape.rows;
    const double h = tree.kind == TreeKind::kConifer ? share : 0.5 - 0.5 * std::cos(std::numbers::pi * share);
    for (int i = 0; i <= shape.around; ++i) {
      const double angle_rad = 2 * std::numbers::pi * (i % shape.around) / shape.around;
      const bool pole = row == 0 || row == shape.rows;
      const Vec3 axis(0, 0, row == 0 ? shape.bottom_m : shape.top_m);
      chart.vertices.push_back(foot + (pole ? axis : crown_point(tree, shape, h, angle_rad)));
    }
  }
  const Vec3 middle = foot + Vec3(0, 0, 0.5 * (shape.bottom_m + shape.top_m));
  chart.normals = crown_normals(chart.vertices, shape.around, shape.rows, middle);
  chart.texel_m = is_near(tree) ? 0.09 : 0.14;
  chart.paint = [base = leaf_color(tree), seed = tree.seed, middle](const Texel& texel) {
    const Vec3 p = texel.position - middle;
    return material::foliage(p.x(), p.y(), p.z(), base, seed);
  };
  return chart;
}

}  // namespace

void add_tree(const Tree& tree, const Vec3& foot, std::vector<Chart>& charts) {
  charts.push_back(make_crown(tree, foot));
  if (tree.kind == TreeKind::kBush) return;
  const double trunk_m = crown_shape(tree).bottom_m + 0.12 * tree.height_m;
  const auto paint = [seed = tree.seed](const Texel& texel) { return material::bark(texel.s_m, texel.t_m, seed); };
  charts.push_back(make_post(foot - Vec3(0, 0, 0.3), trunk_m + 0.3, 0.035 * tree.height_m, 7, paint));
}

std::vector<Chart> make_trees(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts;
  for (const Tree& tree : plan.trees) add_tree(tree, terrain.point(tree.position.x(), tree.position.y()), charts);
  return charts;
}

}  // namespace tileflight::demo_place
