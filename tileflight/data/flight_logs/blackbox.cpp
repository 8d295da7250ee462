// Betaflight's flight log, "Blackbox Internals" (betaflight/docs/development): a session is a text header that
// describes the fields of each kind of frame, and then frames without lengths or checksums. A field is its predicted
// value plus what the frame holds, packed by the field's encoding; fields of one group encoding stand next to each
// other. Values are 32 bits wide and wrap.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/inertial_logs.h"

namespace tileflight::flight_logs {
namespace {

using geometry::Vec3;

constexpr double kOneG_m_s2 = 9.80665, kDegree_rad = std::numbers::pi / 180.0;
constexpr std::string_view kStart = "H Product:Blackbox";
constexpr std::size_t kMostFields = 256, kLongestFrame = 1024, kLongestLine = 16384;
constexpr std::size_t kMostDamage = 100000, kMostFrames = 10'000'000;

enum Encoding : int {
  kSignedBytes = 0,
  kUnsignedBytes = 1,
  kNegated14Bits = 3,
  kTag8Of8 = 6,
  kTag2Of3 = 7,
  kTag8Of4 = 8,
  kNothing = 9,
  kTag2Of3Variable = 10,
};

enum Predictor : int {
  kZero = 0,
  kPrevious = 1,
  kStraightLine = 2,
  kAverage = 3,
  kMinThrottle = 4,
  kMotor0 = 5,
  kIncrement = 6,
  k1500 = 8,
  kVbatRef = 9,
  kMinMotor = 11,
};

/// Signals that a frame cannot be decoded; the decoder goes on behind it.
struct Damage {};

std::int32_t sign_extended(std::uint32_t value, int bits) {
  const std::uint32_t sign = std::uint32_t{1} << static_cast<unsigned>(bits - 1);
  return static_cast<std::int32_t>((value ^ sign) - sign);
}

/// The bytes of a session.
class ByteReader {
 public:
  ByteReader(std::string_view bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  std::size_t at() const { return at_; }
  std::uint32_t byte() {
    if (at_ >= bytes_.size()) throw Damage();
    return static_cast<unsigned char>(bytes_[at_++]);
  }
  std::uint32_t unsigned_value() {
    std::uint32_t value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {
      const std::uint32_t part = byte();
      value |= (part & 0x7FU) << shift;
      if ((part & 0x80U) == 0) return value;
    }
    throw Damage();
  }
  std::int32_t signed_value() {
    const std::uint32_t folded = unsigned_value();
    return static_cast<std::int32_t>((folded >> 1U) ^ (~(folded & 1U) + 1U));
  }
  void skip(std::size_t count) {
    if (count > bytes_.size() - at_) throw Damage();
    at_ += count;
  }

 private:
  std::string_view bytes_;
  std::size_t at_;
};

/// Values of the last group field, whose secondary header states a size in bytes for each.
void read_sized_values(ByteReader& in, std::uint32_t lead, std::array<std::int32_t, 8>& values) {
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint32_t bytes = ((lead >> (2U * i)) & 3U) + 1U;
    std::uint32_t value = 0;
    for (std::uint32_t k = 0; k < bytes; ++k) value |= in.byte() << (8U * k);
    values[i] = sign_extended(value, static_cast<int>(8U * bytes));
  }
}

void read_tag2_of_3(ByteReader& in, std::array<std::int32_t, 8>& values) {
  const std::uint32_t lead = in.byte();
  switch (lead >> 6U) {
    case 0:
      for (unsigned i = 0; i < 3; ++i) values[i] = sign_extended((lead >> (4U - 2U * i)) & 3U, 2);
      return;
    case 1: {
      const std::uint32_t next = in.byte();
      values[0] = sign_extended(lead & 15U, 4);
      values[1] = sign_extended(next >> 4U, 4);
      values[2] = sign_extended(next & 15U, 4);
      return;
    }
    case 2:
      values[0] = sign_extended(lead & 63U, 6);
      values[1] = sign_extended(in.byte() & 63U, 6);
      values[2] = sign_extended(in.byte() & 63U, 6);
      return;
    default:
      read_sized_values(in, lead, values);
  }
}

void read_tag2_of_3_variable(ByteReader& in, std::array<std::int32_t, 8>& values) {
  const std::uint32_t lead = in.byte();
  switch (lead >> 6U) {
    case 0:
      for (unsigned i = 0; i < 3; ++i) values[i] = sign_extended((lead >> (4U - 2U * i)) & 3U, 2);
      return;
    case 1: {  // 5, 5 and 4 bits
      const std::uint32_t next = in.byte();
      values[0] = sign_extended((lead >> 1U) & 31U, 5);
      values[1] = sign_extended(((lead & 1U) << 4U) | (next >> 4U), 5);
      values[2] = sign_extended(next & 15U, 4);
      return;
    }
    case 2: {  // 8, 7 and 7 bits
      const std::uint32_t second = in.byte(), third = in.byte();
      values[0] = sign_extended(((lead & 63U) << 2U) | (second >> 6U), 8);
      values[1] = sign_extended(((second & 63U) << 1U) | (third >> 7U), 7);
      values[2] = sign_extended(third & 127U, 7);
      return;
    }
    default:
      read_sized_values(in, lead, values);
  }
}

/// Fields of 0, 4, 8 or 16 bits as a stream of half bytes.
void read_tag8_of_4(ByteReader& in, std::array<std::int32_t, 8>& values) {
  constexpr std::array<int, 4> kHalfBytes{0, 1, 2, 4};
  const std::uint32_t lead = in.byte();
  std::uint32_t last = 0;
  bool has_low_half = false;
  const auto half_byte = [&] {
    has_low_half = !has_low_half;
    if (!has_low_half) return last & 15U;
    last = in.byte();
    return last >> 4U;
  };
  for (unsigned i = 0; i < 4; ++i) {
    const int count = kHalfBytes[(lead >> (2U * i)) & 3U];
    std::uint32_t value = 0;
    for (int k = 0; k < count; ++k) value = (value << 4U) | half_byte();
    values[i] = count == 0 ? 0 : sign_extended(value, 4 * count);
  }
}

/// The fields of one kind of frame.
struct FrameLayout {
  std::vector<std::string> names;
  std::vector<int> predictors, encodings;

