// Telemetry logs of ground stations (.tlog): before each MAVLink frame, its time of arrival as microseconds since 1970,
// eight bytes, the highest first
// (https://ardupilot.org/copter/docs/common-downloading-and-analyzing-data-logs-in-mission-planner.html). Frames:
// https://mavlink.io/en/guide/serialization.html; messages: https://mavlink.io/en/messages/common.html.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <string_view>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/timed_rows.h"

namespace tileflight::flight_logs {

namespace {

constexpr std::size_t kStampBytes = 8;

struct KnownMessage {
  std::uint32_t number;
  std::uint8_t crc_extra;  ///< seed of its checksum
  std::size_t bytes;       ///< payload; MAVLink 2 leaves out zeros at the end
};
constexpr KnownMessage kAttitude{30, 39, 28}, kGlobalPosition{33, 104, 28};

/// A frame of MAVLink 1 or 2 at the front of `bytes`.
struct TlogFrame {
  std::size_t bytes = 0;  ///< 0: there is none
  std::uint8_t system = 0;
  std::uint32_t message = 0;
  std::string_view payload;
  std::string_view checked;  ///< what the checksum is of, without the seed
  std::uint16_t checksum = 0;
};

unsigned tlog_byte(std::string_view bytes, std::size_t at) { return static_cast<unsigned char>(bytes[at]); }

TlogFrame tlog_frame(std::string_view bytes) {
  constexpr std::size_t kHead1 = 6, kHead2 = 10, kSignature = 13;
  if (bytes.size() < kHead2 + 2) return {};
  const bool second = tlog_byte(bytes, 0) == 0xFD;
  if (!second && tlog_byte(bytes, 0) != 0xFE) return {};
  const std::size_t head = second ? kHead2 : kHead1, length = tlog_byte(bytes, 1);
  const bool is_signed = second && (tlog_byte(bytes, 2) & 1U) != 0;
  TlogFrame frame;
  const std::size_t end = head + length;
  if (bytes.size() < end + 2) return {};
  frame.bytes = end + 2 + (is_signed ? kSignature : 0);
  frame.system = static_cast<std::uint8_t>(tlog_byte(bytes, second ? 5 : 3));
  frame.message =
      second ? tlog_byte(bytes, 7) | tlog_byte(bytes, 8) << 8U | tlog_byte(bytes, 9) << 16U : tlog_byte(bytes, 5);
  frame.payload = bytes.substr(head, length);
  frame.checked = bytes.substr(1, end - 1);
  frame.checksum = static_cast<std::uint16_t>(tlog_byte(bytes, end) | tlog_byte(bytes, end + 1) << 8U);
  return frame;
}

bool is_intact(const TlogFrame& frame, const KnownMessage& message) {
  const char extra = static_cast<char>(message.crc_extra);
  return base::crc16_mcrf4xx({&extra, 1}, base::crc16_mcrf4xx(frame.checked)) == frame.checksum;
}

/// Microseconds since 1970.
std::uint64_t stamp_us(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < kStampBytes; ++i) value = value << 8U | tlog_byte(bytes, i);
  return value;
}

/// From 2001 to 2100.
bool is_stamp(std::string_view bytes) {
  constexpr std::uint64_t kFirst_us = 978'307'200'000'000, kLast_us = 4'102'444'800'000'000;
  const std::uint64_t time_us = stamp_us(bytes);
  return time_us > kFirst_us && time_us < kLast_us;
}

/// A message's payload with the zeros that were left out.
class TlogPayload {
 public:
  TlogPayload(std::string_view bytes, std::size_t size) : bytes_(bytes) { bytes_.resize(size, '\0'); }
  template <class Number>
  double at(std::size_t place) const {
    Number value{};
    std::memcpy(&value, bytes_.data() + place, sizeof value);
    return static_cast<double>(value);
  }

 private:
  std::string bytes_;
};

/// A position on the clock of the vehicle's first start.
struct TlogPosition {
  TelemetryFix fix;
  std::size_t start = 0;  ///< how often the vehicle had restarted

