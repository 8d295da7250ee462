// DJI's metadata track (`djmd`): one message of Google's protocol buffers for each frame (protobuf.dev, "Encoding").
// Its fields have numbers, and which number is what depends on the model, which names its definition in the first
// message: field 1, 1, 1, "dvtm_Air3.proto". DJI publishes few definitions. The numbers here are those of
// AdrianEddy/telemetry-parser (DJI's own library and three models) and of ExifTool's tag tables (DJI, Protobuf), of
// which DJI's own count where the two differ: the vehicle's attitude is pitch, roll, yaw in DJI's library, and roll,
// pitch, yaw in ExifTool.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <span>
#include <string_view>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"

namespace tileflight::flight_logs {
namespace {

using Bytes = std::span<const std::byte>;

/// A field of a message.
struct WireField {
  std::uint64_t number = 0;
  std::uint64_t value = 0;  ///< of a number; its bits where it is a float or double
  Bytes bytes;              ///< of a message, a text or packed numbers
  bool is_bytes = false;
};

/// The fields of a message, in their order.
class WireReader {
 public:
  explicit WireReader(Bytes bytes) : rest_(bytes) {}

  /// The next field; nullopt at the end, and where the bytes are damaged or cut.
  std::optional<WireField> next() {
    enum WireType { kVarint = 0, kEightBytes = 1, kLength = 2, kFourBytes = 5 };
    if (rest_.empty()) return std::nullopt;
    damaged_ = true;
    const std::optional<std::uint64_t> tag = take_varint();
    if (!tag || *tag >> 3U == 0) return std::nullopt;
    WireField field{.number = *tag >> 3U, .bytes = {}};
    std::optional<std::uint64_t> value;
    switch (*tag & 7U) {
      case kVarint:
        value = take_varint();
        break;
      case kEightBytes:
        value = take_fixed<std::uint64_t>();
        break;
      case kFourBytes:
        value = take_fixed<std::uint32_t>();
        break;
      case kLength:
        value = take_varint();
        if (!value || *value > rest_.size()) return std::nullopt;
        field.is_bytes = true;
        field.bytes = rest_.first(static_cast<std::size_t>(*value));
        rest_ = rest_.subspan(field.bytes.size());
        break;
      default:
        return std::nullopt;
    }
    if (!value) return std::nullopt;
    field.value = *value;
    damaged_ = false;
    return field;
  }
  bool is_damaged() const { return damaged_; }

  /// A number of seven bits a byte, the lowest first, at most ten bytes.
  std::optional<std::uint64_t> take_varint() {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < 10 && i < rest_.size(); ++i) {
      const auto byte = std::to_integer<std::uint64_t>(rest_[i]);
      value |= (byte & 0x7FU) << (7 * i);
      if ((byte & 0x80U) != 0) continue;
      rest_ = rest_.subspan(i + 1);
      return value;
    }
    return std::nullopt;
  }

 private:
  template <class Number>
  std::optional<std::uint64_t> take_fixed() {
    if (rest_.size() < sizeof(Number)) return std::nullopt;
    const auto value = base::read_raw<Number>(rest_, 0);
    rest_ = rest_.subspan(sizeof(Number));
    return value;
  }

  Bytes rest_;
  bool damaged_ = false;
};

using FieldPath = std::initializer_list<std::uint64_t>;

/// The last field of a message with the number, which is the one that counts.
std::optional<WireField> find_field(Bytes message, std::uint64_t number) {
  std::optional<WireField> found;
  WireReader fields(message);
  while (const auto field = fields.next()) {
    if (field->number == number) found = field;
  }
  return found;
}

/// The field at a path of numbers, through the messages that hold it.
std::optional<WireField> find_field(Bytes message, std::span<const std::uint64_t> path) {
  std::optional<WireField> found;
  for (const std::uint64_t number : path) {
    if (found && !found->is_bytes) return std::nullopt;
    found = find_field(found ? found->bytes : message, number);
    if (!found) return std::nullopt;
  }
  return found;
}

std::optional<WireField> find_field(Bytes message, FieldPath path) {
  return find_field(message, std::span(path.begin(), path.size()));
}

/// A message at the path; nullopt if it is missing.
std::optional<Bytes> find_message(Bytes message, FieldPath path) {
  const auto field = find_field(message, path);
  return field && field->is_bytes ? std::optional(field->bytes) : std::nullopt;
}

/// A field's number, which is 0 where it is missing, as protocol buffers leave out zeros. DJI writes negative numbers
/// of 32 bits in several widths; the lower 32 bits are the number.
std::int32_t integer_of(Bytes message, std::uint64_t number) {
  const auto field = find_field(message, number);
  return field ? static_cast<std::int32_t>(static_cast<std::uint32_t>(field->value)) : 0;
}
double double_of(Bytes message, std::uint64_t number) {
  const auto field = find_field(message, number);
  return field ? std::bit_cast<double>(field->value) : 0.0;
}
double float_of(const WireField& field) {
  return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(field.value)));
}

