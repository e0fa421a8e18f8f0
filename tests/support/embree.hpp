#pragma once
#if EMMETROPE_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

/// The two calls in which Embree 3 and 4 differ.
namespace emmetrope::test {

inline void nearest_hit(RTCScene scene, RTCRayHit& ray) {
#if EMMETROPE_EMBREE_MAJOR >= 4
  rtcIntersect1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &ray);
#endif
}

/// Whether anything lies on the ray; it has then tfar = -inf.
inline void find_any_hit(RTCScene scene, RTCRay& ray) {
#if EMMETROPE_EMBREE_MAJOR >= 4
  rtcOccluded1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
#endif
}

}  // namespace emmetrope::test
