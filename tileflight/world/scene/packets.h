#pragma once

#include <cstdint>
#include <limits>

namespace tileflight::scene {

/// Eight rays and their hits, one per lane, for renderers: the caller fills the rays, Scene::intersect fills the hits.
/// Everything is relative to Scene::anchor(). Neighbouring rays should be in neighbouring lanes. The layout is that of
/// Embree's RTCRayHit8, with `nearness` after it, so that no copy is needed; `instance_primitive` is Embree 4's.
struct alignas(32) RayPacket8 {
  static constexpr int kLanes = 8;
  static constexpr std::uint32_t kMiss = 0xFFFFFFFFU;
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();

  // In: rays. Directions need not have unit length; distances are in multiples of the direction's length.
  float origin_x[8], origin_y[8], origin_z[8];
  float near[8];  ///< smallest distance of a hit
  float direction_x[8], direction_y[8], direction_z[8];
  float time[8];  ///< of the scene, 0 to 1, for placed parts that move (scene_part.h)
  /// In: the largest distance of a hit (negative: the lane is disabled). Out: the distance of the hit, if any.
  float far[8];
  std::uint32_t mask[8], id[8], flags[8];  ///< set by reset()

  // Out: hits; zeros if there is none.
  float normal_x[8], normal_y[8], normal_z[8];  ///< oriented by the triangle's winding, not unit length
  float u[8], v[8];                             ///< barycentric weights of corners 1 and 2
  std::uint32_t triangle[8];
  std::uint32_t mesh[8];  ///< kMiss: no hit
  std::uint32_t instance[8], instance_primitive[8];
  /// Larger for a nearer hit of the same ray, also one in another scene with the same anchor; of equal ones, that of
  /// the lower mesh counts as the nearer. Set for hits only; finer than `far`, which is rounded from it.
  float nearness[8];

  /// Resets all members except origin and direction, as required before each query: all lanes enabled, no far limit.
  void reset() {
    // One array after the other: vector stores, where a common loop becomes a `rep stos`, which takes longer.
    fill(near, 0.0F);
    fill(time, 0.0F);
    fill(far, kInfinity);
    fill(mask, kMiss);
    fill(id, 0U);
    fill(flags, 0U);
    fill(normal_x, 0.0F);
    fill(normal_y, 0.0F);
    fill(normal_z, 0.0F);
    fill(u, 0.0F);
    fill(v, 0.0F);
    fill(triangle, 0U);
    fill(mesh, kMiss);
    fill(instance, kMiss);
    fill(instance_primitive, kMiss);
    fill(nearness, 0.0F);
  }
  /// Disables lane `i` for the next query; it will report a miss.
  void disable_lane(int i) { far[i] = -kInfinity; }

 private:
  template <class Number>
  static void fill(Number (&numbers)[kLanes], Number with) {
    for (Number& number : numbers) number = with;
  }
};

}  // namespace tileflight::scene
