#include "tileflight/slam/keyframes/patch.h"

namespace tileflight::keyframes {
namespace {

/// Computes ray and derivative from the pixel; returns false, leaving the patch unchanged, outside the lens's valid
/// region.
bool compute_ray(const Lens& lens, Patch& patch) {
  const auto ray = lens.unproject(patch.pixel.cast<double>());
  if (!ray) return false;
  Eigen::Matrix<double, 2, 3> J;
  geometry::Vec2 back;
  if (!lens.project<double>(*ray, back, J)) return false;
  patch.ray = ray->cast<float>();
  // J's null space is the ray, so its pseudo-inverse maps to the tangent plane of the sphere.
  patch.d_ray_d_pixel = (J.transpose() * (J * J.transpose()).inverse()).cast<float>();
  return true;
}

}  // namespace

std::optional<Patch> make_patch(const PyramidLevel& level, const Lens& lens, const Eigen::Vector2f& pixel,
                                float gradient_weight) {
  if (!level.inside(pixel.x(), pixel.y(), kPatternRadius_px + 1.0F)) return std::nullopt;
  Patch patch;
  patch.pixel = pixel;
  if (!compute_ray(lens, patch)) return std::nullopt;
  patch.ray_linear = patch.ray;
  patch.structure.setZero();
  const float c2 = gradient_weight * gradient_weight;
  for (int k = 0; k < kPatternSize; ++k) {
    const Texel texel = level.sample(pixel.x() + kPattern[k][0], pixel.y() + kPattern[k][1]);
    const Eigen::Vector2f gradient(texel[kGradX], texel[kGradY]);
    patch.intensity[k] = texel[kIntensity];
    patch.weight[k] = c2 / (c2 + gradient.squaredNorm());
    patch.structure += gradient * gradient.transpose();
  }
  return patch;
}

void update_ray(const Lens& lens, Patch& patch) { compute_ray(lens, patch); }

}  // namespace tileflight::keyframes
