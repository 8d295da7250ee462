#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/flight/timed_rows.h"

namespace tileflight::flight {

/// A number to read of a DataFlash message: its label, what one of it is worth where the log itself does not say (logs
/// before 2018 have no multipliers), and its unit of angle, "deg", "rad", "deg/s" or "rad/s": where the log says
/// another of them, the number is converted.
struct DataflashField {
  std::string label;
  double worth = 1.0;
  std::string unit{};
};

/// Messages by name, each a row of numbers in the order of the fields that were asked for, NaN for those that the
/// file's format of the message has not.
struct DataflashMessages {
  std::map<std::string, LogRows> rows;
  std::vector<std::string> warnings;
};

/// Whether a file that begins with these bytes is a DataFlash log.
bool is_dataflash(std::string_view head);

/// Reads the wanted messages of an ArduPilot log (.bin): FMT messages say how the others are laid out, FMTU with MULT
/// and UNIT what their numbers are worth (ArduPilot's developer pages, "Adding a new Log Message", and the notes to its
/// logger's format types). Bytes that are no message are passed over, a cut file is read as far as it goes; `warnings`
/// tells of both. Throws InputError (`where`, cause) when no message's layout is in it.
DataflashMessages read_dataflash_messages(std::span<const std::byte> bytes,
                                          const std::map<std::string, std::vector<DataflashField>>& wanted,
                                          const std::string& where);

}  // namespace tileflight::flight