/// The quotient of the first two numbers of a repeated field, whose numbers stand together in its bytes; nullopt if
/// there are no two, or the second is 0.
std::optional<double> find_quotient(Bytes message, std::span<const std::uint64_t> path) {
  const auto field = find_field(message, path);
  if (!field || !field->is_bytes) return std::nullopt;
  WireReader numbers(field->bytes);
  const auto numerator = numbers.take_varint(), denominator = numbers.take_varint();
  if (!numerator || !denominator || *denominator == 0) return std::nullopt;
  return static_cast<double>(*numerator) / static_cast<double>(*denominator);
}

std::optional<double> find_float(Bytes message, std::span<const std::uint64_t> path) {
  const auto field = find_field(message, path);
  return field && !field->is_bytes ? std::optional(float_of(*field)) : std::nullopt;
}

/// Numbers on the way from a message to a field; 0 ends it, and all 0: the model has no such field that is known.
using LayoutPath = std::array<std::uint64_t, 4>;

std::span<const std::uint64_t> path_of(const LayoutPath& path) {
  const auto* const end = std::ranges::find(path, std::uint64_t{0});
  return {path.begin(), static_cast<std::size_t>(end - path.begin())};
}

/// Holds the numbers of the fields in which a model stores its values.
struct DjiLayout {
  std::string_view proto;  ///< the definition's name without "dvtm_" and ".proto"
  std::string_view model;
  std::string_view other_proto{};  ///< a second name of the same definition
  LayoutPath attitude{};           ///< of the vehicle: pitch, roll, yaw in tenths of degrees
  LayoutPath position{};           ///< coordinates, height in millimetres, status, kind of height, time
  LayoutPath above_takeoff{};      ///< millimetres, a float, and whether it is valid, which is not used
  LayoutPath gimbal{};             ///< pitch, roll, yaw in tenths of degrees
  LayoutPath exposure{}, gain{};   ///< a quotient of seconds; ISO, a float
  LayoutPath focal_length{};       ///< a quotient of millimetres
  LayoutPath digital_zoom{};       ///< a float
  bool has_degrees = false;        ///< coordinates are in degrees although their unit says radians
};

