// GoPro's metadata format (GPMF), as github.com/gopro/gpmf-parser documents it: elements of a key (four letters), a
// type, a size and a count, then numbers with the highest byte first. A sample of the track holds devices (DEVC), these
// hold streams (STRM), and these hold what describes their numbers (SCAL, SIUN, ORIN, ...) before the numbers.
//
// Axes. ORIN names the axis of each channel, a small letter the opposite direction: X to the left as the camera sees,
// Y backwards, Z up, right-handed (the picture "IMU Orientation" of the documentation). A HERO5 writes no ORIN; its
// order is Z, X, Y. GRAV, CORI and IORI have other axes: x right, y down, z forward, as a camera's frame has them here.
// GRAV points down; CORI turns from the first frame's axes to the camera's. The documentation does not say so: it is
// how they agree with ACCL and GYRO in GoPro's sample of a MAX (gyroscope and CORI to 1 degree over 10 s).
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <span>
#include <string_view>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"
#include "tileflight/data/flight_logs/timed_rows.h"

namespace tileflight::flight_logs {
namespace {

using base::TimedBytes;
using geometry::Mat3;
using geometry::Vec3;
using Bytes = std::span<const std::byte>;

/// A key with its value.
struct Element {
  std::string_view key;
  char type = '\0';  ///< '\0': the value is elements again
  std::size_t size = 0, count = 0;
  Bytes data;
};

/// The elements of a value, in their order.
class ElementReader {
 public:
  explicit ElementReader(Bytes bytes) : rest_(bytes) {}

  /// The next element; nullopt at the end, and where the bytes are damaged or cut.
  std::optional<Element> next() {
    constexpr std::size_t kHeader = 8;
    const auto is_zero = [](std::byte b) { return b == std::byte{0}; };
    if (std::ranges::all_of(rest_.first(std::min(rest_.size(), std::size_t{4})), is_zero)) return std::nullopt;
    damaged_ = true;
    if (rest_.size() < kHeader) return std::nullopt;
    Element element{.key = base::as_text(rest_.first(4)),
                    .type = base::read_raw<char>(rest_, 4),
                    .size = base::read_raw<std::uint8_t>(rest_, 5),
                    .count = base::read_big_endian<std::uint16_t>(rest_, 6),
                    .data = {}};
    const auto is_letter = [](char c) {
      return base::is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == ' ' || c == '_';
    };
    const std::size_t bytes = element.size * element.count;
    if (!std::ranges::all_of(element.key, is_letter) || bytes > rest_.size() - kHeader) return std::nullopt;
    damaged_ = false;
    element.data = rest_.subspan(kHeader, bytes);
    const std::size_t padded = kHeader + (bytes + 3) / 4 * 4;
    rest_ = rest_.subspan(std::min(padded, rest_.size()));
    return element;
  }
  bool is_damaged() const { return damaged_; }

 private:
  Bytes rest_;
  bool damaged_ = false;
};

/// Bytes of a number of the type; 0 for types that are no numbers.
std::size_t size_of_type(char type) {
  switch (type) {
    case 'b':
    case 'B':
      return 1;
    case 's':
    case 'S':
      return 2;
    case 'l':
    case 'L':
    case 'f':
    case 'q':
      return 4;
    case 'd':
    case 'j':
    case 'J':
    case 'Q':
      return 8;
    default:
      return 0;
  }
}

/// Precondition: `type` is a number's, and its bytes lie in `bytes`.
double number_at(Bytes bytes, std::size_t offset, char type) {
  constexpr double kQ16 = 1.0 / 65536.0, kQ32 = kQ16 * kQ16;
  const auto as = [&]<class Number>(Number) {
    return static_cast<double>(base::read_big_endian<Number>(bytes, offset));
  };
  switch (type) {
    case 'b':
      return static_cast<double>(base::read_raw<std::int8_t>(bytes, offset));
    case 'B':
      return static_cast<double>(base::read_raw<std::uint8_t>(bytes, offset));
    case 's':
      return as(std::int16_t{});
    case 'S':
      return as(std::uint16_t{});
    case 'l':
      return as(std::int32_t{});
    case 'L':
      return as(std::uint32_t{});
    case 'q':
      return kQ16 * as(std::int32_t{});
    case 'f':
      return as(float{});
    case 'd':
      return as(double{});
    case 'j':
      return as(std::int64_t{});
    case 'J':
      return as(std::uint64_t{});
    default:
      return kQ32 * as(std::int64_t{});
  }
}

std::string text_of(const Element& element) {
  std::string text(base::as_text(element.data));
  while (!text.empty() && (text.back() == '\0' || text.back() == ' ')) text.pop_back();
  return text;
}

/// TYPE with its repetitions written out: "f[3]L" is "fffL". Empty if it is longer than a sample can be.
std::string expanded_types(std::string_view types) {
  constexpr std::size_t kMost = 255;
  std::string expanded;
  while (!types.empty() && types.front() != '\0') {
    const char type = types.front();
    types.remove_prefix(1);
    std::size_t count = 1;
    if (base::take_prefix(types, "[")) {
      count = static_cast<std::size_t>(base::take_digits(types).value_or(0));
      base::take_prefix(types, "]");
    }
    if (expanded.size() + count > kMost) return {};
    expanded.append(count, type);
  }
  return expanded;
}

/// The types of the numbers in one sample of an element; empty if they are no numbers, or do not fill it.
std::string types_of(const Element& element, const std::string& complex) {
  std::string types = complex;
  if (element.type != '?') {
    const std::size_t size = size_of_type(element.type);
    types = size == 0 ? "" : std::string(element.size / size, element.type);
  }
  std::size_t bytes = 0;
  for (const char type : types) {
    const std::size_t size = size_of_type(type);
    if (size == 0) return {};
    bytes += size;
  }
  return bytes == element.size ? types : "";
}

std::vector<double> numbers_of(const Element& element, const std::string& types) {
  std::vector<double> numbers;
  std::size_t offset = 0;
  for (std::size_t i = 0; i < element.count; ++i) {
    for (const char type : types) {
      numbers.push_back(number_at(element.data, offset, type));
      offset += size_of_type(type);
    }
  }
  return numbers;
}

/// All numbers of an element of a simple type.
std::vector<double> numbers_of(const Element& element) { return numbers_of(element, types_of(element, "")); }

std::optional<double> number_of(const Element& element) {
  const std::vector<double> numbers = numbers_of(element);
  return numbers.empty() ? std::nullopt : std::optional(numbers.front());
}

/// GPSU: "191118234514.000" as Unix time.
std::optional<double> utc_of(const Element& element) {
  std::string_view text = base::as_text(element.data);
  if (text.size() < 12 || !std::all_of(text.begin(), text.begin() + 12, base::is_digit)) return std::nullopt;
  const std::string iso = "20" + std::string(text.substr(0, 2)) + "-" + std::string(text.substr(2, 2)) + "-" +
                          std::string(text.substr(4, 2)) + "T" + std::string(text.substr(6, 2)) + ":" +
                          std::string(text.substr(8, 2)) + ":" + std::string(text.substr(10));
  return base::parse_iso_time_s(iso.substr(0, iso.find('\0')) + "Z");
}

/// The rows of a stream that came with one sample of the track.
struct Piece {
  double begin_s = 0.0, duration_s = 0.0;  ///< of the track's sample
  std::size_t first = 0, rows = 0;
  std::optional<double> stamp_s;               ///< STMP: of the first row, on the camera's clock
  std::optional<double> fix, dilution, utc_s;  ///< GPSF, GPSP / 100, GPSU
  std::string altitude;                        ///< GPSA
};

/// All numbers of a key, scaled to their units, row by row.
struct Stream {
  std::uint32_t device = 0;
  std::size_t columns = 0;
  std::vector<double> numbers;
  std::vector<Piece> pieces;
  std::string name, units, order_in, order_out;  ///< STNM, SIUN, ORIN, ORIO
  std::vector<double> matrix;                    ///< MTRX
  std::string fault;                             ///< why rows of it were left out

