#include "tileflight/slam/external_systems/lens_support.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <variant>

#include "tileflight/core/base/input_error.h"

namespace tileflight::external_systems {
namespace {

template <class... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <class... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;  // clang 14 needs it

template <class Numbers>
bool all_zero(const Numbers& numbers) {
  return std::ranges::all_of(numbers, [](double number) { return number == 0.0; });
}

}  // namespace

const std::vector<std::string>& lens_names() {
  static const std::vector<std::string> kNames{
      "pinhole", "pinhole-radtan", "pinhole-rational", "pinhole-equi", "fov", "double-sphere",
      "omni",    "eucm",           "equirectangular"};
  return kNames;
}

std::string lens_name(const imaging::Camera& camera) {
  return std::visit(
      Overloaded{
          [](const imaging::PinholeRadtan& m) { return all_zero(m.d) ? "pinhole" : "pinhole-radtan"; },
          [](const imaging::PinholeRational& m) { return all_zero(m.d) ? "pinhole" : "pinhole-rational"; },
          [](const imaging::KannalaBrandt&) { return "pinhole-equi"; },
          [](const imaging::FovModel&) { return "fov"; },
          [](const imaging::DoubleSphere&) { return "double-sphere"; },
          [](const imaging::UnifiedModel&) { return "omni"; },
          [](const imaging::ExtendedUnifiedModel&) { return "eucm"; },
          [](const imaging::Equirectangular&) { return "equirectangular"; },
      },
      camera.model());
}

imaging::Camera rectified_pinhole(const imaging::Camera& camera) {
  // Pixels per radian at the axis; for a pinhole of focal length f that is f.
  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  const auto center = camera.project(geometry::Vec3::UnitZ(), d_pixel_d_point);
  if (!center) throw InputError("camera", "does not see its optical axis, so its images cannot be rectified");
  return {imaging::PinholeRadtan{
              .fx = d_pixel_d_point(0, 0), .fy = d_pixel_d_point(1, 1), .cx = center->x(), .cy = center->y(), .d = {}},
          camera.width(), camera.height()};
}

double visible_share(const imaging::Camera& camera, const imaging::Camera& pinhole) {
  constexpr int kSteps = 100;
  int seen = 0, all = 0;
  for (int row = 0; row < kSteps; ++row) {
    for (int column = 0; column < kSteps; ++column) {
      const geometry::Vec2 pixel((column + 0.5) / kSteps * camera.width() - 0.5,
                                 (row + 0.5) / kSteps * camera.height() - 0.5);
      const auto ray = camera.unproject(pixel);
      if (!ray) continue;
      ++all;
      const auto inside = pinhole.project(*ray);
      seen += inside && pinhole.contains(*inside);
    }
  }
  return all > 0 ? static_cast<double>(seen) / all : 0.0;
}

}  // namespace tileflight::external_systems
