// A DataFlash log is a sequence of messages: A3 95, the type's number, then its fields, packed, little-endian, with the
// length given by the FMT message of that type. FMT itself is type 128 and 89 bytes long. No length in the file is
// trusted: each field is bounded by its message, each message by the file.
#include "tileflight/data/flight_logs/dataflash_messages.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::flight_logs {
namespace {

static_assert(std::endian::native == std::endian::little);

using Bytes = std::span<const std::byte>;

constexpr std::string_view kDataflashMagic("\xA3\x95", 2);
constexpr std::size_t kDataflashHeaderBytes = 3;
constexpr std::size_t kFormatType = 128;
constexpr std::size_t kFormatBytes = 89;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

template <typename T>
double dataflash_number_at(Bytes bytes, std::size_t offset) {
  return static_cast<double>(base::read_raw<T>(bytes, offset));
}

double text_at(Bytes, std::size_t) { return kMissing; }

/// Decodes IEEE 754 half precision.
double half_at(Bytes bytes, std::size_t offset) {
  const auto bits = static_cast<unsigned>(dataflash_number_at<std::uint16_t>(bytes, offset));
  const int exponent = static_cast<int>(bits >> 10 & 31U);
  const double fraction = (bits & 1023U) / 1024.0, sign = (bits >> 15) != 0 ? -1.0 : 1.0;
  if (exponent == 31) return kMissing;
  return sign * (exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1.0 + fraction, exponent - 15));
}

/// A letter of the format string: the field's length, its decoding, and the multiplier to use if the log states none.
struct FieldType {
  char letter;
  std::size_t bytes;
  double (*read)(Bytes bytes, std::size_t offset);
  double multiplier = 1.0;
};

constexpr FieldType kFieldTypes[] = {
    {'b', 1, dataflash_number_at<std::int8_t>},
    {'B', 1, dataflash_number_at<std::uint8_t>},
    {'h', 2, dataflash_number_at<std::int16_t>},
    {'H', 2, dataflash_number_at<std::uint16_t>},
    {'i', 4, dataflash_number_at<std::int32_t>},
    {'I', 4, dataflash_number_at<std::uint32_t>},
    {'q', 8, dataflash_number_at<std::int64_t>},
    {'Q', 8, dataflash_number_at<std::uint64_t>},
    {'f', 4, dataflash_number_at<float>},
    {'d', 8, dataflash_number_at<double>},
    {'g', 2, half_at},
    {'M', 1, dataflash_number_at<std::uint8_t>},
    {'c', 2, dataflash_number_at<std::int16_t>, .01},
    {'C', 2, dataflash_number_at<std::uint16_t>, .01},
    {'e', 4, dataflash_number_at<std::int32_t>, .01},
    {'E', 4, dataflash_number_at<std::uint32_t>, .01},
    {'L', 4, dataflash_number_at<std::int32_t>, 1e-7},
    {'n', 4, text_at},
    {'N', 16, text_at},
    {'Z', 64, text_at},
    {'a', 64, text_at},
};

const FieldType* field_type(char letter) {
  const auto found = std::find_if(std::begin(kFieldTypes), std::end(kFieldTypes),
                                  [&](const FieldType& type) { return type.letter == letter; });
  return found == std::end(kFieldTypes) ? nullptr : found;
}

/// Text in a fixed-length field, up to its first zero byte.
std::string_view text_field(Bytes bytes, std::size_t offset, std::size_t length) {
  const std::string_view text = base::as_text(bytes.subspan(offset, length));
  return text.substr(0, text.find('\0'));
}

/// Conversion factor between two units of angle (or angular rate); 1 for other units. ArduPilot's labels: deg,
/// degheading, rad, deg/s, rad/s.
double angle_factor(std::string_view from, std::string_view to) {
  const auto degrees = [](std::string_view unit) { return unit.starts_with("deg"); };
  const auto radians = [](std::string_view unit) { return unit.starts_with("rad"); };
  constexpr double kDegree_rad = std::numbers::pi / 180.0;
  if (degrees(from) && radians(to)) return kDegree_rad;
  return radians(from) && degrees(to) ? 1.0 / kDegree_rad : 1.0;
}

std::vector<std::string> labels_of(std::string_view text) {
  std::vector<std::string> labels;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    labels.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return labels;
}

/// Position of a wanted number in a message, including the header.
struct DataflashFieldLocation {
  std::size_t field = 0, offset = 0;
  const FieldType* type = nullptr;  ///< nullptr: the format has no such field
};

