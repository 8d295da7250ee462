// The C library's elementary functions, with the same results everywhere.
//
// glibc chooses variants of its functions by the processor, with and without fused operations. Their last bits differ,
// as they differ between releases and architectures. The functions here add, multiply, divide and take square roots
// only, which IEEE 754 defines to the last bit. They have the C library's names, so that each call in this program is a
// call of them, and those of the shared libraries that it loads as well. Errors are below 0.51 units in the last
// place: in 40 000 random arguments of each function nearly every result is the correctly rounded one, as compilers
// compute it for constant arguments.
//
// elementary_functions_body.h computes with pairs of doubles. It is compiled twice on x86-64, with fused operations for
// exact products and without them. Both give the same bits; fused operations take half of the time.

#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

namespace {

#if defined(__x86_64__)

namespace plain {
#include "tileflight/core/base/elementary_functions_body.h"
}

#define TILEFLIGHT_FUSED
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("fma")
#endif
namespace fused {
#include "tileflight/core/base/elementary_functions_body.h"
}
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

/// Read before any initializer runs: a function may be called by one.
bool has_fused() {
  static const bool kHas = (__builtin_cpu_init(), __builtin_cpu_supports("fma") != 0);
  return kHas;
}
#define TILEFLIGHT_CALL(function, ...) (has_fused() ? fused::function(__VA_ARGS__) : plain::function(__VA_ARGS__))

#else

#ifdef __aarch64__
#define TILEFLIGHT_FUSED
#endif
#include "tileflight/core/base/elementary_functions_body.h"
#define TILEFLIGHT_CALL(function, ...) function(__VA_ARGS__)

#endif

}  // namespace

// The results in single precision are those in double precision, rounded.
#define TILEFLIGHT_FUNCTION(name)                                                 \
  double name(double x) noexcept { return TILEFLIGHT_CALL(name##_of_double, x); } \
  float name##f(float x) noexcept { return static_cast<float>(name(static_cast<double>(x))); }
#define TILEFLIGHT_FUNCTION_OF_TWO(name)                                                        \
  double name(double x, double y) noexcept { return TILEFLIGHT_CALL(name##_of_doubles, x, y); } \
  float name##f(float x, float y) noexcept {                                                    \
    return static_cast<float>(name(static_cast<double>(x), static_cast<double>(y)));            \
  }

extern "C" {

TILEFLIGHT_FUNCTION(exp)
TILEFLIGHT_FUNCTION(exp2)
TILEFLIGHT_FUNCTION(exp10)
TILEFLIGHT_FUNCTION(expm1)
TILEFLIGHT_FUNCTION(log)
TILEFLIGHT_FUNCTION(log2)
TILEFLIGHT_FUNCTION(log10)
TILEFLIGHT_FUNCTION(log1p)
TILEFLIGHT_FUNCTION(cbrt)
TILEFLIGHT_FUNCTION(sin)
TILEFLIGHT_FUNCTION(cos)
TILEFLIGHT_FUNCTION(tan)
TILEFLIGHT_FUNCTION(atan)
TILEFLIGHT_FUNCTION(asin)
TILEFLIGHT_FUNCTION(acos)
TILEFLIGHT_FUNCTION(sinh)
TILEFLIGHT_FUNCTION(cosh)
TILEFLIGHT_FUNCTION(tanh)
TILEFLIGHT_FUNCTION(asinh)
TILEFLIGHT_FUNCTION(acosh)
TILEFLIGHT_FUNCTION(atanh)
TILEFLIGHT_FUNCTION_OF_TWO(pow)
TILEFLIGHT_FUNCTION_OF_TWO(hypot)
TILEFLIGHT_FUNCTION_OF_TWO(atan2)

void sincos(double x, double* sine, double* cosine) noexcept { TILEFLIGHT_CALL(sincos_of_double, x, sine, cosine); }
void sincosf(float x, float* sine, float* cosine) noexcept {
  double s = 0.0, c = 0.0;
  sincos(static_cast<double>(x), &s, &c);
  *sine = static_cast<float>(s), *cosine = static_cast<float>(c);
}

}  // extern "C"
