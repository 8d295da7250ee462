// Elementary functions in pairs of doubles; included by elementary_functions.cpp, once for each kind of processor, into
// a namespace of its own.
//
// Sources: T. J. Dekker, A floating-point technique for extending the available precision, Numer. Math. 18, 1971
// (pairs); P.-T. P. Tang, Table-driven implementation of the exponential function, ACM TOMS 15(2), 1989, and of the
// logarithm, ACM TOMS 16(4), 1990; W. J. Cody, W. Waite, Software Manual for the Elementary Functions, 1980, and M.
// Payne, R. Hanek, Radian reduction for trigonometric functions, SIGNUM 18, 1983 (angles).

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// ---- pairs of numbers ----

/// The unevaluated sum of two doubles, |lo| <= ulp(hi) / 2: 106 bits.
struct Pair {
  double hi = 0.0;
  double lo = 0.0;
};

/// Returns a + b exactly, for |a| >= |b|.
constexpr Pair sum_of_ordered(double a, double b) {
  const double s = a + b;
  return {s, b - (s - a)};
}

/// Returns a + b exactly.
constexpr Pair sum_of(double a, double b) {
  const double s = a + b;
  const double b_part = s - a;
  return {s, (a - (s - b_part)) + (b - b_part)};
}

/// Returns a * b exactly, unless it over- or underflows. Both ways give the same two numbers.
constexpr Pair product_of(double a, double b) {
  const double p = a * b;
#ifdef TILEFLIGHT_FUSED
  if (!std::is_constant_evaluated()) return {p, __builtin_fma(a, b, -p)};
#endif
  constexpr double kSplitter = 134217729.0;  // 2^27 + 1
  const double a_scaled = kSplitter * a, b_scaled = kSplitter * b;
  const double a_hi = a_scaled - (a_scaled - a), b_hi = b_scaled - (b_scaled - b);
  const double a_lo = a - a_hi, b_lo = b - b_hi;
  return {p, ((a_hi * b_hi - p) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo};
}

constexpr Pair operator-(const Pair& a) { return {-a.hi, -a.lo}; }
constexpr Pair operator+(const Pair& a, double b) {
  const Pair s = sum_of(a.hi, b);
  return sum_of_ordered(s.hi, s.lo + a.lo);
}
constexpr Pair operator+(const Pair& a, const Pair& b) {
  const Pair s = sum_of(a.hi, b.hi), t = sum_of(a.lo, b.lo);
  const Pair u = sum_of_ordered(s.hi, s.lo + t.hi);
  return sum_of_ordered(u.hi, u.lo + t.lo);
}
constexpr Pair operator-(const Pair& a, const Pair& b) { return a + -b; }
constexpr Pair operator*(const Pair& a, double b) {
  const Pair p = product_of(a.hi, b);
  return sum_of_ordered(p.hi, p.lo + a.lo * b);
}
constexpr Pair operator*(const Pair& a, const Pair& b) {
  const Pair p = product_of(a.hi, b.hi);
  return sum_of_ordered(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}
constexpr Pair operator/(const Pair& a, const Pair& b) {
  const double q1 = a.hi / b.hi;
  const Pair r1 = a - b * q1;
  const double q2 = r1.hi / b.hi;
  const Pair r2 = r1 - b * q2;
  return sum_of_ordered(q1, q2) + r2.hi / b.hi;
}
/// Square root of a positive pair.
Pair root_of(const Pair& a) {
  const double r = __builtin_sqrt(a.hi);
  const Pair rest = a - product_of(r, r);
  return sum_of_ordered(r, rest.hi / (2.0 * r));
}
double value_of(const Pair& a) { return a.hi + a.lo; }

/// Returns x * 2^exponent, rounded once.
double scaled(const Pair& x, int exponent) {
  const double sum = x.hi + x.lo;
  if (sum == 0.0) return sum;
  const int magnitude = static_cast<int>(std::bit_cast<std::uint64_t>(sum) >> 52 & 0x7FF) - 1023 + exponent;
  if (magnitude > 1023) return sum > 0 ? kInfinity : -kInfinity;
  if (magnitude < -1076) return sum > 0 ? 0.0 : -0.0;
  const auto power = [](int e) { return std::bit_cast<double>(static_cast<std::uint64_t>(e + 1023) << 52); };
  if (magnitude >= -1022) {
    const int half = exponent / 2;
    return sum * power(half) * power(exponent - half);
  }
  // Subnormal: round at the last bit that is left, with the whole pair. 1.5 2^(52 + d) has its last bit at 2^d.
  const double big = 1.5 * power(52 - 1074 - exponent);
  const Pair shifted = sum_of(big, x.hi);
  const double rounded = shifted.hi + (shifted.lo + x.lo) - big;
  const int half = exponent / 2;
  return rounded * power(half) * power(exponent - half);
}

// ---- constants ----

constexpr Pair kLn2{0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56};
constexpr Pair kLn10{0x1.26bb1bbb55516p+1, -0x1.f48ad494ea3e9p-53};
constexpr Pair kPi{0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};
constexpr Pair kHalfPi{0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54};

// Tables are computed by the compiler, by series in pairs.

/// exp(x) for |x| < 1.
constexpr Pair exp_series(const Pair& x) {
  Pair term{1.0, 0.0}, total{1.0, 0.0};
  for (int n = 1; n < 32; ++n) {
    term = term * x / Pair{static_cast<double>(n), 0.0};
    total = total + term;
  }
  return total;
}

/// Natural logarithm of x in 0.6 to 1.7: 2 atanh((x - 1) / (x + 1)).
constexpr Pair log_series(double x) {
  const Pair u = sum_of(x, -1.0) / sum_of(x, 1.0), square = u * u;
  Pair power = u, total = u;
  for (int n = 3; n < 60; n += 2) {
    power = power * square;
    total = total + power / Pair{static_cast<double>(n), 0.0};
  }
  return total * 2.0;
}

struct SinCos {
  Pair sin, cos;
};

/// sin and cos of |x| < 1.6.
constexpr SinCos sin_cos_series(const Pair& x) {
  SinCos total{{0.0, 0.0}, {1.0, 0.0}};
  Pair term{1.0, 0.0};
  for (int n = 1; n < 36; ++n) {
    term = term * x / Pair{static_cast<double>(n), 0.0};
    const Pair signed_term = n % 4 == 1 || n % 4 == 0 ? term : -term;
    if (n % 2 == 1) {
      total.sin = total.sin + signed_term;
    } else {
      total.cos = total.cos + signed_term;
    }
  }
  return total;
}

/// atan(x) for |x| <= 1: Euler's series, whose terms shrink by x^2 / (1 + x^2).
constexpr Pair atan_series(double x) {
  const Pair square = product_of(x, x), one_more = square + 1.0;
  Pair term = Pair{x, 0.0} / one_more, total = term;
  for (int n = 1; n < 120 && term.hi > 0x1p-112; ++n) {
    term = term * (square / one_more) * (2.0 * n) / Pair{2.0 * n + 1.0, 0.0};
    total = total + term;
  }
  return total;
}

constexpr int kExpSteps = 64;
constexpr auto kExpTable = [] {  // 2^(i / 64)
  std::array<Pair, kExpSteps> table{};
  for (int i = 0; i < kExpSteps; ++i) table[i] = exp_series(kLn2 * (static_cast<double>(i) / kExpSteps));
  return table;
}();

constexpr int kLogSteps = 128;
struct LogEntry {
  double reciprocal = 1.0;  ///< of the middle of the step, rounded to few bits
  Pair log;                 ///< of 1 / reciprocal
};
/// Steps of 1 / 128 of 0.6875 to 1.375. Around 1 the reciprocal is 1, so that the logarithm is as exact as its
/// argument's distance from 1.
constexpr int kFirstLogStep = 88, kLastLogStep = 176;
constexpr auto kLogTable = [] {
  std::array<LogEntry, kLastLogStep - kFirstLogStep + 1> table{};
  for (int i = kFirstLogStep; i <= kLastLogStep; ++i) {
    if (i >= kLogSteps - 1 && i <= kLogSteps + 1) continue;
    const double reciprocal = static_cast<double>(static_cast<int>(512.0 * kLogSteps / i + 0.5)) / 512.0;
    table[i - kFirstLogStep] = {reciprocal, -log_series(reciprocal)};
  }
  return table;
}();

constexpr int kAngleSteps = 64;     // of a half turn
constexpr auto kSinCosTable = [] {  // of i pi / 64, a quarter turn
  std::array<SinCos, kAngleSteps / 2 + 1> table{};
  for (int i = 0; i <= kAngleSteps / 2; ++i) table[i] = sin_cos_series(kPi * (static_cast<double>(i) / kAngleSteps));
  return table;
}();

constexpr int kAtanSteps = 64;
constexpr auto kAtanTable = [] {  // of i / 64
  std::array<Pair, kAtanSteps + 1> table{};
  for (int i = 0; i <= kAtanSteps; ++i) table[i] = atan_series(static_cast<double>(i) / kAtanSteps);
  return table;
}();

double fail_domain(double result) {
  errno = EDOM;
  return result;
}
double fail_range(double result) {
  errno = ERANGE;
  return result;
}

/// Nearest whole number of |x| < 2^51, ties to even.
double nearest(double x) {
  constexpr double kBig = 0x1.8p52;
  return (x + kBig) - kBig;
}

// ---- exponential ----

/// exp(x) as pair * 2^exponent.
struct Power {
  Pair pair;
  int exponent = 0;
};

/// exp(r) - 1 of |r| < 0.006, relative error 2^-66 and less.
Pair small_exp_minus_1(const Pair& r) {
  const double x = r.hi;
  const double higher = x * x * x * (1.0 / 6 + x * (1.0 / 24 + x * (1.0 / 120 + x * (1.0 / 720 + x / 5040))));
  const Pair half_square = product_of(0.5 * x, x);
  return sum_of_ordered(r.hi, half_square.hi) + (r.lo + (half_square.lo + r.lo * r.hi + higher));
}

/// exp of x in ln 2 / 64 times `steps` plus `rest`.
Power exp_of_parts(int steps, const Pair& rest) {
  const Pair& table = kExpTable[steps & (kExpSteps - 1)];
  return {table + table * small_exp_minus_1(rest), steps >> 6};
}

/// exp of |x| < 800.
Power exp_of(const Pair& x) {
  constexpr Pair kStep{kLn2.hi / kExpSteps, kLn2.lo / kExpSteps};
  const double steps = nearest(x.hi * (kExpSteps / kLn2.hi));
  return exp_of_parts(static_cast<int>(steps), x - kStep * steps);
}

Power exp2_of(double x) {
  const double steps = nearest(x * kExpSteps);
  return exp_of_parts(static_cast<int>(steps), kLn2 * (x - steps / kExpSteps));
}

// ---- logarithm ----

constexpr auto kReciprocals = [] {  // 1 / n
  std::array<Pair, 9> table{};
  for (int n = 1; n < 9; ++n) table[n] = Pair{1.0, 0.0} / Pair{static_cast<double>(n), 0.0};
  return table;
}();

/// log(1 + r) of |r| < 2^-6.
Pair small_log(const Pair& r) {
  // Terms up to r^9 in pairs, the rest in double precision.
  constexpr int kPairTerms = 8;
  const double x = r.hi;
  double tail = 0.0;
  for (int n = 18; n > kPairTerms; --n) tail = tail * -x + 1.0 / n;
  Pair total{tail, 0.0};
  for (int n = kPairTerms; n >= 1; --n) total = -(r * total) + kReciprocals[n];
  return r * total;
}

/// Returns log(1 + r) of |r| < 2^-6 with a relative error of 2^-65.
Pair fast_small_log(const Pair& r) {
  const double x = r.hi;
  const double tail =
      x * x * x *
      (1.0 / 3 -
       x * (1.0 / 4 - x * (1.0 / 5 - x * (1.0 / 6 - x * (1.0 / 7 - x * (1.0 / 8 - x * (1.0 / 9 - x / 10)))))));
  const Pair half_square = product_of(-0.5 * x, x);
  return sum_of_ordered(r.hi, half_square.hi) + (r.lo + (half_square.lo - r.lo * x + tail));
}

/// Natural logarithm of a positive, finite x. `small` computes that of 1 + r.
template <class Small>
Pair log_by(const Pair& x, const Small& small) {
  double hi = x.hi, lo = x.lo;
  int exponent = 0;
  if (hi < 0x1p-1022) {
    hi *= 0x1p54, lo *= 0x1p54;
    exponent = -54;
  }
  const auto bits = std::bit_cast<std::uint64_t>(hi);
  // Mantissa in 0.6875 to 1.375.
  const auto above = static_cast<std::int64_t>(bits - std::bit_cast<std::uint64_t>(0.6875));
  const int power = static_cast<int>(above >> 52);
  exponent += power;
  const double m = std::bit_cast<double>(bits - (static_cast<std::uint64_t>(static_cast<std::int64_t>(power)) << 52));
  const double m_lo = lo == 0.0 ? 0.0 : lo * std::bit_cast<double>(static_cast<std::uint64_t>(1023 - power) << 52);
  const LogEntry& entry = kLogTable[static_cast<int>(m * kLogSteps + 0.5) - kFirstLogStep];
  const Pair product = product_of(m, entry.reciprocal);
  const Pair r = sum_of(product.hi - 1.0, product.lo) + m_lo * entry.reciprocal;
  return kLn2 * static_cast<double>(exponent) + (entry.log + small(r));
}

/// Natural logarithm of a positive, finite x: relative error 2^-64, and 2^-95.
Pair fast_log_of(const Pair& x) { return log_by(x, fast_small_log); }
Pair log_of(const Pair& x) { return log_by(x, small_log); }

// ---- sine, cosine ----

__extension__ using Wide = unsigned __int128;

/// An angle as a multiple of pi / 64, modulo a whole turn, and the rest.
struct ReducedAngle {
  int steps = 0;
  Pair rest;
};

/// Cody and Waite, for |x| < 2^30: the multiple of pi / 64 has three parts.
ReducedAngle reduce_small(double x) {
  constexpr double kStep1 = 0x1.921fb54442d18p-5, kStep2 = 0x1.1a62633145c07p-59, kStep3 = -0x1.f1976b7ed8fbcp-115;
  const double steps = nearest(x * (1.0 / kStep1));
  const Pair first = product_of(steps, kStep1), second = product_of(steps, kStep2);
  const Pair rest = (sum_of(x, -first.hi) + -first.lo) - second + -steps * kStep3;
  return {static_cast<int>(static_cast<std::int64_t>(steps) & 127), rest};
}

/// Bits of 2 / pi after the point, the first 64 first.
constexpr std::array<std::uint64_t, 20> kTwoOverPi{
    0xa2f9836e4e441529, 0xfc2757d1f534ddc0, 0xdb6295993c439041, 0xfe5163abdebbc561, 0xb7246e3a424dd2e0,
    0x06492eea09d1921c, 0xfe1deb1cb129a73e, 0xe88235f52ebb4484, 0xe99c7026b45f7e41, 0x3991d639835339f4,
    0x9c845f8bbdf9283b, 0x1ff897ffde05980f, 0xef2f118b5a0a6d1f, 0x6d367ecf27cb09b7, 0x4f463f669e5fea2d,
    0x7527bac7ebe5f17b, 0x3d0739f78a5292ea, 0x6bfb5fb11f8d5d08, 0x56033046fc7b6bab, 0xf0cfbc209af4361d};

/// Payne and Hanek, for |x| of 2^30 and more: of 2 / pi only the bits are multiplied that decide on x modulo a turn.
ReducedAngle reduce_large(double x) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) & ~(std::uint64_t{1} << 63);
  const std::uint64_t mantissa = (bits & 0xFFFFFFFFFFFFF) | 0x10000000000000;
  const int exponent = static_cast<int>(bits >> 52) - 1075;  // |x| = mantissa 2^exponent
  const int skipped = exponent > 2 ? exponent - 2 : 0;       // bits of 2 / pi that make multiples of four quarter turns
  // mantissa times 256 bits of 2 / pi: five words, the point after the first one.
  std::array<std::uint64_t, 5> product{};
  for (int i = 3; i >= 0; --i) {
    const int word = skipped / 64 + i, shift = skipped % 64;
    const std::uint64_t factor =
        shift == 0 ? kTwoOverPi[word] : kTwoOverPi[word] << shift | kTwoOverPi[word + 1] >> (64 - shift);
    const Wide sum = static_cast<Wide>(factor) * mantissa + product[i + 1];
    product[i + 1] = static_cast<std::uint64_t>(sum);
    product[i] = static_cast<std::uint64_t>(sum >> 64);
  }
  // Quarter turns: the product times 2^(exponent - skipped), at most 2^2.
  const int up = exponent - skipped;
  std::array<std::uint64_t, 5> turns = product;
  for (int i = 0; i < 4 && up > 0; ++i) turns[i] = product[i] << up | product[i + 1] >> (64 - up);
  for (int i = 4; i >= 0 && up < 0; --i) turns[i] = product[i] >> -up | (i > 0 ? product[i - 1] << (64 + up) : 0);
  // The nearest multiple of 1 / 32 quarter turn, and what is left as a signed number of 192 bits after the point.
  const std::uint64_t rounded = turns[1] + (std::uint64_t{1} << 58);
  const std::uint64_t whole = turns[0] + (rounded < turns[1] ? 1 : 0);
  const int steps = static_cast<int>((whole & 3) * 32 + (rounded >> 59));
  const auto high = static_cast<std::int64_t>(turns[1] - (rounded >> 59 << 59));
  Pair rest{static_cast<double>(high >> 32) * 0x1p-32, 0.0};
  rest = rest + static_cast<double>(high & 0xFFFFFFFF) * 0x1p-64;
  rest = rest + static_cast<double>(turns[2] >> 32) * 0x1p-96;
  rest = rest + static_cast<double>(turns[2] & 0xFFFFFFFF) * 0x1p-128;
  rest = rest + static_cast<double>(turns[3] >> 32) * 0x1p-160;
  rest = rest * kHalfPi;
  return x < 0 ? ReducedAngle{-steps & 127, -rest} : ReducedAngle{steps, rest};
}

