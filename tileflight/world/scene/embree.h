#pragma once

// Embree 4 where it is installed, otherwise Embree 3. They differ in the ray queries only, which are wrapped here.
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace tileflight::scene {

#if RTC_VERSION_MAJOR >= 4
using NearestArguments = RTCIntersectArguments;
using AnyArguments = RTCOccludedArguments;
inline constexpr auto kCoherentRays = RTC_RAY_QUERY_FLAG_COHERENT;
inline constexpr auto kUnrelatedRays = RTC_RAY_QUERY_FLAG_INCOHERENT;
inline void set_defaults(RTCIntersectArguments& arguments) { rtcInitIntersectArguments(&arguments); }
inline void set_defaults(RTCOccludedArguments& arguments) { rtcInitOccludedArguments(&arguments); }
#else
using NearestArguments = RTCIntersectContext;
using AnyArguments = RTCIntersectContext;
inline constexpr auto kCoherentRays = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
inline constexpr auto kUnrelatedRays = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
inline void set_defaults(RTCIntersectContext& arguments) { rtcInitIntersectContext(&arguments); }
inline void rtcIntersect1(RTCScene scene, RTCRayHit* query, RTCIntersectContext* arguments) {
  ::rtcIntersect1(scene, arguments, query);
}
inline void rtcOccluded1(RTCScene scene, RTCRay* query, RTCIntersectContext* arguments) {
  ::rtcOccluded1(scene, arguments, query);
}
inline void rtcIntersect8(const int* valid, RTCScene scene, RTCRayHit8* query, RTCIntersectContext* arguments) {
  ::rtcIntersect8(valid, scene, arguments, query);
}
inline void rtcOccluded8(const int* valid, RTCScene scene, RTCRay8* query, RTCIntersectContext* arguments) {
  ::rtcOccluded8(valid, scene, arguments, query);
}
#endif

template <class Arguments, class Flags>
Arguments query_arguments(Flags flags) {
  Arguments arguments;
  set_defaults(arguments);
  arguments.flags = flags;
  return arguments;
}

/// Finds the nearest hit of a ray.
inline void find_nearest(RTCScene scene, RTCRayHit& query) {
  auto arguments = query_arguments<NearestArguments>(kUnrelatedRays);
  rtcIntersect1(scene, &query, &arguments);
}

/// Sets the ray's far limit to minus infinity if the ray meets anything.
inline void find_any(RTCScene scene, RTCRay& query) {
  auto arguments = query_arguments<AnyArguments>(kUnrelatedRays);
  rtcOccluded1(scene, &query, &arguments);
}

alignas(32) inline constexpr int kAllLanes[8] = {-1, -1, -1, -1, -1, -1, -1, -1};

/// Finds the nearest hits of eight similar rays; a negative far limit disables a ray.
inline void find_nearest(RTCScene scene, RTCRayHit8* query) {
  auto arguments = query_arguments<NearestArguments>(kCoherentRays);
  rtcIntersect8(kAllLanes, scene, query, &arguments);
}

/// Sets the far limits of those of eight similar rays to minus infinity that meet anything.
inline void find_any(RTCScene scene, RTCRay8* query) {
  auto arguments = query_arguments<AnyArguments>(kCoherentRays);
  rtcOccluded8(kAllLanes, scene, query, &arguments);
}

}  // namespace tileflight::scene