constexpr DjiLayout kLayouts[] = {
    {.proto = "Mini4_Pro",
     .model = "Mini 4 Pro",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 10, 1},
     .gain = {3, 2, 7, 1}},
    {.proto = "Mini5Pro", .model = "Mini 5 Pro", .position = {3, 3, 4}, .has_degrees = true},
    {.proto = "Air3",
     .model = "Air 3",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 10, 1},
     .gain = {3, 2, 7, 1}},
    {.proto = "Air3s",
     .model = "Air 3S",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 10, 1},
     .gain = {3, 2, 7, 1}},
    {.proto = "wm265e",
     .model = "Mavic 3",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 3, 1},
     .gain = {3, 2, 2, 1},
     .digital_zoom = {3, 2, 6, 1}},
    {.proto = "wm261",
     .model = "Mavic 3 Pro",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 10, 1},
     .gain = {3, 2, 9, 1}},
    {.proto = "Mavic4",
     .model = "Mavic 4 Pro",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .exposure = {3, 2, 10, 1},
     .gain = {3, 2, 9, 1},
     .has_degrees = true},
    {.proto = "pm320",
     .model = "Matrice 30",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3},
     .exposure = {3, 2, 3, 1},
     .gain = {3, 2, 2, 1},
     .digital_zoom = {3, 2, 6, 1}},
    {.proto = "wa345e",
     .model = "Matrice 4E",
     .attitude = {3, 3, 3},
     .position = {3, 3, 4},
     .above_takeoff = {3, 3, 5},
     .gimbal = {3, 4, 3}},
    {.proto = "AVATA2",
     .model = "Avata 2",
     .attitude = {3, 4, 3},
     .position = {3, 4, 4},
     .above_takeoff = {3, 4, 5},
     .exposure = {3, 2, 4, 1},
     .gain = {3, 2, 2, 1}},
    {.proto = "dji_neo",
     .model = "Neo",
     .attitude = {3, 4, 3},
     .position = {3, 4, 4},
     .exposure = {3, 2, 4, 1},
     .gain = {3, 2, 2, 1}},
    {.proto = "eagle4_wa530",
     .model = "WA530",
     .other_proto = "wa530",
     .attitude = {3, 4, 3},
     .position = {3, 4, 4},
     .above_takeoff = {3, 4, 5},
     .exposure = {3, 2, 4, 1},
     .gain = {3, 2, 3, 1},
     .focal_length = {3, 2, 10, 1},
     .digital_zoom = {3, 2, 5, 1}},
    {.proto = "wm169",
     .model = "O3 air unit",
     .exposure = {3, 2, 4, 1},
     .gain = {3, 2, 3, 1},
     .digital_zoom = {3, 2, 5, 1}},
    {.proto = "ac203", .model = "Osmo Action 4", .position = {3, 4, 2}, .exposure = {3, 2, 4, 1}, .gain = {3, 2, 2, 1}},
    {.proto = "ac204", .model = "Osmo Action 5", .position = {3, 4, 2}, .exposure = {3, 2, 4, 1}},
    {.proto = "ac206", .model = "Osmo Action 6", .position = {3, 4, 2}, .exposure = {3, 2, 4, 1}},
    {.proto = "oq101", .model = "Osmo 360", .position = {3, 4, 2}, .exposure = {3, 2, 4, 1}, .gain = {3, 2, 3, 1}},
    {.proto = "PP-101", .model = "Osmo Pocket 3", .exposure = {3, 2, 10, 1}, .gain = {3, 2, 9, 1}},
};

/// Yaw, pitch and roll of a message of tenths of degrees: pitch, roll, yaw.
struct EulerAngles {
  std::optional<double> yaw_deg, pitch_deg, roll_deg;
};

EulerAngles angles_of(Bytes frame, const LayoutPath& path) {
  constexpr double kTenths = 0.1;
  constexpr std::uint64_t kPitch = 1, kRoll = 2, kYaw = 3;
  if (path_of(path).empty()) return {};
  const auto angles = find_field(frame, path_of(path));
  if (!angles || !angles->is_bytes) return {};
  return {kTenths * integer_of(angles->bytes, kYaw), kTenths * integer_of(angles->bytes, kPitch),
          kTenths * integer_of(angles->bytes, kRoll)};
}

/// Kinds of heights (`gps_altitude_type`): by the barometer, and two above the ellipsoid.
enum HeightKind : std::int32_t { kPressureHeight = 0, kFusedHeight = 1, kRtkHeight = 2 };

/// A frame's position as its receiver states it.
struct ReceiverState {
  TelemetryFix fix;
  std::int32_t height_kind = kPressureHeight;
  std::string utc;  ///< "2025-06-01 12-30-15", if it is stated
};

/// nullopt if the frame has no position, or the receiver says that it is none.
std::optional<ReceiverState> receiver_state(Bytes frame, const DjiLayout& layout) {
  constexpr std::uint64_t kCoordinates = 1, kHeight = 2, kStatus = 3, kKind = 4, kHasTime = 5, kTime = 6;
  constexpr std::uint64_t kUnit = 1, kLatitude = 2, kLongitude = 3;
  constexpr std::int32_t kInvalid = 1, kUnitIsDegrees = 1;
  const auto position = find_field(frame, path_of(layout.position));
  if (!position || !position->is_bytes || integer_of(position->bytes, kStatus) == kInvalid) return std::nullopt;
  const auto coordinates = find_message(position->bytes, {kCoordinates});
  if (!coordinates) return std::nullopt;
  const bool has_degrees = layout.has_degrees || integer_of(*coordinates, kUnit) == kUnitIsDegrees;
  const double unit = has_degrees ? 1.0 : 1.0 / geometry::kRadiansPerDegree;
  ReceiverState state;
  state.fix.latitude_deg = unit * double_of(*coordinates, kLatitude);
  state.fix.longitude_deg = unit * double_of(*coordinates, kLongitude);
  if (!std::isfinite(state.fix.latitude_deg) || !std::isfinite(state.fix.longitude_deg)) return std::nullopt;
  state.fix.absolute_height_m = 1e-3 * integer_of(position->bytes, kHeight);
  state.height_kind = integer_of(position->bytes, kKind);
  if (const auto time = find_message(position->bytes, {kTime, 1}); time && integer_of(position->bytes, kHasTime) != 0)
    state.utc = std::string(base::as_text(*time));
  return state;
}