  std::optional<std::size_t> find(std::string_view name) const {
    const auto found = std::ranges::find(names, name);
    return found == names.end() ? std::nullopt : std::optional(static_cast<std::size_t>(found - names.begin()));
  }
  /// A frame without bytes of its own would be repeated by any byte.
  bool is_whole() const {
    const bool holds_bytes = std::ranges::any_of(encodings, [](int encoding) { return encoding != kNothing; });
    return holds_bytes && encodings.size() == predictors.size() && encodings.size() <= kMostFields;
  }
};

using Values = std::vector<std::int32_t>;

/// Reads what a frame holds beside its predictions.
Values read_residuals(ByteReader& in, const FrameLayout& layout) {
  const std::size_t count = layout.encodings.size();
  Values residuals;
  residuals.reserve(count);
  while (residuals.size() < count) {
    const int encoding = layout.encodings[residuals.size()];
    std::array<std::int32_t, 8> group{};
    std::size_t size = 1;
    switch (encoding) {
      case kSignedBytes:
        group[0] = in.signed_value();
        break;
      case kUnsignedBytes:
        group[0] = static_cast<std::int32_t>(in.unsigned_value());
        break;
      case kNegated14Bits:
        group[0] = -sign_extended(in.unsigned_value() & 0x3FFFU, 14);
        break;
      case kNothing:
        break;
      case kTag2Of3:
        read_tag2_of_3(in, group);
        size = 3;
        break;
      case kTag2Of3Variable:
        read_tag2_of_3_variable(in, group);
        size = 3;
        break;
      case kTag8Of4:
        read_tag8_of_4(in, group);
        size = 4;
        break;
      case kTag8Of8: {
        while (size < group.size() && residuals.size() + size < count &&
               layout.encodings[residuals.size() + size] == kTag8Of8)
          ++size;
        const std::uint32_t header = size == 1 ? 1U : in.byte();
        for (std::size_t i = 0; i < size; ++i)
          if (((header >> i) & 1U) != 0) group[i] = in.signed_value();
        break;
      }
      default:
        throw Damage();
    }
    for (std::size_t i = 0; i < size && residuals.size() < count; ++i) residuals.push_back(group[i]);
  }
  return residuals;
}

std::int32_t wrapped_sum(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}

/// The text before a session's frames.
struct SessionHeader {
  std::map<std::string, std::string, std::less<>> values;
  std::map<char, FrameLayout> layouts;
  std::size_t end = 0;  ///< of the header in the file

