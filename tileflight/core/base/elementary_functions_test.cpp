// The C library's elementary functions as this program has them, against MPFR.

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <mpfr.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace tileflight::base {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kSamples = 4000;

/// Error in units of the last place of the exact result, which `exact` holds.
double error_ulp(double found, mpfr_t exact) {
  const double rounded = mpfr_get_d(exact, MPFR_RNDN);
  if (found == rounded) return 0.5;
  if (!std::isfinite(rounded) || !std::isfinite(found)) return kInfinity;
  const double size = std::max(std::abs(rounded), std::numeric_limits<double>::min());
  const double ulp = std::nextafter(size, kInfinity) - size;
  mpfr_sub_d(exact, exact, found, MPFR_RNDN);
  return std::abs(mpfr_get_d(exact, MPFR_RNDN)) / ulp;
}

struct Range {
  double from, to;
  bool logarithmic = false;  ///< samples have random signs, and their logarithms are uniform
};

class Samples {
 public:
  double operator()(const Range& range) {
    if (!range.logarithmic) return std::uniform_real_distribution(range.from, range.to)(random_);
    const double size = std::exp(std::uniform_real_distribution(std::log(range.from), std::log(range.to))(random_));
    return random_() % 2 == 0 ? size : -size;
  }

 private:
  std::mt19937_64 random_{1};
};

using Function = double (*)(double);
using Exact = int (*)(mpfr_t, const mpfr_t, mpfr_rnd_t);

struct Case {
  const char* name;
  Function function;
  Exact exact;
  std::vector<Range> ranges;
};

class ElementaryFunctions : public testing::TestWithParam<Case> {};

TEST_P(ElementaryFunctions, AreCorrectlyRoundedButForAFewThousandths) {
  const Case& function = GetParam();
  Samples next;
  mpfr_t x, y;
  mpfr_init2(x, 53);
  mpfr_init2(y, 200);
  for (const Range& range : function.ranges) {
    int not_nearest = 0;
    for (int i = 0; i < kSamples; ++i) {
      const double value = next(range);
      mpfr_set_d(x, value, MPFR_RNDN);
      function.exact(y, x, MPFR_RNDN);
      const double found = function.function(value), error = error_ulp(found, y);
      EXPECT_LT(error, 0.51) << function.name << '(' << value << ") = " << found;
      if (error != 0.5) ++not_nearest;
    }
    EXPECT_LE(not_nearest, kSamples / 200) << function.name;
  }
  mpfr_clears(x, y, static_cast<mpfr_ptr>(nullptr));
}

INSTANTIATE_TEST_SUITE_P(
    All, ElementaryFunctions,
    testing::Values(Case{"exp", std::exp, mpfr_exp, {{-1, 1}, {-700, 709}, {1e-20, 1, true}}},
                    Case{"exp2", std::exp2, mpfr_exp2, {{-1000, 1023}, {-1, 1}}},
                    Case{"expm1", std::expm1, mpfr_expm1, {{-1, 1}, {1e-16, 0.5, true}, {-40, 700}}},
                    Case{"log", std::log, mpfr_log, {{0, 2}, {0.9, 1.1}, {0.999999, 1.000001}, {1e-308, 1e308}}},
                    Case{"log2", std::log2, mpfr_log2, {{0, 2}, {1, 1e10}}},
                    Case{"log10", std::log10, mpfr_log10, {{0, 2}, {1, 1e10}}},
                    Case{"log1p", std::log1p, mpfr_log1p, {{-1, 1}, {1e-16, 0.5, true}, {1, 1e10}}},
                    Case{"cbrt", std::cbrt, mpfr_cbrt, {{-8, 8}, {1e-300, 1e300, true}}},
                    Case{"sin", std::sin, mpfr_sin, {{-4, 4}, {1e-10, 1e9, true}, {1e9, 1e300, true}}},
                    Case{"cos", std::cos, mpfr_cos, {{-4, 4}, {1e-10, 1e9, true}, {1e9, 1e300, true}}},
                    Case{"tan", std::tan, mpfr_tan, {{-4, 4}, {1e-10, 1e9, true}, {1e9, 1e300, true}}},
                    Case{"asin", std::asin, mpfr_asin, {{-1, 1}, {1e-10, 1, true}}},
                    Case{"acos", std::acos, mpfr_acos, {{-1, 1}, {1e-10, 1, true}}},
                    Case{"atan", std::atan, mpfr_atan, {{-2, 2}, {1e-10, 1e10, true}}},
                    Case{"sinh", std::sinh, mpfr_sinh, {{-3, 3}, {1e-10, 700, true}}},
                    Case{"cosh", std::cosh, mpfr_cosh, {{-3, 3}, {1e-10, 700, true}}},
                    Case{"tanh", std::tanh, mpfr_tanh, {{-3, 3}, {1e-10, 30, true}}},
                    Case{"asinh", std::asinh, mpfr_asinh, {{-3, 3}, {1e-10, 1e10, true}}},
                    Case{"acosh", std::acosh, mpfr_acosh, {{1, 3}, {1, 1e10}}},
                    Case{"atanh", std::atanh, mpfr_atanh, {{-1, 1}, {1e-10, 1, true}}}),
    [](const auto& info) { return std::string(info.param.name); });

using FunctionOfTwo = double (*)(double, double);
using ExactOfTwo = int (*)(mpfr_t, const mpfr_t, const mpfr_t, mpfr_rnd_t);

struct CaseOfTwo {
  const char* name;
  FunctionOfTwo function;
  ExactOfTwo exact;
  std::vector<std::array<Range, 2>> ranges;
};

class ElementaryFunctionsOfTwo : public testing::TestWithParam<CaseOfTwo> {};

TEST_P(ElementaryFunctionsOfTwo, AreCorrectlyRoundedButForAFewThousandths) {
  const CaseOfTwo& function = GetParam();
  Samples next;
  mpfr_t x, y, z;
  mpfr_inits2(53, x, y, static_cast<mpfr_ptr>(nullptr));
  mpfr_init2(z, 200);
  for (const auto& [first, second] : function.ranges) {
    for (int i = 0; i < kSamples; ++i) {
      const double a = next(first), b = next(second);
      mpfr_set_d(x, a, MPFR_RNDN);
      mpfr_set_d(y, b, MPFR_RNDN);
      function.exact(z, x, y, MPFR_RNDN);
      const double found = function.function(a, b);
      if (std::isnan(found) && mpfr_nan_p(z) != 0) continue;
      EXPECT_LT(error_ulp(found, z), 0.51) << function.name << '(' << a << ", " << b << ") = " << found;
    }
  }
  mpfr_clears(x, y, z, static_cast<mpfr_ptr>(nullptr));
}

INSTANTIATE_TEST_SUITE_P(All, ElementaryFunctionsOfTwo,
                         testing::Values(CaseOfTwo{"pow",
                                                   std::pow,
                                                   mpfr_pow,
                                                   {{Range{0, 1}, Range{-4, 4}},
                                                    {Range{1e-3, 1e3, true}, Range{-20, 20}},
                                                    {Range{0.9, 1.1}, Range{-300, 300}}}},
                                         CaseOfTwo{"hypot",
                                                   std::hypot,
                                                   mpfr_hypot,
                                                   {{Range{-3, 3}, Range{-3, 3}},
                                                    {Range{1e-300, 1e300, true}, Range{1e-300, 1e300, true}}}},
                                         CaseOfTwo{"atan2",
                                                   std::atan2,
                                                   mpfr_atan2,
                                                   {{Range{-3, 3}, Range{-3, 3}},
                                                    {Range{1e-300, 1e300, true}, Range{1e-300, 1e300, true}}}}),
                         [](const auto& info) { return std::string(info.param.name); });

/// Returns the function of this name in glibc, whose special cases are those of the C standard.
template <class F>
F in_c_library(const char* name) {
  static void* const library = dlopen("libm.so.6", RTLD_NOW);
  return reinterpret_cast<F>(dlsym(library, name));
}

/// Whether both are the same special result, or the same number but for its last bits.
bool same(double a, double b) {
  if (std::abs(a - b) <= 1e-15 * std::abs(b)) return true;

  return (std::isnan(a) && std::isnan(b)) || (a == b && std::signbit(a) == std::signbit(b));
}

TEST(ElementaryFunctionsSpecial, CasesAreThoseOfTheCLibrary) {
  const std::vector<double> values{0.0,  -0.0,  1.0,    -1.0,   2.0,     -2.0,      3.0,        -3.0,         0.5,
                                   -0.5, 1e300, -1e300, 5e-324, -5e-324, kInfinity, -kInfinity, std::nan(""), 1e9};
  for (const auto& [name, function] : std::vector<std::pair<const char*, Function>>{{"exp", std::exp},
                                                                                    {"exp2", std::exp2},
                                                                                    {"expm1", std::expm1},
                                                                                    {"log", std::log},
                                                                                    {"log2", std::log2},
                                                                                    {"log10", std::log10},
                                                                                    {"log1p", std::log1p},
                                                                                    {"cbrt", std::cbrt},
                                                                                    {"asin", std::asin},
                                                                                    {"acos", std::acos},
                                                                                    {"sinh", std::sinh},
                                                                                    {"cosh", std::cosh},
                                                                                    {"tanh", std::tanh},
                                                                                    {"asinh", std::asinh},
                                                                                    {"acosh", std::acosh},
                                                                                    {"atanh", std::atanh}}) {
    for (const double x : {0.0, -0.0, kInfinity, -kInfinity, std::nan(""), 1e308, -1e308, -2.0})
      EXPECT_TRUE(same(function(x), in_c_library<Function>(name)(x))) << name << '(' << x << ") = " << function(x);
  }
  for (const auto& [name, function] : std::vector<std::pair<const char*, FunctionOfTwo>>{
           {"pow", std::pow}, {"hypot", std::hypot}, {"atan2", std::atan2}}) {
    for (const double x : values) {
      for (const double y : values) {
        const double expected = in_c_library<FunctionOfTwo>(name)(x, y), found = function(x, y);
        EXPECT_TRUE(same(found, expected)) << name << '(' << x << ", " << y << ") = " << found;
      }
    }
  }
  for (Function function : {Function(std::sin), Function(std::cos), Function(std::tan)})
    EXPECT_TRUE(std::isnan(function(kInfinity)));
}

TEST(ElementaryFunctionsSpecial, SharedLibrariesCallThemAsWell) {
  for (const char* name : {"sin", "cos", "exp", "pow", "atan2", "sinf", "expf"}) {
    Dl_info first{}, own{};
    ASSERT_NE(dladdr(dlsym(RTLD_DEFAULT, name), &first), 0);
    ASSERT_NE(dladdr(reinterpret_cast<void*>(&in_c_library<Function>), &own), 0);
    EXPECT_EQ(first.dli_fbase, own.dli_fbase) << name << " is found in " << first.dli_fname;
  }
}

}  // namespace
}  // namespace tileflight::base