/// "2025-06-01 12-30-15" as Unix time.
std::optional<double> utc_of(std::string text) {
  constexpr std::size_t kDay = 10;
  if (text.size() > kDay) std::replace(text.begin() + kDay, text.end(), '-', ':');
  return base::parse_iso_time_s(text);
}

/// Adds up what the frames say.
class FrameCollector {
 public:
  explicit FrameCollector(const DjiLayout& layout) : layout_(layout) {}

  void add(double time_s, Bytes message) {
    if (!std::isfinite(time_s) || is_damaged(message)) {
      ++damaged_;
      return;
    }
    add_exposure(time_s, message);
    add_zoom(time_s, message);
    if (!path_of(layout_.position).empty()) add_position(time_s, message);
  }

  Telemetry finish() && {
    Telemetry telemetry = std::move(filter_).finish();
    telemetry.exposures = std::move(exposures_);
    telemetry.zooms = std::move(zooms_);
    telemetry.zero_utc_s = zero_utc_s_;
    telemetry.device = "DJI " + std::string(layout_.model);
    if (damaged_ > 0)
      telemetry.warnings.push_back(std::to_string(damaged_) + " frames of the metadata track are damaged and left out");
    if (height_kind_ && !has_mixed_heights_ && (*height_kind_ == kFusedHeight || *height_kind_ == kRtkHeight))
      telemetry.height_datum = HeightDatum::kEllipsoid;
    if (has_mixed_heights_)
      telemetry.warnings.emplace_back(
          "the heights change between the barometer's and those above the ellipsoid, so their reference is not known");
    return telemetry;
  }

 private:
  /// Returns whether a message or the message of the frame in it cannot be read to its end.
  static bool is_damaged(Bytes message) {
    constexpr std::uint64_t kFrame = 3;
    WireReader fields(message);
    while (const auto field = fields.next()) {
      if (field->number != kFrame || !field->is_bytes) continue;
      WireReader inner(field->bytes);
      while (inner.next()) {
      }
      if (inner.is_damaged()) return true;
    }
    return fields.is_damaged();
  }

  void add_exposure(double time_s, Bytes message) {
    const auto exposure_s = find_quotient(message, path_of(layout_.exposure));
    const bool is_later = exposures_.empty() || time_s > exposures_.back().time_s;
    if (!exposure_s || !(*exposure_s > 0.0) || !is_later) return;
    ExposureReading reading{time_s, *exposure_s, {}};
    if (const auto gain = find_float(message, path_of(layout_.gain)); gain && std::isfinite(*gain) && *gain > 0.0)
      reading.gain = gain;
    exposures_.push_back(reading);
  }

  void add_zoom(double time_s, Bytes message) {
    ZoomReading zoom{.time_s = time_s, .where = base::formatted("%.2f s", time_s)};
    zoom.focal_length = find_quotient(message, path_of(layout_.focal_length));
    zoom.digital_zoom = find_float(message, path_of(layout_.digital_zoom));
    if (zoom.focal_length || zoom.digital_zoom) zooms_.push_back(std::move(zoom));
  }

  void add_position(double time_s, Bytes message) {
    std::optional<ReceiverState> state = receiver_state(message, layout_);
    if (!state) {
      filter_.drop_without_fix();
      return;
    }
    TelemetryFix& fix = state->fix;
    fix.time_s = time_s;
    fix.height_above_takeoff_m = height_above_takeoff_m(message);
    const EulerAngles body = angles_of(message, layout_.attitude), gimbal = angles_of(message, layout_.gimbal);
    fix.body_yaw_deg = body.yaw_deg, fix.body_pitch_deg = body.pitch_deg, fix.body_roll_deg = body.roll_deg;
    fix.gimbal_yaw_deg = gimbal.yaw_deg, fix.gimbal_pitch_deg = gimbal.pitch_deg, fix.gimbal_roll_deg = gimbal.roll_deg;
    filter_.add(fix);
    if (fix.latitude_deg == 0.0 && fix.longitude_deg == 0.0) return;
    has_mixed_heights_ =
        has_mixed_heights_ || (height_kind_ && is_ellipsoidal(*height_kind_) != is_ellipsoidal(state->height_kind));
    height_kind_ = state->height_kind;
    if (const auto utc_s = utc_of(state->utc); utc_s && !zero_utc_s_) zero_utc_s_ = *utc_s - time_s;
  }