  std::int32_t number(std::string_view key, std::int32_t fallback) const {
    const auto found = values.find(key);
    if (found == values.end()) return fallback;
    const std::string_view first = std::string_view(found->second).substr(0, found->second.find(','));
    return base::parse_number<std::int32_t>(base::trim(first)).value_or(fallback);
  }
};

std::vector<int> parse_numbers(std::string_view text) {
  std::vector<int> numbers;
  for (const std::string_view field : base::split_fields(text, ", \t\r"))
    numbers.push_back(base::parse_number<int>(field).value_or(-1));
  return numbers;
}

void add_header_line(std::string_view key, std::string_view value, SessionHeader& header) {
  if (!key.starts_with("Field ") || key.size() < 9) {
    header.values.emplace(key, value);
    return;
  }
  FrameLayout& layout = header.layouts[key[6]];
  const std::string what = base::to_lower(key.substr(8));
  if (what == "name")
    for (const std::string_view name : base::split_fields(value, ",\r")) layout.names.emplace_back(base::trim(name));
  if (what == "predictor") layout.predictors = parse_numbers(value);
  if (what == "encoding") layout.encodings = parse_numbers(value);
}

SessionHeader read_header(std::string_view bytes, std::size_t at) {
  SessionHeader header;
  while (bytes.substr(at).starts_with("H ")) {
    const std::size_t end = bytes.substr(0, std::min(bytes.size(), at + kLongestLine)).find('\n', at);
    const std::size_t colon = bytes.find(':', at);
    if (end == std::string_view::npos || colon > end) break;
    add_header_line(bytes.substr(at + 2, colon - at - 2), base::trim(bytes.substr(colon + 1, end - colon - 1)), header);
    at = end + 1;
  }
  if (const auto intra = header.layouts.find('I'); intra != header.layouts.end() && header.layouts.contains('P'))
    header.layouts['P'].names = intra->second.names;
  header.end = at;
  return header;
}

/// The main frames of a session: those fields that an inertial unit's readings need.
struct MainFrames {
  std::vector<std::uint32_t> times_us;
  std::vector<std::array<std::int32_t, 6>> values;  ///< gyroscope, accelerometer
  std::size_t damaged = 0;
  bool has_motion_fields = false, is_cut = false;
};

class SessionDecoder {
 public:
  SessionDecoder(std::string_view bytes, const SessionHeader& header) : bytes_(bytes), header_(header) {
    min_throttle_ = header.number("minthrottle", 1150);
    vbat_ref_ = header.number("vbatref", 4095);
    min_motor_ = header.number("motorOutput", 0);
    choose_fields();
  }

  /// Decodes at most kMostFrames frames: some forty minutes at the highest rate.
  MainFrames decode() {
    frames_.has_motion_fields = time_.has_value() && has_fields_;
    std::size_t at = header_.end;
    while (frames_.has_motion_fields && at < bytes_.size() && !has_ended_ && frames_.damaged < kMostDamage) {
      const std::size_t begin = at;
      frames_.is_cut = ++count_ > kMostFrames;
      if (frames_.is_cut) break;
      ByteReader in(bytes_, at);
      try {
        read_frame(in);
        at = in.at();
      } catch (const Damage&) {
        ++frames_.damaged;
        history_.clear();
        // Only an intra frame can be decoded without those before it.
        at = std::min(bytes_.find('I', begin + 1), bytes_.size());
      }
    }
    return std::move(frames_);
  }

