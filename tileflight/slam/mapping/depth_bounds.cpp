#include "tileflight/slam/mapping/depth_bounds.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace tileflight::mapping {

void bound_by_neighbours(const std::vector<tracking::ReferencePoint>& known,
                         std::vector<keyframes::ImmaturePoint>& points) {
  constexpr std::size_t kNearest = 8;
  constexpr float kMargin = 1.35F;  // factor on either side; both chosen by hand
  if (known.size() < kNearest) return;
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    std::vector<std::pair<float, float>> around;  // squared distance in pixels, inverse distance
    around.reserve(known.size());
    for (const tracking::ReferencePoint& one : known)
      around.emplace_back((one.pixel - points[i].patch.pixel).squaredNorm(), one.rho);
    std::partial_sort(around.begin(), around.begin() + kNearest, around.end());
    const auto [least, most] = std::minmax_element(around.begin(), around.begin() + kNearest,
                                                   [](const auto& a, const auto& b) { return a.second < b.second; });
    points[i].rho_min = least->second / kMargin;
    points[i].rho_max = most->second * kMargin;
  });
}

}  // namespace tileflight::mapping