  /// Returns the height of the vehicle's home above sea level.
  double home_m() const { return *fix.absolute_height_m - *fix.height_above_takeoff_m; }
};

class TlogReader {
 public:
  void read(std::string_view bytes) {
    while (bytes.size() > kStampBytes) {
      const TlogFrame frame = is_stamp(bytes) ? tlog_frame(bytes.substr(kStampBytes)) : TlogFrame{};
      if (frame.bytes == 0 || kStampBytes + frame.bytes > bytes.size()) {
        ++skipped_bytes_;
        bytes.remove_prefix(1);
        continue;
      }
      take(static_cast<double>(stamp_us(bytes)) * 1e-6, frame);
      bytes.remove_prefix(kStampBytes + frame.bytes);
    }
    skipped_bytes_ += bytes.size();
  }

  Telemetry finish(const std::string& where) && {
    const bool had_no_home = remove_heights_without_home();
    const LogRows attitudes = sort_by_time(attitudes_);
    constexpr double kFarthestAttitude_s = 0.2;
    FixFilter filter;
    for (const TlogPosition& position : positions_) {
      TelemetryFix fix = position.fix;
      if (const auto* row = nearest_in_time(attitudes, fix.time_s, kFarthestAttitude_s)) {
        constexpr double kDegrees = 180.0 / std::numbers::pi;
        fix.body_roll_deg = kDegrees * (*row)[1];
        fix.body_pitch_deg = kDegrees * (*row)[2];
        fix.body_yaw_deg = kDegrees * (*row)[3];
      }
      filter.add(fix);
    }
    std::vector<std::string> damage;
    const auto name = [&damage](std::uint64_t count, const std::string& what) {
      if (count > 0) damage.push_back(std::to_string(count) + " " + what);
    };
    name(skipped_bytes_, "bytes of the file are no part of a message and are skipped");
    name(wrong_checksums_, "messages dropped: their checksum is wrong");
    Telemetry telemetry = std::move(filter).finish(where, "messages GLOBAL_POSITION_INT", damage);
    if (had_no_home) {
      telemetry.warnings.emplace_back(
          "heights before the vehicle knew its home are not above sea level and are not used");
      drop_fixes_without_height(telemetry);
    }
    if (restarts_ > 0) {
      telemetry.warnings.push_back("the vehicle restarted " + std::to_string(restarts_) +
                                   (restarts_ == 1 ? " time" : " times") +
                                   ": its clock is continued by the ground station's");
    }
    telemetry.body_rates = to_body_rates(rates_, 1.0);
    telemetry.zero_utc_s = utc_of_boot_s_ + telemetry.fixes.front().time_s;
    rebase_to_first_fix(telemetry);
    telemetry.height_datum = HeightDatum::kMeanSeaLevel;
    if (other_systems_ > 0)
      name(other_systems_,
           "positions of other vehicles are not used; those of system " + std::to_string(*system_) + " are");
    base::add_distinct(damage, telemetry.warnings);
    return telemetry;
  }

 private:
  void take(double stamp_s, const TlogFrame& frame) {
    for (const KnownMessage& message : {kAttitude, kGlobalPosition}) {
      if (frame.message != message.number) continue;
      if (!is_intact(frame, message)) {
        ++wrong_checksums_;
        return;
      }
      const TlogPayload payload(frame.payload, std::max(message.bytes, frame.payload.size()));
      const double boot_s = 1e-3 * payload.at<std::uint32_t>(0);
      if (message.number == kAttitude.number) {
        take_attitude(frame.system, stamp_s, boot_s, payload);
      } else {
        take_position(frame.system, stamp_s, boot_s, payload);
      }
    }
  }

  void take_attitude(std::uint8_t system, double stamp_s, double boot_s, const TlogPayload& payload) {
    if (system_ != system) return;
    const double time_s = continued_clock_s(stamp_s, boot_s);
    attitudes_.push_back({time_s, payload.at<float>(4), payload.at<float>(8), payload.at<float>(12)});
    rates_.push_back({time_s, payload.at<float>(16), payload.at<float>(20), payload.at<float>(24)});
  }

