#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/timed_rows.h"

// ULog: a header of 16 bytes, then messages of 3 + size bytes: u16 size, one letter, payload; all little-endian.
// No length in the file is trusted: each read is bounded by its message, each message by its section.

namespace tileflight::flight_logs {

namespace {

/// Fields to read from a ULog topic, by name; array elements as "q[0]".
using UlogFields = std::vector<std::string>;

/// Topics by name: one row of numbers per message in file order, in the order of the requested fields, NaN for fields
/// that the file's format of the topic lacks.
struct UlogTopics {
  std::map<std::string, std::vector<std::vector<double>>> rows;
  std::vector<std::string> warnings;
};

static_assert(std::endian::native == std::endian::little);

using Bytes = std::span<const std::byte>;

constexpr std::size_t kHeaderBytes = 16;
constexpr std::size_t kULogMessageHeaderBytes = 3;
constexpr std::size_t kLargestMessage = 65535;
constexpr std::string_view kULogMagic("ULog\x01\x12\x35", 7);
constexpr std::string_view kLetters = "BFIMPQARDLCSO";
/// A complete synchronization message: size, letter, eight fixed bytes.
constexpr std::string_view kSync("\x08\x00S\x2F\x73\x13\x20\x25\x0C\xBB\x12", 11);

/// One of ULog's basic types: its size and decoding.
struct BasicType {
  std::string_view name;
  std::size_t bytes;
  double (*read)(Bytes bytes, std::size_t offset);
};

template <typename T>
double ulog_number_at(Bytes bytes, std::size_t offset) {
  return static_cast<double>(base::read_raw<T>(bytes, offset));
}

constexpr BasicType kBasicTypes[] = {
    {"int8_t", 1, ulog_number_at<std::int8_t>},   {"uint8_t", 1, ulog_number_at<std::uint8_t>},
    {"int16_t", 2, ulog_number_at<std::int16_t>}, {"uint16_t", 2, ulog_number_at<std::uint16_t>},
    {"int32_t", 4, ulog_number_at<std::int32_t>}, {"uint32_t", 4, ulog_number_at<std::uint32_t>},
    {"int64_t", 8, ulog_number_at<std::int64_t>}, {"uint64_t", 8, ulog_number_at<std::uint64_t>},
    {"float", 4, ulog_number_at<float>},          {"double", 8, ulog_number_at<double>},
    {"bool", 1, ulog_number_at<std::uint8_t>},    {"char", 1, ulog_number_at<std::uint8_t>},
};

const BasicType* basic_type(std::string_view name) {
  const auto found = std::find_if(std::begin(kBasicTypes), std::end(kBasicTypes),
                                  [&](const BasicType& type) { return type.name == name; });
  return found == std::end(kBasicTypes) ? nullptr : found;
}

/// `type name` or `type[count] name` of a format message.
struct Field {
  std::string type, name;
  std::size_t count = 1;
};

std::optional<Field> parse_field(std::string_view text) {
  const std::size_t blank = text.find(' ');
  if (blank == std::string_view::npos || blank == 0) return std::nullopt;
  std::string_view type = text.substr(0, blank);
  Field field{.type = "", .name = std::string(text.substr(blank + 1))};
  const std::size_t bracket = type.find('[');
  if (bracket != std::string_view::npos) {
    std::string_view count = type.substr(bracket + 1);
    const std::optional<int> number = base::take_digits(count);
    if (!number || count != "]") return std::nullopt;
    field.count = static_cast<std::size_t>(*number);
    type = type.substr(0, bracket);
  }
  field.type = std::string(type);
  return field;
}

/// `topic:field;field;`
struct MessageFormat {
  std::string topic;
  std::vector<Field> fields;
};

std::optional<MessageFormat> parse_format(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  MessageFormat format{.topic = std::string(text.substr(0, colon)), .fields = {}};
  text.remove_prefix(colon + 1);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(';'), text.size());
    const std::optional<Field> field = parse_field(text.substr(0, end));
    if (!field) return std::nullopt;
    format.fields.push_back(*field);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return format;
}

/// Position of a wanted number in a message's data.
struct ULogFieldLocation {
  std::size_t offset = 0;
  const BasicType* type = nullptr;  ///< nullptr: the format has no such field
};

class ULogReader {
 public:
  ULogReader(Bytes bytes, const std::map<std::string, UlogFields>& requested, std::string where)
      : bytes_(bytes), requested_(requested), where_(std::move(where)) {}