  std::size_t rows() const { return columns == 0 ? 0 : numbers.size() / columns; }
  double at(std::size_t row, std::size_t column) const { return numbers[row * columns + column]; }
};

struct WantedKey {
  std::string_view key;
  std::size_t columns;
};
constexpr WantedKey kWantedKeys[] = {{"ACCL", 3}, {"GYRO", 3},  {"GRAV", 3}, {"CORI", 4}, {"IORI", 4},
                                     {"SHUT", 1}, {"ISOG", 1},  {"ISOE", 1}, {"GPS5", 5}, {"GPS9", 9},
                                     {"GLPI", 9}, {"GPRI", 10}, {"ATTD", 8}, {"SYST", 2}};

/// Readings of a stream beyond these are refused: 14 hours of 200 a second.
constexpr std::size_t kMostRows = 10'000'000;

/// Collects the streams of a track's samples.
class StreamCollector {
 public:
  explicit StreamCollector(std::string where) : where_(std::move(where)) {}

  void add(const TimedBytes& sample) {
    if (!std::isfinite(sample.begin_s) || (last_begin_s_ && sample.begin_s <= *last_begin_s_)) {
      ++not_later_;
      return;
    }
    last_begin_s_ = sample.begin_s;
    ElementReader elements(sample.bytes);
    while (const auto element = elements.next()) {
      if (element->key == "DEVC" && element->type == '\0') add_device(sample, element->data);
    }
    damaged_ += elements.is_damaged() ? 1 : 0;
  }

  /// nullptr if the track has no readings of the key that can be used.
  const Stream* find(std::string_view key) const {
    const auto found = streams_.find(std::string(key));
    return found == streams_.end() || found->second.rows() == 0 ? nullptr : &found->second;
  }
  const std::vector<std::string>& device_names() const { return device_names_; }

  std::vector<std::string> warnings() const {
    std::vector<std::string> texts;
    if (not_later_ > 0)
      texts.push_back(std::to_string(not_later_) + " samples of the metadata track left out: time does not increase");
    if (damaged_ > 0)
      texts.push_back(std::to_string(damaged_) +
                      " samples of the metadata track are damaged or cut; what stands "
                      "before the damage is used");
    for (const auto& [key, stream] : streams_) {
      if (!stream.fault.empty()) texts.push_back("readings of " + key + " left out: " + stream.fault);
    }
    return texts;
  }

 private:
  void add_device(const TimedBytes& sample, Bytes bytes) {
    ElementReader elements(bytes);
    std::uint32_t device = 0;
    while (const auto element = elements.next()) {
      if (element->key == "DVID" && element->data.size() >= 4)
        device = base::read_big_endian<std::uint32_t>(element->data, 0);
      if (element->key == "DVNM") base::add_distinct({text_of(*element)}, device_names_);
      if (element->key == "STRM" && element->type == '\0') add_stream(sample, device, element->data);
    }
    damaged_ += elements.is_damaged() ? 1 : 0;
  }

  void add_stream(const TimedBytes& sample, std::uint32_t device, Bytes bytes) {
    Stream about;  // what the elements before the readings say of them
    Piece piece{.begin_s = sample.begin_s, .duration_s = sample.duration_s};
    std::vector<double> scale;
    std::string complex;
    ElementReader elements(bytes);
    while (const auto element = elements.next()) {
      const std::string_view key = element->key;
      if (key == "SCAL") scale = numbers_of(*element);
      if (key == "TYPE") complex = expanded_types(base::as_text(element->data));
      if (key == "STNM") about.name = text_of(*element);
      if (key == "SIUN") about.units = text_of(*element);
      if (key == "ORIN") about.order_in = text_of(*element);
      if (key == "ORIO") about.order_out = text_of(*element);
      if (key == "MTRX") about.matrix = numbers_of(*element);
      if (key == "STMP") piece.stamp_s = scaled(number_of(*element), 1e-6);
      if (key == "GPSF") piece.fix = number_of(*element);
      if (key == "GPSP") piece.dilution = scaled(number_of(*element), 1e-2);
      if (key == "GPSU") piece.utc_s = utc_of(*element);
      if (key == "GPSA") piece.altitude = text_of(*element);
      const auto* const wanted = std::ranges::find(kWantedKeys, key, &WantedKey::key);
      if (wanted != std::end(kWantedKeys))
        add_rows(*wanted, *element, types_of(*element, complex), scale, device, about, piece);
    }
    damaged_ += elements.is_damaged() ? 1 : 0;
  }