  void take_position(std::uint8_t system, double stamp_s, double boot_s, const TlogPayload& payload) {
    if (system_ && *system_ != system) {
      ++other_systems_;
      return;
    }
    if (!system_) utc_of_boot_s_ = stamp_s - boot_s;
    system_ = system;
    TelemetryFix fix;
    fix.time_s = continued_clock_s(stamp_s, boot_s);
    fix.latitude_deg = 1e-7 * payload.at<std::int32_t>(4);
    fix.longitude_deg = 1e-7 * payload.at<std::int32_t>(8);
    fix.absolute_height_m = 1e-3 * payload.at<std::int32_t>(12);
    fix.height_above_takeoff_m = 1e-3 * payload.at<std::int32_t>(16);
    positions_.push_back({fix, restarts_});
  }

  /// Returns the time of a message on the clock of the vehicle's first start. The vehicle's clock begins again when it
  /// restarts; the ground station's says for how long it was off.
  double continued_clock_s(double stamp_s, double boot_s) {
    constexpr double kLate_s = 2.0;  // messages arrive out of order by less
    const bool restarted = boot_s < latest_boot_s_ - kLate_s && boot_s < stamp_s - latest_stamp_s_ + kLate_s;
    if (restarted) {
      ++restarts_;
      restart_s_ = stamp_s - boot_s - utc_of_boot_s_;
    }
    if (restarted || boot_s >= latest_boot_s_) {
      latest_boot_s_ = boot_s;
      latest_stamp_s_ = stamp_s;
    }
    return restart_s_ + boot_s;
  }

  /// Removes the heights of positions that ArduPilot sent before it knew its home, and returns whether there are any:
  /// both heights are then equal and count from the place where the vehicle was switched on. Positions whose home is
  /// not far from sea level keep theirs.
  bool remove_heights_without_home() {
    constexpr double kEqual_m = 0.02, kNearSeaLevel_m = 5.0;  // heights are rounded apart
    if (std::ranges::all_of(positions_, [](const TlogPosition& p) { return std::abs(p.home_m()) <= kNearSeaLevel_m; }))
      return false;
    std::vector<TlogPosition*> without_home;
    std::optional<std::size_t> start_with_home;
    for (TlogPosition& position : positions_) {
      if (std::abs(position.home_m()) > kEqual_m) start_with_home = position.start;
      const bool has_place = position.fix.latitude_deg != 0.0 || position.fix.longitude_deg != 0.0;
      if (has_place && start_with_home != position.start) without_home.push_back(&position);
    }
    for (TlogPosition* position : without_home) {
      position->fix.absolute_height_m.reset();
      position->fix.height_above_takeoff_m.reset();
    }
    return !without_home.empty();
  }

  std::vector<TlogPosition> positions_;
  LogRows attitudes_, rates_;
  std::optional<std::uint8_t> system_;  ///< the vehicle: the first system that sends a position
  double utc_of_boot_s_ = 0.0;          ///< of the first start
  std::size_t restarts_ = 0;
  double restart_s_ = 0.0;                             ///< of the latest start, on the clock of the first
  double latest_boot_s_ = 0.0, latest_stamp_s_ = 0.0;  ///< of the message with the latest time since that start
  std::uint64_t skipped_bytes_ = 0, wrong_checksums_ = 0, other_systems_ = 0;
};

}  // namespace

bool is_mavlink_log(std::string_view head) {
  return head.size() > kStampBytes && is_stamp(head) && tlog_frame(head.substr(kStampBytes)).bytes > 0;
}

Telemetry read_mavlink_log(const std::filesystem::path& file) {
  const std::string bytes = base::read_raw(file, base::kMaxLogBytes);
  TlogReader reader;
  reader.read(bytes);
  return std::move(reader).finish(file.string());
}

}  // namespace tileflight::flight_logs