/// Layout of the messages of one type.
struct Layout {
  std::size_t bytes = 0;  ///< 0: no such type
  std::string name;
  std::string letters;
  std::vector<std::string> labels;
  std::vector<DataflashFieldLocation> locations;  ///< of the wanted fields
  LogRows* rows = nullptr;                        ///< nullptr: not wanted

  DataflashFieldLocation find(std::string_view label) const {
    DataflashFieldLocation place{.field = 0, .offset = kDataflashHeaderBytes, .type = nullptr};
    for (; place.field < letters.size(); ++place.field) {
      const FieldType* type = field_type(letters[place.field]);
      if (type == nullptr || place.offset + type->bytes > bytes) return {};
      if (place.field < labels.size() && labels[place.field] == label) {
        place.type = type;
        return place;
      }
      place.offset += type->bytes;
    }
    return {};
  }
};

class DataflashReader {
 public:
  DataflashReader(Bytes bytes, const std::map<std::string, std::vector<DataflashField>>& requested, std::string where)
      : bytes_(bytes), requested_(requested), where_(std::move(where)) {
    layouts_[kFormatType].bytes = kFormatBytes;
  }

  DataflashMessages read() {
    for (std::size_t at = 0; at < bytes_.size();) {
      const std::size_t size = message_bytes(at);
      if (size > 0 && at + size <= bytes_.size()) {
        handle(static_cast<std::uint8_t>(bytes_[at + 2]), bytes_.subspan(at, size));
        at += size;
        continue;
      }
      const std::size_t next = next_message(at + 1);
      (size > 0 && next == bytes_.size() ? cut_ : skipped_bytes_) += next - at;
      at = next;
    }
    if (formats_ == 0)
      throw InputError(where_, "is not an ArduPilot log: it has no FMT message, which describes the others");
    apply_multipliers();
    describe();
    return std::move(messages_);
  }

 private:
  /// Size of the message at this offset, including its header; 0 if there is none.
  std::size_t message_bytes(std::size_t at) const {
    const Bytes rest = bytes_.subspan(at);
    if (rest.size() < kDataflashHeaderBytes || !base::as_text(rest.first(2)).starts_with(kDataflashMagic)) return 0;
    return layouts_[static_cast<std::uint8_t>(rest[2])].bytes;
  }

  /// The next offset at which a whole message may start, or the end of the file.
  std::size_t next_message(std::size_t at) const {
    const std::string_view text = base::as_text(bytes_);
    for (at = text.find(kDataflashMagic, at); at != std::string_view::npos; at = text.find(kDataflashMagic, at + 1)) {
      const std::size_t size = message_bytes(at);
      if (size > 0 && at + size <= bytes_.size()) return at;
    }
    return bytes_.size();
  }

  void handle(std::uint8_t type, Bytes message) {
    if (type == kFormatType) return add_format(message);
    const Layout& layout = layouts_[type];
    if (layout.name == "FMTU") add_multipliers(layout, message);
    if (layout.name == "MULT") add_multiplier(layout, message);
    if (layout.name == "UNIT") add_unit(layout, message);
    if (layout.rows == nullptr) return;
    std::vector<double> row;
    for (const DataflashFieldLocation& place : layout.locations) {
      row.push_back(place.type != nullptr ? place.type->read(message, place.offset) : kMissing);
    }
    layout.rows->push_back(std::move(row));
  }

  void add_format(Bytes message) {
    const auto type = static_cast<std::uint8_t>(message[3]);
    Layout layout{.bytes = static_cast<std::uint8_t>(message[4]),
                  .name = std::string(text_field(message, 5, 4)),
                  .letters = std::string(text_field(message, 9, 16)),
                  .labels = labels_of(text_field(message, 25, 64)),
                  .locations = {},
                  .rows = nullptr};
    if (layout.bytes < kDataflashHeaderBytes) return;
    ++formats_;
    if (type == kFormatType) return;
    if (const auto found = requested_.find(layout.name); found != requested_.end()) {
      for (const DataflashField& field : found->second) layout.locations.push_back(layout.find(field.label));
      layout.rows = &messages_.rows[layout.name];
      type_of_[layout.name] = type;
    }
    layouts_[type] = std::move(layout);
  }