  UlogTopics read() {
    check_header();
    std::vector<std::size_t> ends = appended_offsets();
    ends.push_back(bytes_.size());
    std::size_t begin = kHeaderBytes;
    for (const std::size_t end : ends) {
      read_section(begin, end, end == bytes_.size());
      begin = end;
    }
    describe();
    return std::move(topics_);
  }

 private:
  void check_header() const {
    if (!base::as_text(bytes_).starts_with(kULogMagic))
      throw InputError(where_, "is not a ULog file: it does not start with 'ULog'");
    if (bytes_.size() < kHeaderBytes) throw InputError(where_, "is truncated within the header; copy the log again");
  }

  /// Reads the flag bits, which can only be the first message: offsets of appended data sections, for instance after a
  /// crash in the middle of a message.
  std::vector<std::size_t> appended_offsets() const {
    constexpr std::size_t kFlagBytes = 40;
    if (bytes_.size() < kHeaderBytes + kULogMessageHeaderBytes + kFlagBytes) return {};
    const Bytes message = bytes_.subspan(kHeaderBytes);
    if (base::read_raw<std::uint16_t>(message, 0) < kFlagBytes || base::read_raw<char>(message, 2) != 'B') return {};
    const Bytes flags = message.subspan(kULogMessageHeaderBytes, kFlagBytes);
    const auto incompatible = base::read_raw<std::uint64_t>(flags, 8);
    if ((incompatible & ~std::uint64_t{1}) != 0) {
      throw InputError(where_, "needs unsupported ULog features (incompatible flags); convert it with pyulog");
    }
    std::vector<std::size_t> offsets;
    for (std::size_t i = 0; i < 3 && incompatible == 1; ++i) {
      const auto offset = base::read_raw<std::uint64_t>(flags, 16 + 8 * i);
      const std::size_t least = offsets.empty() ? kHeaderBytes + kULogMessageHeaderBytes + kFlagBytes : offsets.back();
      if (offset >= least && offset < bytes_.size()) offsets.push_back(static_cast<std::size_t>(offset));
    }
    return offsets;
  }

  void read_section(std::size_t at, std::size_t end, bool is_last) {
    while (at < end) {
      const Bytes rest = bytes_.subspan(at, end - at);
      const std::optional<std::size_t> size = whole_message(rest);
      if (size) {
        handle(base::read_raw<char>(rest, 2), rest.subspan(kULogMessageHeaderBytes, *size - kULogMessageHeaderBytes));
        at += *size;
        continue;
      }
      const std::size_t sync = base::as_text(rest).find(kSync);
      if (sync == std::string_view::npos) {
        cut_ = cut_ || is_last;
        return;
      }
      skipped_bytes_ += sync;
      at += sync;
    }
  }

  /// Size of the message at the front, including its header; nullopt if it is missing or truncated.
  static std::optional<std::size_t> whole_message(Bytes rest) {
    if (rest.size() < kULogMessageHeaderBytes) return std::nullopt;
    const std::size_t size = kULogMessageHeaderBytes + base::read_raw<std::uint16_t>(rest, 0);
    const bool is_known = kLetters.find(base::read_raw<char>(rest, 2)) != std::string_view::npos;
    return is_known && size <= rest.size() ? std::optional(size) : std::nullopt;
  }