  static std::optional<double> scaled(std::optional<double> number, double unit) {
    if (number) *number *= unit;
    return number;
  }

  void add_rows(const WantedKey& wanted, const Element& element, const std::string& types,
                const std::vector<double>& scale, std::uint32_t device, const Stream& about, Piece piece) {
    if (element.count == 0) return;
    const auto [place, is_new] = streams_.try_emplace(std::string(wanted.key));
    Stream& stream = place->second;
    if (is_new) stream.device = device;
    if (stream.device != device) return;  // a second device's
    if (element.type == '#') {
      stream.fault = "they are compressed, which is not read";
      return;
    }
    const auto is_divisor = [](double divisor) { return std::isfinite(divisor) && divisor != 0.0; };
    if (types.size() != wanted.columns || (scale.size() > 1 && scale.size() != types.size()) ||
        !std::ranges::all_of(scale, is_divisor)) {
      stream.fault = "they have another shape or scale than GoPro documents";
      return;
    }
    if (stream.rows() + element.count > kMostRows)
      throw InputError(where_, "has more than 10 million readings of " + place->first);
    piece.first = stream.rows();
    piece.rows = element.count;
    stream.columns = wanted.columns;
    std::vector<double> numbers = numbers_of(element, types);
    for (std::size_t i = 0; i < numbers.size() && !scale.empty(); ++i)
      numbers[i] /= scale[scale.size() == 1 ? 0 : i % types.size()];
    stream.numbers.insert(stream.numbers.end(), numbers.begin(), numbers.end());
    stream.pieces.push_back(std::move(piece));
    stream.name = about.name;
    stream.units = about.units;
    stream.order_in = about.order_in;
    stream.order_out = about.order_out;
    stream.matrix = about.matrix;
  }