 private:
  const FrameLayout* layout_of(char kind) const {
    const auto found = header_.layouts.find(kind);
    return found == header_.layouts.end() || !found->second.is_whole() ? nullptr : &found->second;
  }

  void choose_fields() {
    const FrameLayout* const intra = layout_of('I');
    const FrameLayout* const inter = layout_of('P');
    if (intra == nullptr || inter == nullptr || intra->names.size() != intra->encodings.size() ||
        inter->encodings.size() != intra->encodings.size())
      return;
    time_ = intra->find("time");
    motor_0_ = intra->find("motor[0]");
    has_fields_ = true;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string index = "[" + std::to_string(axis) + "]";
      auto rate = intra->find("gyroADC" + index);
      if (!rate) rate = intra->find("gyroData" + index);
      const auto force = intra->find("accSmooth" + index);
      has_fields_ = has_fields_ && rate && force;
      if (rate) fields_[static_cast<std::size_t>(axis)] = *rate;
      if (force) fields_[static_cast<std::size_t>(axis) + 3] = *force;
    }
  }

  void read_frame(ByteReader& in) {
    const char kind = static_cast<char>(in.byte());
    const std::size_t begin = in.at();
    if (kind == 'E') {
      read_event(in);
    } else {
      const FrameLayout* const layout = layout_of(kind);
      if (layout == nullptr || std::string_view("IPSGH").find(kind) == std::string_view::npos) throw Damage();
      const Values residuals = read_residuals(in, *layout);
      if (in.at() - begin > kLongestFrame || !is_frame_start(in.at())) throw Damage();
      if (kind == 'I') take_intra(residuals, *layout);
      if (kind == 'P') take_inter(residuals, *layout);
    }
  }

  /// Frames have no checksum: what follows one must be a frame, or the end.
  bool is_frame_start(std::size_t at) const {
    return at >= bytes_.size() || std::string_view("IPSGHE").find(bytes_[at]) != std::string_view::npos;
  }

  void read_event(ByteReader& in) {
    constexpr std::string_view kEnd("End of log\0", 11);
    switch (in.byte()) {
      case 0:   // beep
      case 15:  // disarmed
      case 40:  // failure of the inertial unit
        in.unsigned_value();
        return;
      case 10:
        return in.skip(5);
      case 11:
        return in.skip(4);
      case 12:
        return in.skip(8);
      case 13:  // an adjustment: a whole number, or a float
        if (in.byte() >= 128U) return in.skip(4);
        in.signed_value();
        return;
      case 14:  // logging goes on after a pause
        in.unsigned_value();
        in.unsigned_value();
        history_.clear();
        last_us_.reset();
        return;
      case 30:  // flight mode
        in.unsigned_value();
        in.unsigned_value();
        return;
      case 255:
        if (!bytes_.substr(in.at()).starts_with(kEnd)) throw Damage();
        has_ended_ = true;
        return;
      default:
        throw Damage();
    }
  }

  std::int32_t constant_of(int predictor, const Values& values) const {
    switch (predictor) {
      case kMinThrottle:
        return min_throttle_;
      case kMotor0:
        return motor_0_ && *motor_0_ < values.size() ? values[*motor_0_] : 0;
      case k1500:
        return 1500;
      case kVbatRef:
        return vbat_ref_;
      case kMinMotor:
        return min_motor_;
      default:
        return 0;
    }
  }

  void take_intra(const Values& residuals, const FrameLayout& layout) {
    Values values;
    for (std::size_t i = 0; i < residuals.size(); ++i)
      values.push_back(wrapped_sum(residuals[i], constant_of(layout.predictors[i], values)));
    require_plausible_time(values);
    history_ = {values, values};
    add(values);
  }