  void handle(char letter, Bytes payload) {
    if (letter == 'F') add_format(payload);
    if (letter == 'A') subscribe(payload);
    if (letter == 'D') add_row(payload);
    if (letter == 'O' && payload.size() >= 2) {
      ++dropouts_;
      dropped_ms_ += base::read_raw<std::uint16_t>(payload, 0);
    }
  }

  void add_format(Bytes payload) {
    if (std::optional<MessageFormat> format = parse_format(base::as_text(payload))) {
      formats_.insert_or_assign(format->topic, std::move(format->fields));
    }
  }

  void subscribe(Bytes payload) {
    if (payload.size() <= 3 || base::read_raw<std::uint8_t>(payload, 0) != 0) return;  // instance 0 only
    const auto topic = requested_.find(std::string(base::as_text(payload.subspan(3))));
    if (topic == requested_.end()) return;
    Subscription subscription{.topic = topic->first, .locations = {}};
    for (const std::string& field : topic->second) subscription.locations.push_back(find_field(topic->first, field));
    subscriptions_.insert_or_assign(base::read_raw<std::uint16_t>(payload, 1), std::move(subscription));
  }

  void add_row(Bytes payload) {
    if (payload.size() < 2) return;
    const auto found = subscriptions_.find(base::read_raw<std::uint16_t>(payload, 0));
    if (found == subscriptions_.end()) return;
    const Bytes data = payload.subspan(2);
    std::vector<double> row;
    for (const ULogFieldLocation& place : found->second.locations) {
      const bool is_there = place.type != nullptr && place.offset + place.type->bytes <= data.size();
      row.push_back(is_there ? place.type->read(data, place.offset) : std::numeric_limits<double>::quiet_NaN());
    }
    topics_.rows[found->second.topic].push_back(std::move(row));
  }

  ULogFieldLocation find_field(const std::string& topic, std::string_view requested) const {
    const std::string_view name = requested.substr(0, requested.find('['));
    std::size_t element = 0;
    if (name.size() < requested.size()) {
      std::string_view index = requested.substr(name.size() + 1);
      element = static_cast<std::size_t>(base::take_digits(index).value_or(0));
    }
    const auto format = formats_.find(topic);
    if (format == formats_.end()) return {};
    std::size_t offset = 0;
    int budget = kFieldsLookedAt;
    for (const Field& field : format->second) {
      const BasicType* type = basic_type(field.type);
      if (field.name == name && type != nullptr && element < field.count) return {offset + element * type->bytes, type};
      const std::optional<std::size_t> bytes = bytes_of(field, budget, 0);
      if (!bytes || (offset += *bytes) > kLargestMessage) return {};
    }
    return {};
  }

  /// Size of a field. Formats may nest; depth and work are bounded because a file may nest them in a cycle or
  /// excessively.
  std::optional<std::size_t> bytes_of(const Field& field, int& budget, int depth) const {
    if (--budget < 0 || depth > kDeepestFormat || field.count > kLargestMessage) return std::nullopt;
    if (const BasicType* type = basic_type(field.type)) return field.count * type->bytes;
    const auto format = formats_.find(field.type);
    if (format == formats_.end()) return std::nullopt;
    std::size_t sum = 0;
    for (const Field& inner : format->second) {
      const std::optional<std::size_t> bytes = bytes_of(inner, budget, depth + 1);
      if (!bytes || (sum += *bytes) > kLargestMessage) return std::nullopt;
    }
    return field.count * sum;
  }

  void describe() {
    if (dropouts_ > 0) {
      topics_.warnings.push_back(std::to_string(dropouts_) + " dropouts of the logger, " + std::to_string(dropped_ms_) +
                                 " ms in total");
    }
    if (skipped_bytes_ > 0) {
      topics_.warnings.push_back(std::to_string(skipped_bytes_) + " unreadable bytes skipped");
    }
    if (cut_) topics_.warnings.push_back("the file ends within a message; everything before it is used");
  }

