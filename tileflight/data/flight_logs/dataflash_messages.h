#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/data/flight_logs/timed_rows.h"

namespace tileflight::flight_logs {

/// A numeric field to read from a DataFlash message: its label, the multiplier to use if the log states none (logs
/// before 2018 do not), and the wanted unit of an angle: "deg", "rad", "deg/s" or "rad/s". If the log states another of
/// these units, the number is converted.
struct DataflashField {
  std::string label;
  double multiplier = 1.0;
  std::string unit{};
};

/// Messages by name: each a row of numbers in the order of the requested fields, NaN for fields that the file's message
/// format lacks.
struct DataflashMessages {
  std::map<std::string, LogRows> rows;
  std::vector<std::string> warnings;
};

/// Whether a file that starts with these bytes is a DataFlash log.
bool is_dataflash(std::string_view head);

/// Reads the wanted messages of an ArduPilot log (.bin). FMT messages define the layout of the others; FMTU, MULT and
/// UNIT define multipliers and units (ArduPilot's developer pages, "Adding a new Log Message", and the notes on its
/// logger's format types). Bytes that are not part of a message are skipped and a truncated file is read as far as
/// possible; both are reported in `warnings`. Throws InputError (`where`, cause) if the bytes hold no message format.
DataflashMessages read_dataflash_messages(std::span<const std::byte> bytes,
                                          const std::map<std::string, std::vector<DataflashField>>& requested,
                                          const std::string& where);

}  // namespace tileflight::flight_logs