  void take_inter(const Values& residuals, const FrameLayout& layout) {
    if (history_.empty()) return;  // it follows damage
    Values values;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      const std::int32_t last = history_[0][i], before = history_[1][i];
      std::int32_t predicted = constant_of(layout.predictors[i], values);
      switch (layout.predictors[i]) {
        case kPrevious:
          predicted = last;
          break;
        case kStraightLine:
          predicted =
              wrapped_sum(last, wrapped_sum(last, static_cast<std::int32_t>(~static_cast<std::uint32_t>(before) + 1U)));
          break;
        case kAverage:
          predicted = static_cast<std::int32_t>((static_cast<std::int64_t>(last) + before) / 2);
          break;
        case kIncrement:
          predicted = wrapped_sum(last, 1);
          break;
        default:
          break;
      }
      values.push_back(wrapped_sum(residuals[i], predicted));
    }
    require_plausible_time(values);
    history_ = {values, history_[0]};
    add(values);
  }

  /// Damage that decodes shows itself by its time.
  void require_plausible_time(const Values& values) const {
    constexpr std::uint32_t kLongestGap_us = 10'000'000;
    const auto time_us = static_cast<std::uint32_t>(values[*time_]);
    if (last_us_ && (time_us == *last_us_ || time_us - *last_us_ > kLongestGap_us)) throw Damage();
  }

  void add(const Values& values) {
    last_us_ = static_cast<std::uint32_t>(values[*time_]);
    frames_.times_us.push_back(*last_us_);
    std::array<std::int32_t, 6> motion{};
    for (std::size_t i = 0; i < motion.size(); ++i) motion[i] = values[fields_[i]];
    frames_.values.push_back(motion);
  }

  std::string_view bytes_;
  const SessionHeader& header_;
  std::int32_t min_throttle_ = 0, vbat_ref_ = 0, min_motor_ = 0;
  std::optional<std::size_t> time_, motor_0_;
  std::array<std::size_t, 6> fields_{};
  bool has_fields_ = false, has_ended_ = false;
  std::size_t count_ = 0;        ///< of frames and of attempts at them
  std::vector<Values> history_;  ///< the last frame and the one before it; empty: none
  std::optional<std::uint32_t> last_us_;
  MainFrames frames_;
};

/// Throws InputError if all lengths of the accelerometer's readings are 0.
void require_accelerometer(const std::vector<double>& lengths, const std::string& where) {
  if (std::ranges::all_of(lengths, [](double length) { return length == 0.0; }))
    throw InputError(where,
                     "its accelerometer was off: all readings are 0; switch it on (acc_hardware) and record again");
}

/// The accelerometer's reading of one g, told by the length of its readings: units report a power of two. Throws
/// InputError if none fits.
double guess_one_g(std::vector<double> lengths, const std::string& where) {
  constexpr double kLikeness = 1.2;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  for (double one_g = 256.0; one_g <= 16384.0; one_g *= 2.0)
    if (*middle<one_g * kLikeness&& * middle> one_g / kLikeness) return one_g;
  throw InputError(where, base::formatted("does not state the accelerometer's unit, and its readings of about %.4g are "
                                          "near no usual one: decode the log with --unit-acceleration g, or give the "
                                          ".bbl itself",
                                          *middle));
}

/// "0x3f800000", the bits of a float.
std::optional<double> float_of_bits(std::string_view text) {
  if (!base::take_prefix(text, "0x")) return base::parse_finite_number(text);
  std::uint32_t bits = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), bits, 16);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  const double value = std::bit_cast<float>(bits);
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// Degrees a second of one unit of the gyroscope's fields.
double gyro_scale(std::optional<std::string_view> text, const std::string& where) {
  if (!text) return 1.0;
  const auto scale = float_of_bits(*text);
  constexpr double kLeast = 1e-4, kMost = 10.0;
  if (!scale || !(*scale >= kLeast && *scale <= kMost))
    throw InputError(where,
                     "its gyro_scale '" + std::string(text->substr(0, 40)) + "' is no scale in degrees a second");
  return *scale;
}

void add_axes_note(const std::string& where, InertialLog& log) {
  log.notes.push_back(where +
                      ": a blackbox log's readings are in the vehicle's axes (x forward, y left, z up), and its "
                      "times begin with the log: T_cam_imu and --imu-time-offset must say how the camera lies "
                      "and when it started");
}

}  // namespace