  struct Subscription {
    std::string topic;
    std::vector<ULogFieldLocation> locations;
  };

  static constexpr int kDeepestFormat = 8;
  static constexpr int kFieldsLookedAt = 100000;

  Bytes bytes_;
  const std::map<std::string, UlogFields>& requested_;
  std::string where_;
  std::map<std::string, std::vector<Field>, std::less<>> formats_;
  std::map<std::uint16_t, Subscription> subscriptions_;
  UlogTopics topics_;
  std::size_t dropouts_ = 0, dropped_ms_ = 0, skipped_bytes_ = 0;
  bool cut_ = false;
};

/// Reads the first instance of each wanted topic from a ULog file (docs.px4.io, "ULog File Format", version 1; also
/// appended data). Corrupt sections are skipped up to the next synchronization message, a truncated file is read as far
/// as possible, and the logger's own dropouts are summed; all are reported in `warnings`. Throws InputError (`where`,
/// cause) if the bytes are not a ULog file or need unknown features.
UlogTopics read_ulog_topics(std::span<const std::byte> bytes, const std::map<std::string, UlogFields>& requested,
                            const std::string& where) {
  return ULogReader(bytes, requested, where).read();
}

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kFarthestAttitude_s = 0.2;
constexpr double kULogThreeDimensionalFix = 3;

/// Receiver topics use degrees and metres since PX4 1.14; before, 1e-7 degrees and millimetres.
const UlogFields kReceiverFields = {
    "timestamp", "latitude_deg", "longitude_deg", "altitude_msl_m", "altitude_ellipsoid_m",
    "lat",       "lon",          "alt",           "alt_ellipsoid",  "fix_type"};
const UlogFields kEstimatorFields = {"timestamp", "lat", "lon", "alt", "alt_ellipsoid"};
const UlogFields kAttitudeFields = {"timestamp", "q[0]", "q[1]", "q[2]", "q[3]"};

/// One position; missing numbers are NaN.
struct ULogPosition {
  double time_s, latitude_deg, longitude_deg, sea_level_m, ellipsoid_m;
  bool has_fix;
};

ULogPosition ulog_receiver_position(const std::vector<double>& row) {
  const bool has_degrees = !std::isnan(row[1]);
  return {.time_s = 1e-6 * row[0],
          .latitude_deg = has_degrees ? row[1] : 1e-7 * row[5],
          .longitude_deg = has_degrees ? row[2] : 1e-7 * row[6],
          .sea_level_m = has_degrees ? row[3] : 1e-3 * row[7],
          .ellipsoid_m = has_degrees ? row[4] : 1e-3 * row[8],
          .has_fix = !(row[9] < kULogThreeDimensionalFix)};
}

ULogPosition ulog_estimator_position(const std::vector<double>& row) {
  return {.time_s = 1e-6 * row[0],
          .latitude_deg = row[1],
          .longitude_deg = row[2],
          .sea_level_m = row[3],
          .ellipsoid_m = row[4],
          .has_fix = true};
}

bool is_usable_ulog_position(const ULogPosition& p) {
  return p.has_fix && std::isfinite(p.time_s) && std::isfinite(p.latitude_deg) && std::isfinite(p.longitude_deg);
}

/// Positions of the first topic that holds a fix; else of the last one with data.
std::vector<ULogPosition> ulog_positions(const UlogTopics& topics) {
  std::vector<ULogPosition> positions;
  for (const char* name : {"vehicle_gps_position", "sensor_gps", "vehicle_global_position"}) {
    const auto found = topics.rows.find(name);
    if (found == topics.rows.end()) continue;
    const bool is_estimate = found->first == "vehicle_global_position";
    positions.clear();
    std::transform(found->second.begin(), found->second.end(), std::back_inserter(positions),
                   is_estimate ? ulog_estimator_position : ulog_receiver_position);
    if (std::any_of(positions.begin(), positions.end(), is_usable_ulog_position)) break;
  }
  return positions;
}

/// Drivers and simulators without a geoid leave the field at 0, or copy the other height into it.
bool has_ellipsoidal_heights(const std::vector<ULogPosition>& positions) {
  return std::any_of(positions.begin(), positions.end(), [](const ULogPosition& p) {
    return std::isfinite(p.ellipsoid_m) && p.ellipsoid_m != 0.0 && p.ellipsoid_m != p.sea_level_m;
  });
}

/// Yaw, pitch and roll of a body (axes forward, right, down) in north, east, down, from its unit quaternion w, x, y, z
/// (Diebel, "Representing Attitude", 2006, section 5.6, sequence 1, 2, 3).
void set_attitude(TelemetryFix& fix, const std::vector<double>& row) {
  const double norm = std::hypot(std::hypot(row[1], row[2]), std::hypot(row[3], row[4]));
  if (!(norm > 0.5) || !std::isfinite(norm)) return;
  const double w = row[1] / norm, x = row[2] / norm, y = row[3] / norm, z = row[4] / norm;
  fix.body_yaw_deg = kDegrees * std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
  fix.body_pitch_deg = kDegrees * std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0));
  fix.body_roll_deg = kDegrees * std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y));
}