  std::string where_;
  std::map<std::string, Stream> streams_;
  std::vector<std::string> device_names_;
  std::optional<double> last_begin_s_;
  std::size_t not_later_ = 0, damaged_ = 0;
};

/// Time 0 of the video on the clock of STMP: the first frame has the first exposure (SHUT); without it the earliest
/// first stamp of all streams. nullopt without stamps.
std::optional<double> zero_stamp_s(const StreamCollector& streams) {
  std::optional<double> zero_s;
  for (const WantedKey& wanted : kWantedKeys) {
    const Stream* const stream = streams.find(wanted.key);
    if (stream == nullptr || !stream->pieces.front().stamp_s) continue;
    const double stamp_s = *stream->pieces.front().stamp_s - stream->pieces.front().begin_s;
    if (wanted.key == "SHUT") return stamp_s;
    zero_s = std::min(zero_s.value_or(stamp_s), stamp_s);
  }
  return zero_s;
}

/// The times of a stream's rows when each piece is spread evenly over the track's sample.
std::vector<double> spread_times(const Stream& stream) {
  std::vector<double> times_s;
  for (const Piece& piece : stream.pieces) {
    for (std::size_t i = 0; i < piece.rows; ++i)
      times_s.push_back(piece.begin_s + piece.duration_s * static_cast<double>(i) / static_cast<double>(piece.rows));
  }
  return times_s;
}

/// The times of the pieces' first rows by their stamps; none unless all have one, and these agree with the track.
std::vector<double> stamped_begins(const Stream& stream, std::optional<double> zero_s) {
  constexpr double kAgree_s = 0.5;
  std::vector<double> begins_s;
  for (const Piece& piece : stream.pieces) {
    if (!zero_s || !piece.stamp_s) return {};
    const double begin_s = *piece.stamp_s - *zero_s;
    if (!(std::abs(begin_s - piece.begin_s) <= kAgree_s)) return {};
    if (!begins_s.empty() && !(begin_s > begins_s.back())) return {};
    begins_s.push_back(begin_s);
  }
  return begins_s;
}

/// The times of the pieces' first rows on the line of best fit through the rows counted at the ends of the track's
/// samples: a unit's clock is steadier than the moments at which what it measured is written. None for fewer than three
/// pieces, and where pieces are missing.
std::vector<double> fitted_begins(const Stream& stream) {
  constexpr std::size_t kFewest = 3;
  constexpr double kAgree_s = 0.15;
  if (stream.pieces.size() < kFewest) return {};
  const auto n = static_cast<double>(stream.pieces.size());
  double mean_time_s = 0.0, mean_rows = 0.0, squares = 0.0, products = 0.0;
  const auto end_s = [](const Piece& piece) { return piece.begin_s + piece.duration_s; };
  const auto end_row = [](const Piece& piece) { return static_cast<double>(piece.first + piece.rows); };
  for (const Piece& piece : stream.pieces) mean_time_s += end_s(piece) / n, mean_rows += end_row(piece) / n;
  for (const Piece& piece : stream.pieces) {
    squares += (end_s(piece) - mean_time_s) * (end_s(piece) - mean_time_s);
    products += (end_s(piece) - mean_time_s) * (end_row(piece) - mean_rows);
  }
  const double rows_per_s = products / squares;
  if (!std::isfinite(rows_per_s) || !(rows_per_s > 0.0)) return {};
  std::vector<double> begins_s;
  for (const Piece& piece : stream.pieces) {
    const double begin_s = mean_time_s + (static_cast<double>(piece.first) - mean_rows) / rows_per_s;
    if (!(std::abs(begin_s - piece.begin_s) <= kAgree_s)) return {};
    begins_s.push_back(begin_s);
  }
  return begins_s;
}

/// The times of a stream's rows on the video's clock, by stamps, by a line through the counts, or spread over the
/// track's samples: the first of these that the stream allows. Times need not increase where a file is damaged.
std::vector<double> row_times(const Stream& stream, std::optional<double> zero_s) {
  std::vector<double> begins_s = stamped_begins(stream, zero_s);
  if (begins_s.empty()) begins_s = fitted_begins(stream);
  if (begins_s.empty()) return spread_times(stream);
  const Piece& last = stream.pieces.back();
  const double last_duration_s = begins_s.size() == 1
                                     ? last.duration_s
                                     : (begins_s.back() - begins_s.front()) * static_cast<double>(last.rows) /
                                           static_cast<double>(last.first - stream.pieces.front().first);
  begins_s.push_back(begins_s.back() + last_duration_s);
  std::vector<double> times_s;
  for (std::size_t k = 0; k < stream.pieces.size(); ++k) {
    const auto rows = static_cast<double>(stream.pieces[k].rows);
    for (std::size_t i = 0; i < stream.pieces[k].rows; ++i)
      times_s.push_back(begins_s[k] + (begins_s[k + 1] - begins_s[k]) * static_cast<double>(i) / rows);
  }
  return times_s;
}

/// The video's time minus a clock's whose reading each row has: the mean over all rows, spread over the track's
/// samples. nullopt if the readings do not increase or leave the video's time by more than a second and a half, which
/// is more than spreading can be wrong.
std::optional<double> offset_of_own_clock(const Stream& stream, const std::vector<double>& own_s) {
  constexpr double kAgree_s = 1.5;
  const std::vector<double> times_s = spread_times(stream);
  double offset_s = 0.0;
  for (std::size_t i = 0; i < own_s.size(); ++i) {
    if (!std::isfinite(own_s[i]) || (i > 0 && own_s[i] < own_s[i - 1])) return std::nullopt;
    offset_s += (times_s[i] - own_s[i]) / static_cast<double>(own_s.size());
  }
  for (std::size_t i = 0; i < own_s.size(); ++i) {
    if (!(std::abs(own_s[i] + offset_s - times_s[i]) <= kAgree_s)) return std::nullopt;
  }
  return offset_s;
}

std::vector<double> column_of(const Stream& stream, std::size_t column) {
  std::vector<double> numbers;
  for (std::size_t row = 0; row < stream.rows(); ++row) numbers.push_back(stream.at(row, column));
  return numbers;
}

/// The times of the rows by their own clock, else by the track, with a warning.
struct OwnTimes {
  std::vector<double> times_s;
  std::optional<double> offset_s;  ///< the video's time minus the clock's
};

OwnTimes own_times(const Stream& stream, std::vector<double> own_s, const std::string& clock,
                   std::vector<std::string>& warnings) {
  const std::optional<double> offset_s = offset_of_own_clock(stream, own_s);
  if (!offset_s) {
    warnings.push_back("the " + clock +
                       " jumps or does not run with the video's; its positions are spread over the "
                       "samples of the metadata track, and may be a second off");
    return {spread_times(stream), {}};
  }
  for (double& time_s : own_s) time_s += *offset_s;
  return {std::move(own_s), offset_s};
}

// Positions

struct DroppedFixes {
  std::size_t without_fix = 0, diluted = 0;
};

/// GoPro: "under 500 is good", of hundredths.
constexpr double kWorstDilution = 5.0;
constexpr double kFixInThreeDimensions = 3.0;

/// Returns whether a fix counts; counts those that do not.
bool is_good_fix(std::optional<double> fix, std::optional<double> dilution, DroppedFixes& dropped) {
  if (fix && !(*fix >= kFixInThreeDimensions)) {
    ++dropped.without_fix;
    return false;
  }
  if (dilution && !(*dilution < kWorstDilution)) {
    ++dropped.diluted;
    return false;
  }
  return true;
}

/// The reference of heights by GPSA. Cameras before GPSA write heights above the ellipsoid.
HeightDatum datum_of(const Stream& stream, HeightDatum without, std::vector<std::string>& warnings) {
  std::optional<HeightDatum> datum;
  for (const Piece& piece : stream.pieces) {
    const HeightDatum stated = piece.altitude.empty()     ? without
                               : piece.altitude == "MSLV" ? HeightDatum::kMeanSeaLevel
                                                          : HeightDatum::kUnknown;
    if (stated == HeightDatum::kUnknown && !piece.altitude.empty())
      base::add_distinct(
          {"the reference of heights is called '" + piece.altitude.substr(0, 8) + "' (GPSA), which is not documented"},
          warnings);
    if (datum && *datum != stated) {
      warnings.emplace_back("the reference of heights changes within the recording (GPSA), so it is not known");
      return HeightDatum::kUnknown;
    }
    datum = stated;
  }
  return datum.value_or(HeightDatum::kUnknown);
}

TelemetryFix fix_at(const Stream& stream, std::size_t row, std::size_t first_column, double time_s) {
  TelemetryFix fix;
  fix.time_s = time_s;
  fix.latitude_deg = stream.at(row, first_column);
  fix.longitude_deg = stream.at(row, first_column + 1);
  if (std::isfinite(stream.at(row, first_column + 2))) fix.absolute_height_m = stream.at(row, first_column + 2);
  return fix;
}

/// Adds a fix where its coordinates are numbers.
void add_fix(FixFilter& filter, const TelemetryFix& fix) {
  if (std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg) && std::isfinite(fix.time_s)) {
    filter.add(fix);
  } else {
    filter.drop_without_fix();
  }
}

/// UTC at the video's time 0 by pairs of UTC and video time; nullopt without any. Warns where the two pass differently.
std::optional<double> zero_utc_s(const std::vector<std::pair<double, double>>& utc_and_time_s,
                                 std::vector<std::string>& warnings) {
  constexpr double kLeast_s = 2.0, kShare = 0.02;
  if (utc_and_time_s.empty()) return std::nullopt;
  const auto& [first_utc_s, first_s] = utc_and_time_s.front();
  double largest_s = 0.0, mean_s = 0.0;
  for (const auto& [utc_s, time_s] : utc_and_time_s) {
    const double off_s = (utc_s - first_utc_s) - (time_s - first_s);
    if (std::abs(off_s) > std::abs(largest_s)) largest_s = off_s;
    mean_s += (utc_s - time_s) / static_cast<double>(utc_and_time_s.size());
  }
  if (std::abs(largest_s) > std::max(kLeast_s, kShare * (utc_and_time_s.back().second - first_s)))
    warnings.push_back(
        base::formatted("the receiver's clock leaves the video's by %.1f s within the recording: a time "
                        "lapse, slow motion, or a clock that jumped; speeds and times of positions may "
                        "be wrong",
                        largest_s));
  return mean_s;
}

/// Positions of GPS5 (each sample of the track has one state of the fix) or GPS9 (each row has its own).
void add_camera_positions(const Stream& stream, std::optional<double> zero_s, FixFilter& filter, Telemetry& telemetry,
                          std::vector<std::string>& warnings, DroppedFixes& dropped) {
  constexpr std::size_t kDays = 5, kSeconds = 6, kDilution = 7, kFix = 8, kGps9Columns = 9;
  constexpr double kYear2000_s = 946684800.0, kDay_s = 86400.0;
  const bool has_own_fix = stream.columns == kGps9Columns;
  const std::vector<double> times_s = row_times(stream, zero_s);
  std::vector<std::pair<double, double>> utc_and_time_s;
  for (std::size_t row = 0; row < stream.rows() && has_own_fix; ++row) {
    const double utc_s = kYear2000_s + kDay_s * stream.at(row, kDays) + stream.at(row, kSeconds);
    if (stream.at(row, kFix) >= kFixInThreeDimensions && std::isfinite(utc_s))
      utc_and_time_s.emplace_back(utc_s, times_s[row]);
  }
  for (const Piece& piece : stream.pieces) {
    if (!has_own_fix && piece.utc_s && piece.fix.value_or(0.0) >= kFixInThreeDimensions)
      utc_and_time_s.emplace_back(*piece.utc_s, times_s[piece.first]);
  }
  for (const Piece& piece : stream.pieces) {
    for (std::size_t row = piece.first; row < piece.first + piece.rows; ++row) {
      const bool is_good = has_own_fix ? is_good_fix(stream.at(row, kFix), stream.at(row, kDilution), dropped)
                                       : is_good_fix(piece.fix, piece.dilution, dropped);
      if (is_good) add_fix(filter, fix_at(stream, row, 0, times_s[row]));
    }
  }
  telemetry.zero_utc_s = zero_utc_s(utc_and_time_s, warnings);
  telemetry.height_datum = datum_of(stream, has_own_fix ? HeightDatum::kUnknown : HeightDatum::kEllipsoid, warnings);
}

/// The vehicle's attitude of the Karma (ATTD: seconds, roll, pitch, yaw in radians), nearest in time.
void add_attitudes(const Stream* attitudes, double offset_s, std::vector<TelemetryFix>& fixes) {
  constexpr double kFarthest_s = 0.2, kDegrees = 1.0 / geometry::kRadiansPerDegree;
  if (attitudes == nullptr) return;
  LogRows rows;
  for (std::size_t row = 0; row < attitudes->rows(); ++row)
    rows.push_back({attitudes->at(row, 0), attitudes->at(row, 1), attitudes->at(row, 2), attitudes->at(row, 3)});
  rows = sort_by_time(std::move(rows));
  for (TelemetryFix& fix : fixes) {
    const std::vector<double>* const nearest = nearest_in_time(rows, fix.time_s - offset_s, kFarthest_s);
    if (nearest == nullptr || !std::isfinite((*nearest)[1] + (*nearest)[2] + (*nearest)[3])) continue;
    fix.body_roll_deg = kDegrees * (*nearest)[1];
    fix.body_pitch_deg = kDegrees * (*nearest)[2];
    fix.body_yaw_deg = kDegrees * (*nearest)[3];
  }
}

/// Returns whether the Karma's receiver (GPRI) states a 3D fix in all rows of the track's sample that begins
/// then; true without any.
bool has_receiver_fix(const Stream* receiver, double begin_s) {
  constexpr std::size_t kFix = 8;
  if (receiver == nullptr) return true;
  for (const Piece& piece : receiver->pieces) {
    if (piece.begin_s != begin_s) continue;
    for (std::size_t row = piece.first; row < piece.first + piece.rows; ++row) {
      if (!(receiver->at(row, kFix) >= kFixInThreeDimensions)) return false;
    }
  }
  return true;
}

/// Positions of the Karma's flight controller (GLPI: seconds, latitude, longitude, height, height above take-off).
double add_vehicle_positions(const StreamCollector& streams, const Stream& positions, FixFilter& filter,
                             Telemetry& telemetry, std::vector<std::string>& warnings, DroppedFixes& dropped) {
  constexpr std::size_t kAboveTakeoff = 4;
  const OwnTimes times = own_times(positions, column_of(positions, 0), "clock of the Karma", warnings);
  const Stream* const receiver = streams.find("GPRI");
  for (const Piece& piece : positions.pieces) {
    const bool is_good = has_receiver_fix(receiver, piece.begin_s);
    for (std::size_t row = piece.first; row < piece.first + piece.rows; ++row) {
      if (!is_good) {
        ++dropped.without_fix;
        continue;
      }
      TelemetryFix fix = fix_at(positions, row, 1, times.times_s[row]);
      if (std::isfinite(positions.at(row, kAboveTakeoff)))
        fix.height_above_takeoff_m = positions.at(row, kAboveTakeoff);
      add_fix(filter, fix);
    }
  }
  telemetry.height_datum = HeightDatum::kMeanSeaLevel;
  warnings.emplace_back(
      "the Karma's heights are taken as above sea level, as MAVLink defines those of the same message "
      "(GLOBAL_POSITION_INT); GoPro does not document their reference");
  if (const Stream* const clock = streams.find("SYST"); clock != nullptr && times.offset_s)
    telemetry.zero_utc_s = clock->at(0, 1) - clock->at(0, 0) - *times.offset_s;
  return times.offset_s.value_or(0.0);
}

void add_positions(const StreamCollector& streams, std::optional<double> zero_s, Telemetry& telemetry,
                   std::vector<std::string>& warnings) {
  FixFilter filter;
  DroppedFixes dropped;
  Telemetry about;
  std::optional<double> vehicle_offset_s;
  for (const std::string_view key : {"GPS9", "GPS5"}) {
    const Stream* const stream = streams.find(key);
    if (stream == nullptr) continue;
    add_camera_positions(*stream, zero_s, filter, about, warnings, dropped);
    break;
  }
  if (const Stream* const vehicle = streams.find("GLPI");
      vehicle != nullptr && streams.find("GPS9") == nullptr && streams.find("GPS5") == nullptr)
    vehicle_offset_s = add_vehicle_positions(streams, *vehicle, filter, about, warnings, dropped);
  Telemetry found = std::move(filter).finish();
  telemetry.fixes = std::move(found.fixes);
  telemetry.height_datum = about.height_datum;
  telemetry.zero_utc_s = about.zero_utc_s;
  base::add_distinct(found.warnings, warnings);
  if (dropped.without_fix > 0)
    warnings.push_back(std::to_string(dropped.without_fix) +
                       " positions dropped: the receiver had no three-dimensional fix");
  if (dropped.diluted > 0)
    warnings.push_back(std::to_string(dropped.diluted) +
                       " positions dropped: the receiver's dilution of precision was 5 or more");
  if (vehicle_offset_s) add_attitudes(streams.find("ATTD"), *vehicle_offset_s, telemetry.fixes);
}

// Inertial unit

/// The matrix from channels to axes by a text such as "YxZ": the axis of each channel, a small letter its opposite.
std::optional<Mat3> axes_from_channels(std::string_view order) {
  if (order.size() != 3) return std::nullopt;
  Mat3 axes = Mat3::Zero();
  for (int channel = 0; channel < 3; ++channel) {
    const char letter = order[static_cast<std::size_t>(channel)];
    const bool is_opposite = letter >= 'x' && letter <= 'z';
    const int axis = letter - (is_opposite ? 'x' : 'X');
    if (axis < 0 || axis > 2) return std::nullopt;
    axes(axis, channel) = is_opposite ? -1.0 : 1.0;
  }
  return std::abs(std::abs(axes.determinant()) - 1.0) < 1e-9 ? std::optional(axes) : std::nullopt;
}

/// GoPro's axes (left, back, up) as those of a camera (right, down, forward).
Mat3 camera_from_gopro() { return (Mat3() << -1, 0, 0, 0, 0, -1, 0, -1, 0).finished(); }

/// The matrix from a stream's channels to the camera's axes, and what is assumed of it; nullopt with the reason in
/// `notes`.
std::optional<Mat3> camera_from_channels(const Stream& stream, const std::string& device,
                                         std::vector<std::string>& notes) {
  constexpr double kAlike = 0.3;
  std::string order = stream.order_in;
  if (order.empty()) {
    if (device.find("Fusion") != std::string::npos) {
      notes.emplace_back("a Fusion does not state the axes of its inertial unit");
      return std::nullopt;
    }
    order = "ZXY";
    notes.emplace_back(
        "the recording does not state the axes of its inertial unit (ORIN); those of a HERO5 are assumed: up, left, "
        "back");
  }
  const std::optional<Mat3> stated = axes_from_channels(order);
  if (!stated) {
    notes.push_back("the axes of the inertial unit are called '" + order.substr(0, 8) + "' (ORIN)");
    return std::nullopt;
  }
  const std::optional<Mat3> out = axes_from_channels(stream.order_out);
  if (stream.matrix.size() == 9 && out) {
    Mat3 matrix;
    for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = stream.matrix[static_cast<std::size_t>(i)];
    const Mat3 calibrated = *out * matrix;
    if (!((calibrated - *stated).cwiseAbs().maxCoeff() < kAlike)) {
      notes.emplace_back("the axes of the inertial unit by ORIN and by MTRX contradict each other");
      return std::nullopt;
    }
    return camera_from_gopro() * calibrated;
  }
  return camera_from_gopro() * *stated;
}

struct TimedVectors {
  std::vector<double> times_s;
  std::vector<Vec3> values;
};

/// A stream's rows in the camera's axes, those with a time after the one before.
TimedVectors vectors_of(const Stream& stream, const Mat3& camera_from_rows, std::optional<double> zero_s) {
  TimedVectors vectors;
  const std::vector<double> times_s = row_times(stream, zero_s);
  for (std::size_t row = 0; row < stream.rows(); ++row) {
    const Vec3 value(stream.at(row, 0), stream.at(row, 1), stream.at(row, 2));
    const bool is_later = vectors.times_s.empty() || times_s[row] > vectors.times_s.back();
    if (!value.allFinite() || !std::isfinite(times_s[row]) || !is_later) continue;
    vectors.times_s.push_back(times_s[row]);
    vectors.values.emplace_back(camera_from_rows * value);
  }
  return vectors;
}

/// The readings at the gyroscope's times, with the accelerometer's between its own.
std::vector<geometry::ImuSample> merged(const TimedVectors& rates, const TimedVectors& forces) {
  std::vector<geometry::ImuSample> readings;
  std::size_t k = 0;
  for (std::size_t i = 0; i < rates.times_s.size(); ++i) {
    const double time_s = rates.times_s[i];
    while (k + 1 < forces.times_s.size() && forces.times_s[k + 1] < time_s) ++k;
    if (k + 1 >= forces.times_s.size()) break;
    const double share = (time_s - forces.times_s[k]) / (forces.times_s[k + 1] - forces.times_s[k]);
    if (!(share >= 0.0 && share <= 1.0)) continue;
    readings.push_back({time_s, rates.values[i], (1.0 - share) * forces.values[k] + share * forces.values[k + 1]});
  }
  return readings;
}

/// The largest angle by which a stream of quaternions (IORI) turns, radians.
double largest_turn_rad(const Stream& stream) {
  double largest_rad = 0.0;
  for (std::size_t row = 0; row < stream.rows(); ++row) {
    const double norm =
        std::hypot(std::hypot(stream.at(row, 0), stream.at(row, 1)), std::hypot(stream.at(row, 2), stream.at(row, 3)));
    if (!(norm > 0.5)) continue;
    largest_rad = std::max(largest_rad, 2.0 * std::acos(std::min(1.0, std::abs(stream.at(row, 0)) / norm)));
  }
  return largest_rad;
}

double angle_deg(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / geometry::kRadiansPerDegree;
}

Vec3 mean_of(const std::vector<Vec3>& values) {
  return std::accumulate(values.begin(), values.end(), Vec3(Vec3::Zero())) / static_cast<double>(values.size());
}

/// By how much gyroscope and CORI differ: the root mean square, over stretches of half a second, of the rotation
/// between the turns of the two, as a share of that of the turns. With the right axes it is 0.17 in GoPro's sample of a
/// MAX; without a gyroscope it would be 1. nullopt where there is no CORI, or the camera hardly turns.
std::optional<double> turn_difference(const Stream* orientations, std::optional<double> zero_s,
                                      const TimedVectors& rates) {
  constexpr double kStretch_s = 0.5, kLeastTurn_rad = 1.0 * geometry::kRadiansPerDegree;
  constexpr std::size_t kFewest = 4;
  if (orientations == nullptr) return std::nullopt;
  const std::vector<double> times_s = row_times(*orientations, zero_s);
  const auto R_first_camera = [&](std::size_t row) {
    return Eigen::Quaterniond(orientations->at(row, 0), orientations->at(row, 1), orientations->at(row, 2),
                              orientations->at(row, 3))
        .conjugate()
        .normalized();
  };
  double differences = 0.0, turns = 0.0;
  std::size_t stretches = 0;
  for (std::size_t begin = 0, end = 0, k = 0; end < times_s.size(); ++end) {
    if (times_s[end] - times_s[begin] < kStretch_s) continue;
    Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
    while (k < rates.times_s.size() && rates.times_s[k] < times_s[begin]) ++k;
    for (; k + 1 < rates.times_s.size() && rates.times_s[k] < times_s[end]; ++k)
      turned = turned * geometry::so3_exp(rates.values[k] * (rates.times_s[k + 1] - rates.times_s[k]));
    const Eigen::Quaterniond stated = R_first_camera(begin).conjugate() * R_first_camera(end);
    const double difference = geometry::so3_log(turned.conjugate() * stated).squaredNorm();
    if (std::isfinite(difference)) {
      differences += difference;
      turns += geometry::so3_log(stated).squaredNorm();
      ++stretches;
    }
    begin = end;
  }
  if (stretches < kFewest || turns < kLeastTurn_rad * kLeastTurn_rad * static_cast<double>(stretches))
    return std::nullopt;
  return std::sqrt(differences / turns);
}

/// The rotation of the camera's axes when frames are turned clockwise for display.
Mat3 shown_from_stored(int quarter_turns) {
  Mat3 turned = Mat3::Identity();
  const Mat3 quarter = (Mat3() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();  // right becomes down, down becomes left
  for (int i = 0; i < quarter_turns; ++i) turned = quarter * turned;
  return turned;
}

/// Returns why readings of the inertial unit cannot be used; empty: they can.
std::string find_inertial_fault(const StreamCollector& streams, std::optional<double> zero_s, bool is_stabilised,
                                const Mat3& shown, const TimedVectors& rates, const TimedVectors& forces) {
  constexpr double kStabilised_deg = 2.0, kFarthestUp_deg = 110.0, kAlike_deg = 30.0, kAlikeTurns = 0.5;
  constexpr double kWeakest_m_s2 = 6.0, kStrongest_m_s2 = 14.0, kLowestRate_hz = 40.0;
  if (const Stream* const image = streams.find("IORI"); image != nullptr) {
    const double turned_deg = largest_turn_rad(*image) / geometry::kRadiansPerDegree;
    if (turned_deg > kStabilised_deg)
      return base::formatted(
          "the camera's stabilisation turned the frames by up to %.1f degrees against its body (IORI)", turned_deg);
  } else if (is_stabilised) {
    return "the camera's stabilisation was on (EISE), and by how much it turned the frames is not recorded";
  }
  if (rates.times_s.size() < 2 || forces.times_s.size() < 2) return "there are fewer than two";
  const double rate_hz = static_cast<double>(rates.times_s.size() - 1) / (rates.times_s.back() - rates.times_s.front());
  if (!(rate_hz >= kLowestRate_hz))
    return base::formatted("there are %.1f a second, as in a time lapse, where they are means over what was not filmed",
                           rate_hz);
  const Vec3 up = mean_of(forces.values);
  if (!(up.norm() >= kWeakest_m_s2 && up.norm() <= kStrongest_m_s2))
    return base::formatted("the mean of the accelerometer is %.1f m/s^2, which is not gravity", up.norm());
  if (const Stream* const gravity = streams.find("GRAV"); gravity != nullptr) {
    const TimedVectors down = vectors_of(*gravity, shown, zero_s);
    const double apart_deg = down.values.empty() ? 0.0 : angle_deg(up, -mean_of(down.values));
    if (!(apart_deg <= kAlike_deg))
      return base::formatted("accelerometer and gravity (GRAV) are %.0f degrees apart, so its axes are not known",
                             apart_deg);
  }
  if (const double from_up_deg = angle_deg(up, -Vec3::UnitY()); !(from_up_deg <= kFarthestUp_deg))
    return base::formatted(
        "the camera was upside down (by %.0f degrees), and whether it turned its frames is not recorded", from_up_deg);
  TimedVectors unturned = rates;
  for (Vec3& rate : unturned.values) rate = shown.transpose() * rate;
  if (const auto share = turn_difference(streams.find("CORI"), zero_s, unturned); share && *share > kAlikeTurns)
    return base::formatted("gyroscope and orientation (CORI) differ by %.0f %% of the turns, so its axes are not known",
                           100.0 * *share);
  return "";
}

void add_inertial(const StreamCollector& streams, std::optional<double> zero_s, bool is_stabilised, int quarter_turns,
                  Telemetry& telemetry, std::vector<std::string>& warnings) {
  const Stream *const accelerometer = streams.find("ACCL"), *const gyroscope = streams.find("GYRO");
  if (accelerometer == nullptr || gyroscope == nullptr) return;
  const auto leave_out = [&](const std::string& cause) {
    warnings.push_back("the readings of the inertial unit are left out: " + cause);
  };
  const auto is_unit = [](const Stream& stream, std::initializer_list<std::string_view> names) {
    return stream.units.empty() || std::ranges::find(names, stream.units) != names.end();
  };
  if (!is_unit(*accelerometer, {"m/s\xB2", "m/s\xC2\xB2", "m/s2", "m/s^2"}) || !is_unit(*gyroscope, {"rad/s"}))
    return leave_out("their units are not m/s^2 and rad/s");
  std::vector<std::string> notes;
  const std::optional<Mat3> of_forces = camera_from_channels(*accelerometer, telemetry.device, notes);
  const std::optional<Mat3> of_rates = camera_from_channels(*gyroscope, telemetry.device, notes);
  if (!of_forces || !of_rates) return leave_out(notes.back());
  const Mat3 shown = shown_from_stored(quarter_turns);
  const TimedVectors forces = vectors_of(*accelerometer, shown * *of_forces, zero_s);
  const TimedVectors rates = vectors_of(*gyroscope, shown * *of_rates, zero_s);
  const std::string fault = find_inertial_fault(streams, zero_s, is_stabilised, shown, rates, forces);
  if (!fault.empty()) return leave_out(fault);
  telemetry.inertial = merged(rates, forces);
  base::add_distinct(notes, warnings);
}

/// Exposures with the gain of the same frame.
std::vector<ExposureReading> exposures_of(const StreamCollector& streams, std::optional<double> zero_s) {
  std::vector<ExposureReading> readings;
  const Stream* const exposures = streams.find("SHUT");
  if (exposures == nullptr) return readings;
  const Stream* const sensitivity = streams.find("ISOE");
  const Stream* const gains = sensitivity != nullptr ? sensitivity : streams.find("ISOG");
  const bool has_gains = gains != nullptr && gains->rows() == exposures->rows();
  const std::vector<double> times_s = row_times(*exposures, zero_s);
  for (std::size_t row = 0; row < exposures->rows(); ++row) {
    const double exposure_s = exposures->at(row, 0);
    const bool is_later = readings.empty() || times_s[row] > readings.back().time_s;
    if (!std::isfinite(exposure_s) || exposure_s <= 0.0 || !std::isfinite(times_s[row]) || !is_later) continue;
    readings.push_back({times_s[row], exposure_s, has_gains ? std::optional(gains->at(row, 0)) : std::nullopt});
  }
  return readings;
}

/// Holds what the box moov/udta/GPMF says of the whole recording.
struct Settings {
  std::string model;           ///< MINF
  bool is_stabilised = false;  ///< EISE
  std::string field_of_view;   ///< VFOV, a letter; newer models state it in a device of its own
  bool has_zoom = false;       ///< DZOM, where the camera has a digital zoom that is on
};

Settings settings_of(Bytes bytes) {
  Settings settings;
  ElementReader devices(bytes);
  while (const auto device = devices.next()) {
    if (device->key != "DEVC" || device->type != '\0') continue;
    ElementReader elements(device->data);
    while (const auto element = elements.next()) {
      if (element->key == "MINF") settings.model = text_of(*element);
      if (element->key == "EISE") settings.is_stabilised = text_of(*element) == "Y";
      if (element->key == "VFOV") settings.field_of_view = text_of(*element);
      if (element->key == "DZOM") settings.has_zoom = text_of(*element) == "Y";
    }
  }
  return settings;
}

/// The model by the settings, else the names of the devices but the one that says nothing ("Camera").
std::string device_of(const Settings& settings, std::vector<std::string> names) {
  if (!settings.model.empty()) return settings.model;
  std::erase(names, "Camera");
  std::erase(names, "");
  return base::joined(names);
}

}  // namespace

/// The letters are those that ExifTool documents (lib/Image/ExifTool/GoPro.pm).
std::string gopro_lens_mode(std::span<const std::byte> settings) {
  const std::string letter = settings_of(settings).field_of_view;
  return letter == "W" ? "Wide" : letter == "S" ? "SuperView" : letter == "L" ? "Linear" : "";
}

Telemetry read_gpmf(std::span<const base::TimedBytes> samples, const MetadataSource& source) {
  StreamCollector streams(source.where);
  for (const TimedBytes& sample : samples) streams.add(sample);
  const Settings settings = settings_of(source.settings);
  Telemetry telemetry;
  telemetry.device = device_of(settings, streams.device_names());
  telemetry.warnings = streams.warnings();
  const std::optional<double> zero_s = zero_stamp_s(streams);
  add_positions(streams, zero_s, telemetry, telemetry.warnings);
  add_inertial(streams, zero_s, settings.is_stabilised, source.quarter_turns, telemetry, telemetry.warnings);
  telemetry.exposures = exposures_of(streams, zero_s);
  if (const Stream* const image = streams.find("IORI");
      settings.is_stabilised || (image != nullptr && largest_turn_rad(*image) > 0.5 * geometry::kRadiansPerDegree))
    telemetry.warnings.emplace_back(
        "the camera's electronic stabilisation changed the frames: a calibration holds for frames without it");
  if (settings.has_zoom)
    telemetry.warnings.emplace_back("a digital zoom was on (DZOM): use a calibration that was made with the same zoom");
  if (telemetry.fixes.empty() && telemetry.inertial.empty() && telemetry.exposures.empty())
    throw InputError(source.where,
                     "its metadata track (gpmd) holds no positions, readings of an inertial unit or "
                     "exposures that can be read" +
                         (telemetry.warnings.empty() ? "" : " (" + base::joined(telemetry.warnings, "; ") + ")"));
  return telemetry;
}

}  // namespace tileflight::flight_logs