InertialLog parse_blackbox(std::string_view bytes, const std::string& where) {
  std::optional<SessionHeader> longest_header;
  MainFrames longest;
  std::size_t sessions = 0;
  bool has_other_version = false;
  for (std::size_t at = bytes.find(kStart); at != std::string_view::npos; at = bytes.find(kStart, at + 1)) {
    constexpr std::size_t kMostSessions = 1000;
    if (++sessions > kMostSessions) break;
    const std::string_view session = bytes.substr(0, std::min(bytes.find(kStart, at + 1), bytes.size()));
    const SessionHeader header = read_header(session, at);
    if (header.number("Data version", 2) != 2) {
      has_other_version = true;
      continue;
    }
    MainFrames frames = SessionDecoder(session, header).decode();
    if (longest_header && frames.values.size() <= longest.values.size()) continue;
    longest = std::move(frames);
    longest_header = header;
  }
  if (!longest_header)
    throw InputError(where, has_other_version ? "is of a data version other than 2, which is not read: convert it with "
                                                "blackbox_decode --unit-acceleration g"
                                              : "holds no recording of a blackbox");
  if (!longest.has_motion_fields)
    throw InputError(where,
                     "its frames lack the time, gyroADC or accSmooth: switch on the logging of gyroscope and "
                     "accelerometer (blackbox_disable_gyro, blackbox_disable_acc)");
  if (longest.values.size() < 2 || longest.damaged > longest.values.size())
    throw InputError(where, base::formatted("%zu frames could be decoded and %zu could not: the log is damaged",
                                            longest.values.size(), longest.damaged));
  InertialLog log;
  std::optional<std::string_view> scale;
  for (const std::string_view key : {"gyro_scale", "gyro.scale"})
    if (const auto found = longest_header->values.find(key); found != longest_header->values.end())
      scale = found->second;
  const double rate_scale = kDegree_rad * gyro_scale(scale, where);
  std::vector<double> lengths;
  for (const auto& values : longest.values) lengths.push_back(Vec3(values[3], values[4], values[5]).norm());
  require_accelerometer(lengths, where);
  double one_g = longest_header->number("acc_1G", 0);
  if (!(one_g > 0.0)) {
    one_g = guess_one_g(std::move(lengths), where);
    log.notes.push_back(where + base::formatted(": states no acc_1G; %g is assumed, by the readings' length", one_g));
  }
  const double force_scale = kOneG_m_s2 / one_g;
  double time_s = 0.0;
  for (std::size_t i = 0; i < longest.values.size(); ++i) {
    // Differences stay right where the counter of 32 bits wraps.
    if (i > 0) time_s += 1e-6 * static_cast<double>(longest.times_us[i] - longest.times_us[i - 1]);
    const auto& v = longest.values[i];
    log.readings.push_back({time_s, rate_scale * Vec3(v[0], v[1], v[2]), force_scale * Vec3(v[3], v[4], v[5])});
  }
  add_axes_note(where, log);
  if (sessions > 1)
    log.notes.push_back(where + ": holds " + std::to_string(sessions) + " recordings; the longest is used");
  if (longest.is_cut) log.notes.push_back(where + ": only its first ten million frames are read");
  if (longest.damaged > 0)
    log.notes.push_back(where + ": " + std::to_string(longest.damaged) + " damaged parts are left out");
  return log;
}