/// Angular rates as filtered for the controller, else the sensor's.
std::vector<BodyRate> body_rates(const UlogTopics& topics) {
  const LogRows& filtered = find_rows(topics.rows, "vehicle_angular_velocity");
  return to_body_rates(filtered.empty() ? find_rows(topics.rows, "sensor_combined") : filtered, 1e-6);
}

FixFilter filtered(const std::vector<ULogPosition>& positions, bool ellipsoidal, const LogRows& attitudes) {
  FixFilter filter;
  for (const ULogPosition& position : positions) {
    if (!is_usable_ulog_position(position)) {
      filter.drop_without_fix();
      continue;
    }
    TelemetryFix fix;
    fix.time_s = position.time_s;
    fix.latitude_deg = position.latitude_deg;
    fix.longitude_deg = position.longitude_deg;
    const double height_m = ellipsoidal ? position.ellipsoid_m : position.sea_level_m;
    if (std::isfinite(height_m)) fix.absolute_height_m = height_m;
    if (const auto* row = nearest_in_time(attitudes, 1e6 * fix.time_s, 1e6 * kFarthestAttitude_s))
      set_attitude(fix, *row);
    filter.add(fix);
  }
  return filter;
}

}  // namespace

Telemetry read_ulog(const std::filesystem::path& file) {
  const std::map<std::string, UlogFields> requested = {
      {"vehicle_gps_position", kReceiverFields},
      {"sensor_gps", kReceiverFields},
      {"vehicle_global_position", kEstimatorFields},
      {"vehicle_attitude", kAttitudeFields},
      {"vehicle_angular_velocity", {"timestamp", "xyz[0]", "xyz[1]", "xyz[2]"}},
      {"sensor_combined", {"timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"}}};
  const std::vector<std::byte> bytes = base::read_bytes(file, base::kMaxLogBytes);
  const UlogTopics topics = read_ulog_topics(bytes, requested, file.string());
  const std::vector<ULogPosition> positions = ulog_positions(topics);
  const bool ellipsoidal = has_ellipsoidal_heights(positions);
  Telemetry telemetry = filtered(positions, ellipsoidal, sort_by_time(find_rows(topics.rows, "vehicle_attitude")))
                            .finish(file.string(), "position messages", topics.warnings);
  telemetry.warnings.insert(telemetry.warnings.end(), topics.warnings.begin(), topics.warnings.end());
  telemetry.body_rates = body_rates(topics);
  rebase_to_first_fix(telemetry);
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  return telemetry;
}

}  // namespace tileflight::flight_logs