  std::optional<double> height_above_takeoff_m(Bytes message) const {
    static constexpr std::uint64_t kMillimetres[] = {1};
    if (path_of(layout_.above_takeoff).empty()) return std::nullopt;
    const auto height = find_field(message, path_of(layout_.above_takeoff));
    if (!height || !height->is_bytes) return std::nullopt;
    const double above_mm = find_float(height->bytes, kMillimetres).value_or(0.0);
    return std::isfinite(above_mm) ? std::optional(1e-3 * above_mm) : std::nullopt;
  }

  static bool is_ellipsoidal(std::int32_t kind) { return kind == kFusedHeight || kind == kRtkHeight; }

  const DjiLayout& layout_;
  FixFilter filter_;
  std::vector<ExposureReading> exposures_;
  std::vector<ZoomReading> zooms_;
  std::optional<double> zero_utc_s_;
  std::optional<std::int32_t> height_kind_;
  bool has_mixed_heights_ = false;
  std::size_t damaged_ = 0;
};

/// A name of foreign bytes for a message: its visible characters of ASCII.
std::string shown(std::string_view text) {
  std::string visible;
  for (const char c : text) visible += c >= ' ' && c <= '~' ? c : '?';
  return visible;
}

/// A text that the header of one of the first samples states: its field 1 is the definition's name,
/// "dvtm_Air3.proto", and 10 the product's. Empty if none does.
std::string header_text(std::span<const base::TimedBytes> samples, std::uint64_t number) {
  constexpr std::size_t kFirst = 10, kLongest = 64;
  for (const base::TimedBytes& sample : samples.first(std::min(samples.size(), kFirst))) {
    const auto text = find_message(sample.bytes, {1, 1, number});
    if (text && !text->empty() && text->size() <= kLongest) return shown(base::as_text(*text));
  }
  return "";
}

/// nullptr if the definition is not known.
const DjiLayout* find_layout(std::string_view proto) {
  std::string_view name = proto;
  base::take_prefix(name, "dvtm_");
  if (name.ends_with(".proto")) name.remove_suffix(6);
  const std::string lower = base::to_lower(name);
  const auto* const found = std::ranges::find_if(kLayouts, [&](const DjiLayout& layout) {
    return base::to_lower(layout.proto) == lower || (!layout.other_proto.empty() && layout.other_proto == lower);
  });
  return found == std::end(kLayouts) ? nullptr : found;
}

}  // namespace

Telemetry read_dji_metadata(std::span<const base::TimedBytes> samples, const MetadataSource& source) {
  constexpr std::uint64_t kProto = 1, kProduct = 10;
  const std::string proto = header_text(samples, kProto);
  if (proto.empty())
    throw InputError(source.where,
                     "its metadata track (djmd) does not name its definition, so its fields are not known");
  const DjiLayout* const layout = find_layout(proto);
  if (layout == nullptr)
    throw InputError(source.where, "its metadata track (djmd) is defined by " + proto +
                                       ", whose fields are not known; give the .srt that was recorded beside it");
  FrameCollector frames(*layout);
  for (const base::TimedBytes& sample : samples) frames.add(sample.begin_s, sample.bytes);
  Telemetry telemetry = std::move(frames).finish();
  drop_unrecorded_heights(telemetry);
  if (const std::string product = header_text(samples, kProduct); !product.empty()) telemetry.device = product;
  if (telemetry.fixes.empty() && telemetry.exposures.empty() && telemetry.zooms.empty())
    throw InputError(source.where,
                     "its metadata track (djmd, " + proto + ") holds nothing that can be read" +
                         (telemetry.warnings.empty() ? "" : " (" + base::joined(telemetry.warnings, "; ") + ")"));
  return telemetry;
}

}  // namespace tileflight::flight_logs