InertialLog parse_blackbox_csv(std::string_view text, const std::string& where) {
  std::map<std::string, std::string, std::less<>> header;
  std::vector<std::string_view> names;
  text = base::strip_byte_order_mark(text);
  int number = 0;
  while (const auto line = base::take_line(text)) {
    ++number;
    std::vector<std::string_view> fields = split_at_commas(*line);
    if (fields[0] == "loopIteration") {
      names = std::move(fields);
      break;
    }
    if (fields.size() >= 2) header.emplace(fields[0], fields[1]);
  }
  if (names.empty()) throw InputError(where, "has no column loopIteration: it is no table of a blackbox log");
  struct Column {
    std::size_t index = 0;
    std::string unit;
  };
  const auto column_of = [&](const std::string& wanted) -> std::optional<Column> {
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::size_t bracket = names[i].find(" (");
      if (base::trim(names[i].substr(0, bracket)) != wanted) continue;
      return Column{i, bracket == std::string_view::npos ? "" : std::string(names[i].substr(bracket + 1))};
    }
    return std::nullopt;
  };
  const auto time = column_of("time");
  std::array<Column, 6> columns;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string index = "[" + std::to_string(i % 3) + "]";
    auto column = column_of((i < 3 ? "gyroADC" : "accSmooth") + index);
    if (!column && i < 3) column = column_of("gyroData" + index);
    if (!column || !time)
      throw InputError(where, "lacks the time, gyroADC or accSmooth: log gyroscope and accelerometer");
    columns[i] = *column;
  }
  if (!time->unit.empty() && time->unit != "(us)")
    throw InputError(where, "the unit of its time, '" + time->unit.substr(0, 40) + "', is not (us)");
  InertialLog log;
  double rate_scale = kDegree_rad;
  if (columns[0].unit == "(rad/s)") rate_scale = 1.0;
  if (columns[0].unit.empty()) {
    std::optional<std::string_view> scale;
    for (const std::string_view key : {"gyro_scale", "gyro.scale"})
      if (const auto found = header.find(key); found != header.end()) scale = found->second;
    rate_scale *= gyro_scale(scale, where);
    if (!scale) log.notes.push_back(where + ": states no unit of the gyroscope; degrees a second are assumed");
  } else if (columns[0].unit != "(deg/s)" && columns[0].unit != "(rad/s)") {
    throw InputError(where,
                     "the unit of its gyroscope, '" + columns[0].unit.substr(0, 40) + "', is not (deg/s) or (rad/s)");
  }
  std::vector<double> lengths;
  double last_us = 0.0, first_us = 0.0;
  std::size_t out_of_order = 0;
  while (const auto line = base::take_line(text)) {
    ++number;
    if (base::trim(*line).empty()) continue;
    const std::string place = where + ":" + std::to_string(number);
    const std::vector<std::string_view> fields = split_at_commas(*line);
    std::array<double, 6> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (columns[i].index >= fields.size()) throw InputError(place, "has too few fields; is it cut off?");
      values[i] = base::require_finite(place, fields[columns[i].index]);
    }
    if (time->index >= fields.size()) throw InputError(place, "has too few fields; is it cut off?");
    const double time_us = base::require_finite(place, fields[time->index]);
    if (log.readings.empty()) first_us = time_us;
    if (!log.readings.empty() && !(time_us > last_us)) {
      ++out_of_order;
      continue;
    }
    last_us = time_us;
    log.readings.push_back({1e-6 * (time_us - first_us), rate_scale * Vec3(values[0], values[1], values[2]),
                            Vec3(values[3], values[4], values[5])});
    lengths.push_back(log.readings.back().specific_force_m_s2.norm());
  }
  if (log.readings.size() < 2) throw InputError(where, "holds fewer than two readings");
  require_accelerometer(lengths, where);
  double force_scale = 1.0;
  if (columns[3].unit == "(g)") {
    force_scale = kOneG_m_s2;
  } else if (columns[3].unit.empty()) {
    const auto stated = header.find("acc_1G");
    const auto one_g = stated == header.end() ? std::nullopt : base::parse_finite_number(stated->second);
    const double used = one_g && *one_g > 0.0 ? *one_g : guess_one_g(lengths, where);
    force_scale = kOneG_m_s2 / used;
    if (!one_g || !(*one_g > 0.0))
      log.notes.push_back(where + base::formatted(": states no acc_1G; %g is assumed, by the readings' length", used));
  } else if (columns[3].unit != "(m/s/s)" && columns[3].unit != "(m/s^2)") {
    throw InputError(where,
                     "the unit of its accelerometer, '" + columns[3].unit.substr(0, 40) + "', is not (g) or (m/s/s)");
  }
  for (geometry::ImuSample& reading : log.readings) reading.specific_force_m_s2 *= force_scale;
  add_axes_note(where, log);
  if (out_of_order > 0)
    log.notes.push_back(where + ": " + std::to_string(out_of_order) + " rows left out: their times do not increase");
  return log;
}

}  // namespace tileflight::flight_logs