/// sin and cos of a finite x.
SinCos sin_cos_of(double x) {
  const ReducedAngle angle = std::abs(x) < 0x1p30 ? reduce_small(x) : reduce_large(x);
  const double r = angle.rest.hi, square = r * r;
  // Terms of the third and higher order are so small that double precision is enough.
  const double sin_tail = r * square * (-1.0 / 6 + square * (1.0 / 120 + square * (-1.0 / 5040 + square / 362880)));
  const Pair sine = sum_of_ordered(r, sin_tail + angle.rest.lo);
  const double cos_tail =
      square * square * (1.0 / 24 + square * (-1.0 / 720 + square * (1.0 / 40320 - square / 3628800)));
  const Pair half_square = product_of(-0.5 * r, r);
  const Pair cosine_minus_1 = sum_of_ordered(half_square.hi, half_square.lo + cos_tail - angle.rest.lo * r);
  const SinCos& table = kSinCosTable[angle.steps & 31];
  const Pair s = table.sin + (table.cos * sine + table.sin * cosine_minus_1);
  const Pair c = table.cos + (table.cos * cosine_minus_1 - table.sin * sine);
  switch (angle.steps >> 5) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

// ---- arc tangent ----

/// atan(y / x) for 0 <= y <= x, x > 0.
Pair atan_of(const Pair& y, const Pair& x) {
  const int step = static_cast<int>(y.hi / x.hi * kAtanSteps + 0.5);
  const double t = static_cast<double>(step) / kAtanSteps;
  const Pair u = step == 0 ? y / x : (y - x * t) / (x + y * t);
  const double square = u.hi * u.hi;
  const double tail =
      u.hi * square * (-1.0 / 3 + square * (1.0 / 5 + square * (-1.0 / 7 + square * (1.0 / 9 - square / 11))));
  return kAtanTable[step] + sum_of_ordered(u.hi, u.lo + tail);
}

/// The angle of the point (x, y) in the upper half plane, 0 to pi; y >= 0, not both 0.
Pair angle_of(const Pair& y, const Pair& x) {
  const Pair size = x.hi < 0 ? -x : x;
  const Pair first = y.hi <= size.hi ? atan_of(y, size) : kHalfPi - atan_of(size, y);
  return x.hi < 0 ? kPi - first : first;
}

double atan2_of_finite(double y, double x) {
  const double a = std::abs(y), b = std::abs(x);
  if (a == 0.0) return std::copysign(std::signbit(x) ? value_of(kPi) : 0.0, y);
  if (b == 0.0) return std::copysign(kHalfPi.hi, y);
  const auto exponent_of = [](double v) { return static_cast<int>(std::bit_cast<std::uint64_t>(v) >> 52); };
  const int difference = exponent_of(a) - exponent_of(b);
  if (difference > 80) return std::copysign(kHalfPi.hi, y);
  if (difference < -80) return std::copysign(x < 0 ? kPi.hi : a / b, y);
  // Neither the squares nor the parts of products leave the range of doubles.
  const double scale = exponent_of(a) > 1400 || exponent_of(b) > 1400 ? 0x1p-500
                       : exponent_of(a) < 600 || exponent_of(b) < 600 ? 0x1p500
                                                                      : 1.0;
  return std::copysign(value_of(angle_of({a * scale, 0.0}, {x * scale, 0.0})), y);
}

/// sqrt(1 - x^2) for |x| < 1.
Pair other_leg(double x) { return root_of(sum_of(1.0, -x) * sum_of(1.0, x)); }

// ---- hyperbolic functions ----

Pair to_pair(const Power& power) {
  const double factor = std::bit_cast<double>(static_cast<std::uint64_t>(power.exponent + 1023) << 52);
  return {power.pair.hi * factor, power.pair.lo * factor};
}

/// exp(x) - 1 for |x| < 700.
Pair exp_minus_1_of(double x) {
  if (std::abs(x) < 0.005) return small_exp_minus_1({x, 0.0});
  return to_pair(exp_of({x, 0.0})) + -1.0;
}

/// log(1 + x) for x > -1 as a pair.
Pair log_1_plus(const Pair& x) { return fast_log_of(x + 1.0); }

double nearest_whole(double x) { return std::abs(x) < 0x1p51 ? nearest(x) : x; }
bool is_odd(double whole) { return std::abs(whole) < 0x1p53 && (static_cast<std::int64_t>(whole) & 1) != 0; }

// ---- the C library's functions ----

inline double exp_of_double(double x) {
  if (std::abs(x) < 0x1p-54) return 1.0 + x;
  if (!(x < 709.79)) return std::isnan(x) || x == kInfinity ? x : fail_range(kInfinity);
  if (x < -745.2) return x == -kInfinity ? 0.0 : fail_range(0.0);
  const Power power = exp_of({x, 0.0});
  return scaled(power.pair, power.exponent);
}

inline double exp2_of_double(double x) {
  if (!(x < 1024.0)) return std::isnan(x) || x == kInfinity ? x : fail_range(kInfinity);
  if (x < -1075.0) return x == -kInfinity ? 0.0 : fail_range(0.0);
  const Power power = exp2_of(x);
  return scaled(power.pair, power.exponent);
}

inline double expm1_of_double(double x) {
  if (std::isnan(x) || x == kInfinity || x == 0.0) return x;
  if (x > 709.79) return fail_range(kInfinity);
  if (x < -40.0) return -1.0;
  if (std::abs(x) < 0x1p-54) return x;
  if (x > 500.0) return exp_of_double(x);
  return value_of(exp_minus_1_of(x));
}

inline double log_of_double(double x) {
  if (std::isnan(x) || x == kInfinity) return x;
  if (x == 0.0) return fail_range(-kInfinity);
  if (x < 0.0) return fail_domain(kNan);
  return value_of(fast_log_of({x, 0.0}));
}

inline double log2_of_double(double x) {
  if (std::isnan(x) || x == kInfinity) return x;
  if (x == 0.0) return fail_range(-kInfinity);
  if (x < 0.0) return fail_domain(kNan);
  constexpr Pair kInverse{0x1.71547652b82fep+0, 0x1.777d0ffda0d24p-56};
  return value_of(fast_log_of({x, 0.0}) * kInverse);
}

inline double log10_of_double(double x) {
  if (std::isnan(x) || x == kInfinity) return x;
  if (x == 0.0) return fail_range(-kInfinity);
  if (x < 0.0) return fail_domain(kNan);
  return value_of(fast_log_of({x, 0.0}) / kLn10);
}

inline double log1p_of_double(double x) {
  if (std::isnan(x) || x == kInfinity || std::abs(x) < 0x1p-54) return x;
  if (x == -1.0) return fail_range(-kInfinity);
  if (x < -1.0) return fail_domain(kNan);
  return value_of(log_1_plus({x, 0.0}));
}

inline double pow_of_doubles(double x, double y) {
  if (y == 0.0 || x == 1.0) return 1.0;
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double size = std::abs(x);
  if (std::abs(y) == kInfinity) {
    if (size == 1.0) return 1.0;
    return (size > 1.0) == (y > 0.0) ? kInfinity : 0.0;
  }
  const bool is_whole = nearest_whole(y) == y;
  const double sign = std::signbit(x) && is_whole && is_odd(y) ? -1.0 : 1.0;
  if (size == 0.0) return y < 0.0 ? fail_range(sign * kInfinity) : sign * 0.0;
  if (size == kInfinity) return y < 0.0 ? sign * 0.0 : sign * kInfinity;
  if (x < 0.0 && !is_whole) return fail_domain(kNan);
  if (size == 1.0) return sign;
  const Pair logarithm = log_of({size, 0.0});
  const double rough = logarithm.hi * y;
  if (rough > 720.0) return fail_range(sign * kInfinity);
  if (rough < -760.0) return fail_range(sign * 0.0);
  const Power power = exp_of(std::abs(rough) < 0x1p-60 ? Pair{rough, 0.0} : logarithm * y);
  return sign * scaled(power.pair, power.exponent);
}

inline double exp10_of_double(double x) { return pow_of_doubles(10.0, x); }

inline double cbrt_of_double(double x) {
  if (x == 0.0 || !std::isfinite(x)) return x;
  const Power power = exp_of(log_of({std::abs(x), 0.0}) / Pair{3.0, 0.0});
  return std::copysign(scaled(power.pair, power.exponent), x);
}

inline double hypot_of_doubles(double x, double y) {
  double a = std::abs(x), b = std::abs(y);
  if (a == kInfinity || b == kInfinity) return kInfinity;
  if (std::isnan(a) || std::isnan(b)) return a + b;
  if (a < b) std::swap(a, b);
  if (b == 0.0 || a * 0x1p-60 > b) return a + b;
  const double scale = a > 0x1p500 ? 0x1p-600 : a < 0x1p-400 ? 0x1p600 : 1.0;
  a *= scale, b *= scale;
  return value_of(root_of(product_of(a, a) + product_of(b, b))) / scale;
}

inline double sin_of_double(double x) {
  if (!std::isfinite(x)) return std::isnan(x) ? x : fail_domain(kNan);
  return std::abs(x) < 0x1p-26 ? x : value_of(sin_cos_of(x).sin);
}

inline double cos_of_double(double x) {
  if (!std::isfinite(x)) return std::isnan(x) ? x : fail_domain(kNan);
  return std::abs(x) < 0x1p-27 ? 1.0 : value_of(sin_cos_of(x).cos);
}

inline void sincos_of_double(double x, double* sine, double* cosine) {
  if (!std::isfinite(x) || std::abs(x) < 0x1p-26) {
    *sine = sin_of_double(x), *cosine = cos_of_double(x);
    return;
  }
  const SinCos both = sin_cos_of(x);
  *sine = value_of(both.sin), *cosine = value_of(both.cos);
}

inline double tan_of_double(double x) {
  if (!std::isfinite(x)) return std::isnan(x) ? x : fail_domain(kNan);
  if (std::abs(x) < 0x1p-27) return x;
  const SinCos both = sin_cos_of(x);
  return value_of(both.sin / both.cos);
}

inline double atan2_of_doubles(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  if (std::abs(x) == kInfinity || std::abs(y) == kInfinity) {
    const double finite_y = std::abs(y) == kInfinity ? 1.0 : 0.0, finite_x = std::abs(x) == kInfinity ? 1.0 : 0.0;
    return atan2_of_finite(std::copysign(finite_y, y), std::copysign(finite_x, x));
  }
  return atan2_of_finite(y, x);
}

inline double atan_of_double(double x) { return std::abs(x) < 0x1p-27 || std::isnan(x) ? x : atan2_of_doubles(x, 1.0); }

inline double asin_of_double(double x) {
  if (std::isnan(x) || std::abs(x) < 0x1p-27) return x;
  if (std::abs(x) > 1.0) return fail_domain(kNan);
  if (std::abs(x) == 1.0) return std::copysign(kHalfPi.hi, x);
  return std::copysign(value_of(angle_of({std::abs(x), 0.0}, other_leg(x))), x);
}

inline double acos_of_double(double x) {
  if (std::isnan(x)) return x;
  if (std::abs(x) > 1.0) return fail_domain(kNan);
  if (std::abs(x) == 1.0) return x > 0.0 ? 0.0 : kPi.hi;
  return value_of(angle_of(other_leg(x), {x, 0.0}));
}

inline double sinh_of_double(double x) {
  const double size = std::abs(x);
  if (!std::isfinite(x) || size < 0x1p-27) return x;
  if (size > 710.48) return fail_range(std::copysign(kInfinity, x));
  if (size > 40.0) {
    const Power power = exp_of({size, 0.0});
    return std::copysign(scaled(power.pair, power.exponent - 1), x);
  }
  const Pair e = exp_minus_1_of(size);
  return std::copysign(0.5 * value_of(e + e / (e + 1.0)), x);
}

inline double cosh_of_double(double x) {
  const double size = std::abs(x);
  if (!std::isfinite(x)) return size;
  if (size > 710.48) return fail_range(kInfinity);
  const Power power = exp_of({size, 0.0});
  if (size > 40.0) return scaled(power.pair, power.exponent - 1);
  const Pair e = to_pair(power);
  return 0.5 * value_of(e + Pair{1.0, 0.0} / e);
}

inline double tanh_of_double(double x) {
  const double size = std::abs(x);
  if (std::isnan(x) || size < 0x1p-27) return x;
  if (size > 22.0) return std::copysign(1.0, x);
  const Pair e = exp_minus_1_of(2.0 * size);
  return std::copysign(value_of(e / (e + 2.0)), x);
}

inline double asinh_of_double(double x) {
  const double size = std::abs(x);
  if (!std::isfinite(x) || size < 0x1p-27) return x;
  if (size > 0x1p30) return std::copysign(value_of(fast_log_of({size, 0.0}) + kLn2), x);
  const Pair square = product_of(size, size);
  return std::copysign(value_of(log_1_plus(square / (root_of(square + 1.0) + 1.0) + size)), x);
}

inline double acosh_of_double(double x) {
  if (std::isnan(x) || x == kInfinity) return x;
  if (x < 1.0) return fail_domain(kNan);
  if (x == 1.0) return 0.0;
  if (x > 0x1p30) return value_of(fast_log_of({x, 0.0}) + kLn2);
  const Pair above = sum_of(x, -1.0);
  return value_of(log_1_plus(above + root_of(above * (above + 2.0))));
}

inline double atanh_of_double(double x) {
  const double size = std::abs(x);
  if (std::isnan(x) || size < 0x1p-27) return x;
  if (size > 1.0) return fail_domain(kNan);
  if (size == 1.0) return fail_range(std::copysign(kInfinity, x));
  return std::copysign(0.5 * value_of(log_1_plus(Pair{2.0 * size, 0.0} / sum_of(1.0, -size))), x);
}