  /// FMTU: for each field of a type, a letter each for its unit and its multiplier.
  void add_multipliers(const Layout& layout, Bytes message) {
    const DataflashFieldLocation type = layout.find("FmtType"), multipliers = layout.find("MultIds"),
                                 units = layout.find("UnitIds");
    if (type.type == nullptr || type.type->bytes != 1) return;
    const auto number = static_cast<std::uint8_t>(message[type.offset]);
    const auto text_at_place = [&](const DataflashFieldLocation& place) {
      return std::string(text_field(message, place.offset, place.type->bytes));
    };
    if (multipliers.type != nullptr) multiplier_letters_[number] = text_at_place(multipliers);
    if (units.type != nullptr) unit_letters_[number] = text_at_place(units);
  }

  /// UNIT: the label of a unit letter.
  void add_unit(const Layout& layout, Bytes message) {
    const DataflashFieldLocation letter = layout.find("Id"), label = layout.find("Label");
    if (letter.type == nullptr || label.type == nullptr || letter.type->bytes != 1) return;
    units_[static_cast<char>(message[letter.offset])] =
        std::string(text_field(message, label.offset, label.type->bytes));
  }

  /// MULT: the value of a multiplier letter.
  void add_multiplier(const Layout& layout, Bytes message) {
    const DataflashFieldLocation letter = layout.find("Id"), value = layout.find("Mult");
    if (letter.type == nullptr || value.type == nullptr || letter.type->bytes != 1) return;
    const double multiplier = value.type->read(message, value.offset);
    if (std::isfinite(multiplier)) {
      multipliers_[static_cast<std::uint8_t>(message[letter.offset])] = multiplier;
    }
  }

  /// Factor for a field's raw number: its multiplier, which includes the scale implied by the format letter; if there
  /// is none ('-' is 0, '?' unknown), that letter's scale times the field's own multiplier.
  double find_multiplier(std::uint8_t type, const DataflashFieldLocation& place, const DataflashField& field) const {
    if (place.type == nullptr) return 1.0;
    const auto letters = multiplier_letters_.find(type);
    if (letters != multiplier_letters_.end() && place.field < letters->second.size()) {
      const char letter = letters->second[place.field];
      const auto known = multipliers_.find(static_cast<std::uint8_t>(letter));
      if (letter != '?' && known != multipliers_.end() && known->second != 0.0) return known->second;
    }
    return place.type->multiplier * field.multiplier;
  }

  /// The log's unit for a field; empty if it states none.
  std::string_view unit_of(std::uint8_t type, const DataflashFieldLocation& place) const {
    const auto letters = unit_letters_.find(type);
    if (place.type == nullptr || letters == unit_letters_.end() || place.field >= letters->second.size()) return {};
    const auto known = units_.find(letters->second[place.field]);
    return known == units_.end() ? std::string_view() : std::string_view(known->second);
  }

  /// Applied at the end, since multipliers and units may follow the messages they apply to.
  void apply_multipliers() {
    for (auto& [name, rows] : messages_.rows) {
      const std::uint8_t type = type_of_.at(name);
      const std::vector<DataflashField>& fields = requested_.at(name);
      for (std::size_t i = 0; i < fields.size(); ++i) {
        const DataflashFieldLocation place =
            layouts_[type].name == name ? layouts_[type].locations[i] : DataflashFieldLocation{};
        const double factor =
            find_multiplier(type, place, fields[i]) * angle_factor(unit_of(type, place), fields[i].unit);
        for (std::vector<double>& row : rows) row[i] *= factor;
      }
    }
  }

  void describe() {
    if (skipped_bytes_ > 0) {
      messages_.warnings.push_back(std::to_string(skipped_bytes_) + " unreadable bytes skipped");
    }
    if (cut_ > 0) messages_.warnings.push_back("the file ends within a message; everything before it is used");
  }

  Bytes bytes_;
  const std::map<std::string, std::vector<DataflashField>>& requested_;
  std::string where_;
  std::array<Layout, 256> layouts_;
  std::map<std::string, std::uint8_t> type_of_;  ///< of wanted messages
  std::map<std::uint8_t, std::string> multiplier_letters_, unit_letters_;
  std::map<char, std::string> units_;
  std::map<std::uint8_t, double> multipliers_;
  DataflashMessages messages_;
  std::size_t formats_ = 0, skipped_bytes_ = 0, cut_ = 0;
};

}  // namespace

bool is_dataflash(std::string_view head) {
  return head.starts_with(kDataflashMagic) || head.substr(0, 256).find(
                                                  "\xA3\x95\x80\x80\x59"
                                                  "FMT") != std::string_view::npos;
}

DataflashMessages read_dataflash_messages(Bytes bytes,
                                          const std::map<std::string, std::vector<DataflashField>>& requested,
                                          const std::string& where) {
  return DataflashReader(bytes, requested, where).read();
}

}  // namespace tileflight::flight_logs
